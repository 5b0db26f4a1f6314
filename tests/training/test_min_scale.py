"""The least size of splats: what photos could tell, and the slope that holds it."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.first_anchors.views import pixel_of
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.losses.losses import SLOPE, MinScale
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.renderer.rasterizer_reference import finite_differences
from tests.support.training.training_runs import bits, run, run_keeping

RNG = np.random.default_rng
SIZE = (40, 30)


def views(count: int) -> list[View]:
    eyes = RNG(3).normal(size=(count, 3)) * (1, 0.5, 2) + (0.1, 1, 0)
    tangents = perspective(0.9, SIZE)
    return [View(look_at(eye, np.zeros(3)), tangents, 0.05, 50.0, SIZE) for eye in eyes]


@pytest.mark.parametrize("count", [1, 15, 16, 17, 200])
def test_a_pixel_is_that_of_the_finest_photo_that_shows_the_place(device, count):
    anchors = RNG(count).uniform(-1.5, 1.5, (count, 3)).astype(np.float32)
    every = views(5)
    wanted = np.full(count, np.inf)
    for view in every:
        camera_from_world, fx, fy, *_ = view.pinhole()
        depth = anchors @ camera_from_world[2, :3] + camera_from_world[2, 3]
        wanted = np.where(
            pixel_of(view, anchors)[1], np.minimum(wanted, depth / max(fx, fy)), wanted
        )
    bound = MinScale(device, every, 2, 0.45)
    bound.look(device.upload(anchors))
    found = device.download(bound.pixels)
    np.testing.assert_allclose(found, np.where(np.isfinite(wanted), wanted, 0), rtol=1e-5)


@pytest.mark.parametrize("some", [False, True])
def test_the_slope_is_that_of_the_logarithms_below_the_bound(device, some):
    """Differences of SLOPE * max(log(least / scale), 0), summed; of the anchors of a step alone."""
    anchors = RNG(1).uniform(-0.4, 0.4, (6, 3)).astype(np.float32)
    bound = MinScale(device, views(4), 2, 0.45)
    bound.look(device.upload(anchors))
    rows = np.array([4, 1, 5], np.int32) if some else np.arange(6, dtype=np.int32)
    least = 0.45 * device.download(bound.pixels)[rows].repeat(2)[:, None]
    scales = least * np.exp(RNG(2).normal(size=(len(least), 3)))
    scales[0, 0] = 0.0  # no logarithm: no slope
    count = len(scales)

    def loss(values: np.ndarray) -> float:
        with np.errstate(divide="ignore"):
            below = np.log(least / np.where(scales > 0, values, np.inf))
        return SLOPE * float(np.maximum(below, 0).sum())

    def splats(values: np.ndarray) -> Gaussians:
        shapes = ((count, 3), (count, 3), (count, 4), (count,), (count, 3))
        arrays = [device.zeros(shape) for shape in shapes]
        arrays[1] = device.upload(np.float32(values))
        return Gaussians(*arrays)

    grad = splats(np.ones((count, 3)))
    grad.scales.fill(0)
    bound.add_gradient(splats(scales), grad, device.upload(rows) if some else None)
    wanted = finite_differences(loss, scales, 1e-7)
    largest = np.abs(wanted).max()
    assert largest > 0
    np.testing.assert_allclose(device.download(grad.scales), wanted, atol=1e-3 * largest)
    none = MinScale(device, views(1), 2, 0.0)
    none.look(device.upload(anchors))
    untouched = splats(np.ones((count, 3)))
    none.add_gradient(splats(scales), untouched, None)
    assert (device.download(untouched.scales) == 1).all() and none.state() == {}


SETTINGS = TrainSettings(iterations=70, max_anchors=900, grow_every=20, min_scale_px=0.45)


def test_a_run_with_it_leaves_fewer_thin_splats_and_resumes_to_the_bit(device, tmp_path):
    balls = make_balls(tmp_path, size=48, views=6, test_views=1)
    plain = run(Trainer(device, balls, replace(SETTINGS, min_scale_px=0.0)))
    bound, kept = run_keeping(Trainer(device, balls, SETTINGS), tmp_path, 33)
    assert not np.array_equal(
        plain.adam.state()["weights.value"], bound.adam.state()["weights.value"]
    )
    resumed = run(Trainer(device, balls, SETTINGS, *kept))
    assert bits(resumed) == bits(bound)


@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_a_bound_that_is_none_is_refused(value):
    with pytest.raises(ValueError, match="min_scale_px"):
        replace(SETTINGS, min_scale_px=value)
