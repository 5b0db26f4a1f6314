"""Kernels are for any vendor: those that a GPU would be given compile for targets that are none.

PoCL compiles for the processor itself, where __global is plain memory and a double is at hand.
clang has front ends of NVIDIA's and of SPIR's address spaces; what NVIDIA's own compiler refuses in
addition (builtins with plain pointers) is in tests/program/test_kernels.py.
"""

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.rasterizer.device import open_device
from shapeshift.rasterizer.program import read_source
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.tiles import paged_tiles
from shapeshift.renderer.tiles.paged_tiles import PagedTiles
from shapeshift.scene.pose import stereo_pair
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.renderer.heat_scenes import VIEW, model, scene_of
from tests.support.splat_scenes import random_layers

pytestmark = pytest.mark.slow
TARGETS = ("nvptx64-nvidia-cl", "spir64-unknown-unknown")  # NVIDIA; Intel and others
LEAST_PROGRAMS = 27  # as many as a GPU is given below: none is forgotten


@pytest.fixture(scope="module")
def clang() -> str:
    names = ("clang", *(f"clang-{version}" for version in range(22, 13, -1)))
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        pytest.skip("no clang is installed (apt-get install clang-15)")
    return found


@pytest.fixture(scope="module")
def programs(tmp_path_factory) -> list[tuple]:
    """(path, defines) of what a GPU builds to draw heads, harmonics and heat, and to train."""
    as_gpu = replace(open_device("cpu"), kind="gpu", programs={})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paged_tiles, "PagedTiles", lambda mlps: PagedTiles(as_gpu, mlps))
        renderer = Renderer(None)
    with renderer:
        renderer.settings = replace(renderer.settings, depth_scale=0.5)  # on a grid of its own
        layers = random_layers(400, coefficients=16)
        scenes = (scene_of(model(), x=0.9), Scene((SceneObject("layers", layers),)))
        for scene in scenes:
            renderer.update(scene)
            for views in ([VIEW], stereo_pair(VIEW, 0.06)):
                renderer.draw(views)
            renderer.surface(VIEW)
    balls = make_balls(tmp_path_factory.mktemp("balls"), size=48, views=6, test_views=2)
    trainer = Trainer(as_gpu, balls, TrainSettings(iterations=4, max_anchors=100))
    for _ in range(4):
        trainer.one_step()
    assert np.isfinite(trainer.model().anchors).all()
    return list(as_gpu.programs)


@pytest.mark.parametrize("target", TARGETS)
def test_every_program_compiles(clang, programs, target, tmp_path):
    assert len(programs) >= LEAST_PROGRAMS

    def said(number: int) -> str:
        path, defines = programs[number]
        source = tmp_path / f"{number}.cl"
        source.write_text(read_source(Path(path))[0])
        numbers = {n: f"{v!r}f" if isinstance(v, float) else int(v) for n, v in defines}
        options = [f"-D{name}={number}" for name, number in numbers.items()]
        done = subprocess.run(
            [clang, "-x", "cl", "-cl-std=CL1.2", "-target", target, "-fsyntax-only", "-Xclang",
             "-finclude-default-header", *options, str(source)],
            capture_output=True, text=True,
        )  # fmt: skip
        return f"{path}: {done.stderr[-2000:]}" if done.returncode else ""

    with ThreadPoolExecutor(2) as pool:
        assert not [text for text in pool.map(said, range(len(programs))) if text]
