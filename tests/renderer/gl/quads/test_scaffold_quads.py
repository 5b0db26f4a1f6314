"""A Scaffold-GS scene in quads: decoded on the CPU, uploaded, equal to the oracle."""

import numpy as np
import pytest

from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import make_random_model
from tests.support.splat_scenes import psnr_db
from tests.support.splats.scaffold_scenes import CASES, TURNED, made, seen_from


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
def test_quads_are_the_oracle_from_every_eye(ctx, tmp_path, case, mlps):
    model = made(tmp_path, **CASES[case])
    scene = Scene((SceneObject("scaffold", model, TURNED),))
    with Renderer(ctx, "quads", mlps, target="rgba32f") as renderer:
        for eye in ((0, 0.3, 3), (2.5, 0, -1)):
            renderer.update(scene)
            stats = renderer.draw([seen_from(*eye)])
            assert (stats.geometry_runs, stats.color_runs) == (1, 1)
            assert psnr_db(renderer.image(0), reference_image(scene, seen_from(*eye))) > 55


def test_what_decodes_is_said(ctx, tmp_path):
    model = made(tmp_path, anchors=20)
    both = (SceneObject("s", model), SceneObject("m", make_random_model(30)))
    with Renderer(ctx, "quads", "gl") as renderer:
        for objects, said in ((both, "gl, Scaffold-GS onnxruntime"), (both[1:], "gl")):
            renderer.update(Scene(objects))
            renderer.draw([seen_from(0, 0.2, 3)])
            assert renderer.backends["mlps"] == said
            assert np.isfinite(renderer.image(0)).all()
