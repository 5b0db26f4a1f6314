"""What a person sees must not change unnoticed: pictures kept in tests/golden, llvmpipe only.

python -m pytest tests/renderer/gl/test_golden.py --regenerate     writes them anew; look at them
"""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.scene import Scene
from tests.support.splat_scenes import (
    alone,
    front_view,
    random_layers,
    random_model,
    stereo_views,
    two_objects,
)

GOLDEN = Path(__file__).resolve().parents[2] / "golden"
SIZE = (200, 150)
ONE_STEP = 1.01 / 255  # half of it is the rounding to 8 bits


def thermal() -> Scene:
    cloud = random_layers(2500, seed=9)
    stops = (Stop("rgb", 0.0), Stop("heat", 1.0, "thermal", "ironbow"))
    fields = (cloud.means, cloud.scales, cloud.wxyz, cloud.opacity, cloud.sh, cloud.layer)
    return alone(SplatLayers(*fields, stops), x=0.8)


CASES = {
    "objects": (lambda: two_objects(4000), lambda: front_view(SIZE), RenderSettings()),
    "off_centre": (lambda: two_objects(4000), lambda: stereo_views(SIZE)[1], RenderSettings()),
    "networks": (
        lambda: alone(random_model(300), x=0.3),
        lambda: front_view(SIZE, distance=2.5),
        RenderSettings(background=(1.0, 1.0, 1.0)),
    ),
    "thermal": (thermal, lambda: front_view(SIZE), RenderSettings(background=(0.1, 0.1, 0.15))),
    "limits": (
        lambda: two_objects(4000),
        lambda: front_view(SIZE),
        RenderSettings(max_pixels=2.0, max_distance=4.3, min_alpha=0.05, key_bits=16),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_the_picture_is_the_golden_one(ctx, name, request):
    if "llvmpipe" not in ctx.info["GL_RENDERER"]:
        pytest.skip(f"golden images need llvmpipe, this is {ctx.info['GL_RENDERER']}")
    make_scene, make_view, settings = CASES[name]
    with Renderer(ctx, "quads", target="rgba32f") as renderer:
        renderer.settings = settings
        renderer.update(make_scene())
        renderer.draw([make_view()])
        picture = np.clip(renderer.resolved(), 0, 1)
    path = GOLDEN / f"{name}.png"
    if request.config.getoption("--regenerate"):
        Image.fromarray((picture * 255 + 0.5).astype(np.uint8)).save(path, optimize=True)
    golden = np.asarray(Image.open(path), np.float32) / 255
    assert picture.shape == golden.shape
    worst = np.abs(picture - golden).max()
    assert worst < ONE_STEP, f"{path.name} differs by {worst * 255:.1f} of 255; look at both"
