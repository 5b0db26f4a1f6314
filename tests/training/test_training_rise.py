"""A gentle start: where photos are mostly background, all splats must not vanish together."""

from dataclasses import replace

import numpy as np
import pytest

import tests.support.training.fit_scenes as fit_scenes
from shapeshift.rasterizer.reference import finite_differences
from shapeshift.runtime_models.model import Stop
from shapeshift.training.checkpoint import read_checkpoint, write_checkpoint
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.rise import (
    AFTER_A_FALL,
    FAINT,
    LEAST_RATE,
    PULL,
    Rise,
    after_fall,
    draw_up,
)
from shapeshift.training.settings import TrainSettings
from shapeshift.training.train import Trainer
from tests.support.training.training_runs import bits, run

SETTINGS = TrainSettings(iterations=450, grow=False, max_anchors=600)


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
    rise = Rise(10, since=5)
    shares = [rise.share(i) for i in range(5, 17)]
    np.testing.assert_allclose(shares[:10], np.maximum((np.arange(1, 11) / 10) ** 2, LEAST_RATE))
    assert shares[9:] == [1, 1, 1] and rise.going(14) and not rise.going(15)
    rates = {"weights": np.full(3, 0.5, np.float32), "features": np.ones(1, np.float32)}
    risen = rise.rates(rates, 9)
    np.testing.assert_allclose(risen["weights"], 0.125)
    assert risen["features"] is rates["features"]
    assert Rise().rates(rates, 0) is rates and not Rise().going(0) and Rise().share(0) == 1


def test_after_a_fall_poisoned_rates_are_halved_first():
    before = Rise(0, 0)
    assert after_fall(70, 25.0, before) is before
    assert after_fall(70, 1.0, before) == Rise(AFTER_A_FALL, 70, PULL)


@pytest.mark.parametrize("count", [1, 63, 64, 65, 300])
def test_the_pull_on_absent_splats_is_the_gradient_of_its_term(device, count):
    rng = np.random.default_rng(count)
    opacity = rng.uniform(-0.1, 0.1, count).astype(np.float32)
    given = rng.normal(size=count).astype(np.float32)
    on_device = [device.upload(v) for v in (opacity, given)]
    splats, grad = (Gaussians(None, None, None, array, None) for array in on_device)
    draw_up(device, splats, grad, 0.7)

    def term(values: np.ndarray) -> float:
        return float(0.7 * np.maximum(FAINT - values, 0).mean())

    wanted = given + finite_differences(term, opacity.astype(np.float64), 1e-9)
    np.testing.assert_allclose(device.download(grad.opacity), wanted, rtol=1e-5, atol=1e-6)


def test_a_capture_of_shapes_apart_falls_once_and_is_learned(device, apart):
    trainer = run(Trainer(device, apart, SETTINGS))
    assert trainer.guard.trips >= 1 and trainer.rise.pull == max(PULL, trainer.settings.revive)
    for name, psnr in trainer.held_out_psnr(9).items():
        assert psnr > 20, (name, psnr)  # 13 dB is an empty picture


def test_who_asks_for_a_gentle_start_does_not_fall(device, apart, tmp_path):
    settings = replace(SETTINGS, iterations=300, rise=150, revive=0.01)
    whole = run(Trainer(device, apart, settings))
    assert whole.guard.trips == 0
    for name, psnr in whole.held_out_psnr(9).items():
        assert psnr > 20, (name, psnr)
    part = run(Trainer(device, apart, settings), steps=60)  # while the rates rise
    write_checkpoint(tmp_path / "c.npz", *part.checkpoint())
    resumed = run(Trainer(device, apart, settings, read_checkpoint(tmp_path / "c.npz")))
    assert bits(resumed) == bits(whole)
