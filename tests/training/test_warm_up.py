"""Where photos are mostly background, splats must not vanish together: warm-up and a loss."""

from dataclasses import replace

import numpy as np
import pytest

import tests.support.training.fit_scenes as fit_scenes
from shapeshift.runtime_models.model import Stop
from shapeshift.training.checkpoint import read_checkpoint, write_checkpoint
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.losses.losses import (
    MIN_OPACITY,
    MIN_OPACITY_SHARE,
    UNTIL,
    add_min_opacity_gradient,
    min_opacity_share,
)
from shapeshift.training.schedule import LEAST_RATE, WARM_UP_STEPS, LrWarmup
from shapeshift.training.settings import TrainSettings
from shapeshift.training.train import Trainer
from tests.support.renderer.rasterizer_reference import finite_differences
from tests.support.training.training_runs import run

# With one base colour for both stops, what each photo shows white draws the colours of both to
# white; with one for each the run is never lost.
SETTINGS = TrainSettings(
    iterations=450, grow=False, max_anchors=600, anchor_attributes="frame,color"
)


@pytest.fixture(scope="module")
def apart(tmp_path_factory):
    """A ball at one stop, a cube elsewhere at the other, and white all around."""
    with pytest.MonkeyPatch.context() as patch:
        alone = (
            (Stop("Ball", 0.0), (fit_scenes.BALL,), "RGB"),
            (Stop("Cube", 1.0), (fit_scenes.CUBE,), "RGB"),
        )
        patch.setitem(fit_scenes.SHAPES, "alone", alone)
        return fit_scenes.make_shapes(tmp_path_factory.mktemp("apart"), "alone")


def test_rates_rise_quadratically_and_only_those_of_the_networks():
    warm_up, last = LrWarmup(5), 5 + WARM_UP_STEPS
    factors = [warm_up.factor(i) for i in range(5, last + 2)]
    shares = np.arange(1, WARM_UP_STEPS + 1) / WARM_UP_STEPS
    np.testing.assert_allclose(factors[:WARM_UP_STEPS], np.maximum(shares**2, LEAST_RATE))
    assert factors[WARM_UP_STEPS - 1 :] == [1, 1, 1]
    assert warm_up.changes(last - 1) and not warm_up.changes(last)
    rates = {"weights": np.full(3, 0.5, np.float32), "features": np.ones(1, np.float32)}
    half = warm_up.rates(rates, 4 + WARM_UP_STEPS // 2)
    np.testing.assert_allclose(half["weights"], 0.125)
    assert half["features"] is rates["features"]
    none = LrWarmup()
    assert none.rates(rates, 0) is rates and not none.changes(0) and none.factor(0) == 1


@pytest.mark.parametrize("count", [1, 63, 64, 65, 300])
def test_the_loss_of_absent_splats_has_its_gradient(device, count):
    rng = np.random.default_rng(count)
    opacity = rng.uniform(-0.1, 0.1, count).astype(np.float32)
    given = rng.normal(size=count).astype(np.float32)
    on_device = [device.upload(v) for v in (opacity, given)]
    splats, grad = (Gaussians(None, None, None, array, None) for array in on_device)
    add_min_opacity_gradient(device, splats, grad, 0.7)

    def term(values: np.ndarray) -> float:
        return float(0.7 * np.maximum(MIN_OPACITY - values, 0).mean())

    wanted = given + finite_differences(term, opacity.astype(np.float64), 1e-9)
    np.testing.assert_allclose(device.download(grad.opacity), wanted, rtol=1e-5, atol=1e-6)


def test_shapes_apart_with_base_colours_for_each_stop_are_learned_at_once(device, apart):
    trainer = run(Trainer(device, apart, replace(SETTINGS, anchor_attributes="frame,stop_color")))
    assert not trainer.guard.rollbacks
    assert min(trainer.held_out_psnr(9).values()) > 20  # 13 dB is an empty picture


@pytest.mark.slow
def test_a_capture_of_shapes_apart_is_turned_back_once_and_learned(device, apart, tmp_path):
    whole, file = Trainer(device, apart, SETTINGS), tmp_path / "c.npz"
    for now in whole.steps():
        if whole.lr_warmup.start is not None and now.iteration == whole.lr_warmup.start + 30:
            write_checkpoint(file, *whole.checkpoint())  # while the rates rise
    assert whole.guard.rollbacks >= 1 and whole.lr_warmup.start is not None
    for name, psnr in whole.held_out_psnr(9).items():
        assert psnr > 20, (name, psnr)  # 13 dB is an empty picture
    resumed = run(Trainer(device, apart, SETTINGS, read_checkpoint(file)))
    assert resumed.lr_warmup == whole.lr_warmup
    for name, psnr in resumed.held_out_psnr(9).items():
        assert psnr > 20, (name, psnr)


def test_the_loss_of_faint_splats_ends_where_stops_are_told_apart():
    after = np.nextafter(UNTIL, 1)
    times = (0, UNTIL, after, 1)
    shares = [min_opacity_share(2, 0.0, done) for done in times]
    assert shares == [MIN_OPACITY_SHARE] * 2 + [0] * 2
    for stops, blended in ((1, 0.0), (3, 0.1)):  # one shape; or shapes between stops are drawn
        assert {min_opacity_share(stops, blended, done) for done in times} == {MIN_OPACITY_SHARE}
