"""The offset of a rig's second camera: gradients by poses, and a planted offset found again."""

from dataclasses import replace

import numpy as np
import pytest

from rasterizer.device import open_device
from rasterizer.reference import finite_differences, render_reference
from runtime_models.model import BadFile
from scene.capture import Capture
from scene.pose import View, look_at, perspective
from training.drawing import camera_of, draw_splats, splats_backward
from training.gaussians import Gaussians
from training.rig import (
    calibrate,
    moved_by,
    offset_view,
    pose_gradient,
    rig_of,
    with_found,
)
from training.settings import TrainSettings
from training.synthetic.balls import make_balls

RNG = np.random.default_rng
TWICE = f'{{"RGB": {(2 * np.eye(4)).ravel().tolist()}}}'


def some_splats(random: np.random.Generator, count: int = 20) -> tuple:
    return (
        random.uniform(-0.5, 0.5, (count, 3)),
        random.uniform(0.05, 0.3, (count, 3)),
        random.normal(size=(count, 4)) * 1.7,  # of any length
        random.uniform(0.2, 0.8, count),
        random.uniform(0, 1, (count, 3)),
    )


def test_exp_of_six_numbers_is_that_of_their_matrix():
    from scipy.linalg import expm

    for size in (0.0, 1e-9, 1e-5, 0.3, 2.0):
        x, y, z, *shift = size * RNG(1).normal(size=6)
        generator = np.zeros((4, 4))
        generator[:3] = [[0, -z, y, shift[0]], [z, 0, -x, shift[1]], [-y, x, 0, shift[2]]]
        np.testing.assert_allclose(
            moved_by(np.array([x, y, z, *shift])), expm(generator), atol=1e-9
        )


def test_the_gradient_by_the_pose_is_that_of_differences():
    random, size = RNG(2), (24, 20)
    view = View(look_at((1.0, 1.2, 1.5), (0.1, 0, 0)), perspective(0.8, size), 0.05, 50.0, size)
    splats, wanted = some_splats(random), random.normal(size=(3, 20, 24))

    def loss(six: np.ndarray) -> float:
        moved = offset_view(view, moved_by(six))
        return float((render_reference(splats, camera_of(moved))[0] * wanted).sum())

    device = open_device("cpu")
    on_device = Gaussians(*(device.upload(np.float32(a)) for a in splats))
    drawing = draw_splats(device, on_device, view, (0.0, 0.0, 0.0))
    grad, _ = splats_backward(device, drawing, device.upload(np.float32(wanted)))
    by_pose = pose_gradient(
        view, splats[0], splats[2], device.download(grad.means), device.download(grad.wxyz)
    )
    exact = finite_differences(loss, np.zeros(6), 1e-5).ravel()
    np.testing.assert_allclose(by_pose, exact, atol=1e-4 * np.abs(exact).max())


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Capture:
    return make_balls(tmp_path_factory.mktemp("balls"), size=80, views=20, test_views=1)


def test_the_same_seed_finds_the_same_offset(balls):
    small = replace(balls, photos=balls.photos[::4])
    settings = TrainSettings(anchors=500, downscale=2)
    device = open_device("cpu")
    first, second = (calibrate(device, small, settings, "Thermal", 40) for _ in range(2))
    np.testing.assert_array_equal(first.offset, second.offset)
    assert 0 < first.turn_deg < 10
    np.testing.assert_allclose(first.offset[:3, :3] @ first.offset[:3, :3].T, np.eye(3), atol=1e-9)


def test_a_modality_that_is_not_there_or_alone_is_refused(balls):
    with pytest.raises(BadFile, match="no modality 'X-ray' to calibrate; it has RGB, Thermal"):
        calibrate(None, balls, TrainSettings(), "X-ray")
    alone = replace(balls, stops=balls.stops[:1])
    with pytest.raises(BadFile, match="is its only modality"):
        calibrate(None, alone, TrainSettings(), "RGB")


@pytest.mark.parametrize(
    "rig",
    [
        "[]",
        "{",
        '{"RGB": 3}',
        '{"RGB": [0]}',
        f'{{"RGB": {[float("inf")] * 16}}}',
        7,
        "[" * 9999,
        TWICE,
    ],
)
def test_offsets_that_are_none_are_refused(balls, rig):
    with pytest.raises(BadFile, match="is none"):
        with_found(balls, rig)


def test_without_an_offset_nothing_moves(balls):
    assert with_found(balls, rig_of({})) is balls
    assert with_found(balls, rig_of({"settings": [1]})) is balls
    assert rig_of({"settings": {"rig": "x"}}) == "x"
