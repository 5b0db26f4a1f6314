"""What real and ray-traced captures need, from the largest model to the smallest."""

from pathlib import Path

import pytest

from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.fit.ablation import COMPONENTS, DROPPED, KEPT, SHAPE_HEADS
from shapeshift.training.fit.fit import Fit
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
pytestmark = pytest.mark.slow


def need_of(capture, components, **settings):
    settings = TrainSettings(grow=False, **settings)
    return Fit(
        open_device("cpu"), capture, settings, 0.5, 1, lambda what, done: None, components
    ).run()


def test_layers_of_the_leg_do_not_share_a_shape():
    if not (DATA / "anatomy_leg_3modal_views").is_dir():
        pytest.skip("the capture anatomy_leg_3modal_views is not here")
    capture = read_capture(DATA / "anatomy_leg_3modal_views")
    need = need_of(capture, COMPONENTS[:1], iterations=180, max_anchors=1200, downscale=5)
    assert need.decisions[0].verdict == KEPT and "bone" in need.decisions[0].needed_by
    assert need.decisions[0].change["bone"].mean < -1
    assert need.outlines["bone", "full"] < need.outlines["muscle", "full"]


def test_balls_in_visible_light_and_heat_do(tmp_path):
    need = need_of(
        make_balls(tmp_path, size=64, views=16, test_views=4),
        COMPONENTS,
        iterations=200,
        max_anchors=800,
    )
    words = {verdict.part: verdict.verdict for verdict in need.decisions}
    assert words["shape that follows x"] == DROPPED
    assert words["colour that follows x"] == KEPT
    assert words["what no stop shows"] == DROPPED
    assert words["features as float32 instead of float16"] == DROPPED
    assert set(SHAPE_HEADS) <= set(need.settings.layout(2).fixed)
    assert need.fitted.bytes < 0.6 * need.full.bytes
    for name, before in need.full.psnr.items():
        assert need.fitted.psnr[name].mean() > before.mean() - 0.5
