"""The offset of a rig's second camera: gradients by poses, and a planted offset found again."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.calibration.calibrate import (
    PYRAMID,
    ShapeResiduals,
    calibrate,
    descend,
    factors_of,
    reference_of,
    still_warning,
)
from shapeshift.training.calibration.extrinsics import (
    moved_by,
    offset_of_matrix,
    offset_view,
    pose_gradient,
    rig_of,
    with_extrinsics,
)
from shapeshift.training.drawing import camera_of, draw_splats, splats_backward
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from tests.support.renderer.rasterizer_reference import finite_differences, render_reference
from tools.synthetic.strangers import make_stranger

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


def loaded(view: View, picture: np.ndarray, weight: np.ndarray | None = None) -> LoadedPhoto:
    opaque = np.full((*picture.shape, 1), 255, np.uint8)
    gray = np.clip(np.rint(255 * picture), 0, 255).astype(np.uint8)
    rgba = np.concatenate([gray[..., None].repeat(3, axis=2), opaque], axis=2)
    return LoadedPhoto(view, "Thermal", rgba, weight, "some.png")


def views_about(count: int, size: tuple[int, int]) -> list[View]:
    turns = np.arange(count) * 2.4
    eyes = np.stack([1.9 * np.sin(turns), 0.4 + turns / 9, 1.9 * np.cos(turns)], axis=1)
    pinhole = perspective(0.8, size)
    return [View(look_at(eye, (0, 0.02, 0)), pinhole, 0.05, 50.0, size) for eye in eyes]


def some_frozen(count: int, photos: int, size: tuple[int, int]) -> tuple[ShapeResiduals, tuple]:
    """Splats, and photos of noise that they are to show; one photo counts by halves."""
    random, device = RNG(4), open_device("cpu")
    splats = some_splats(random, count)
    shape = tuple(device.upload(np.float32(a)) for a in splats[:4])
    noise = [
        loaded(view, random.random(size[::-1]), random.random(size[::-1]) if i == 0 else None)
        for i, view in enumerate(views_about(photos, size))
    ]
    return ShapeResiduals(device, shape, noise, 0.2, 1.9), splats


def error_of(residuals: ShapeResiduals, splats: tuple, gray: np.ndarray, step: np.ndarray) -> float:
    """Half the mean square error by the plain renderer, in float64."""
    error = 0.0
    for photo, weight in zip(residuals.photos, residuals.weights, strict=True):
        camera = camera_of(offset_view(photo.view, step))
        color = (residuals.view_basis(photo) * gray).sum(axis=1, keepdims=True).repeat(3, axis=1)
        picture, through = render_reference((*splats[:4], color), camera)[:2]
        missing = picture[0] + residuals.behind * through - photo.rgba[..., 0] / 255
        error += 0.5 * (weight * missing**2).sum()
    return error / residuals.values


def test_the_slope_by_the_offset_is_that_of_differences():
    residuals, splats = some_frozen(25, 2, (26, 22))
    residuals.gray = RNG(6).random((25, 4))
    residuals.move_cameras(np.eye(4))
    cost, slope = residuals.cost_and_gradient()
    exact = finite_differences(
        lambda six: error_of(residuals, splats, residuals.gray, residuals.step(six)),
        np.zeros(6),
        1e-5,
    ).ravel()
    assert cost == pytest.approx(error_of(residuals, splats, residuals.gray, np.eye(4)), rel=1e-5)
    np.testing.assert_allclose(slope, exact, atol=2e-4 * np.abs(exact).max())


def test_the_brightness_is_that_of_least_squares():
    residuals, _ = some_frozen(14, 3, (26, 22))
    residuals.move_cameras(moved_by(np.full(6, 0.02)))
    pictures = []

    def keep(i: int, picture: np.ndarray) -> np.ndarray:
        pictures.append(picture.copy())
        return picture * 0

    for one in np.eye(14 * 4):
        residuals.adjoint(one.reshape(14, 4), 0.0, keep)
    residuals.adjoint(np.zeros((14, 4)), residuals.behind, keep)
    columns = np.reshape(pictures[:-3], (14 * 4, -1)).T
    wanted = (np.array(residuals.wanted) - pictures[-3:]).ravel()
    root = np.sqrt([np.broadcast_to(w, (22, 26)) for w in residuals.weights]).ravel()
    # of the four numbers of a splat three photos tell three: the fourth is left at what it was
    best = np.linalg.lstsq(columns * root[:, None], wanted * root, rcond=1e-4)[0]
    least = 0.5 * ((root * (wanted - columns @ best)) ** 2).sum() / residuals.values
    before = residuals.cost_and_gradient()[0]
    for _ in range(8):
        residuals.solve_brightness(40)
    now = residuals.cost_and_gradient()[0]
    assert before > 1.2 * least
    assert now == pytest.approx(least, rel=1e-5)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow), None])
def test_where_the_shape_is_right_the_offset_is_found_exactly(seed):
    random, device, size = RNG(8), open_device("cpu"), (64, 48)
    splats = some_splats(random, 60)
    splats[1][:] *= 0.4
    shape = tuple(device.upload(np.float32(a)) for a in splats[:4])
    six = np.zeros(6) if seed is None else RNG(seed).normal(size=6) * np.repeat([0.02, 0.02], 3)
    true, gray = moved_by(six), splats[4][:, :1].repeat(3, axis=1)
    photos = []
    for view in views_about(12, size):
        camera = camera_of(offset_view(view, true))
        photos.append(loaded(view, render_reference((*splats[:4], gray), camera)[0][0]))
    residuals = ShapeResiduals(device, shape, photos, 0.0, 1.9)
    offset, _ = descend(residuals, np.eye(4), None, 25)
    left = offset_of_matrix(np.linalg.inv(true) @ offset)
    assert left.turn_deg < 0.02
    assert left.shift_m < 1e-3


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Capture:
    return make_balls(tmp_path_factory.mktemp("balls"), size=80, views=20, test_views=1)


def test_the_same_seed_finds_the_same_offset(balls):
    small = replace(balls, photos=balls.photos[::4])
    settings = TrainSettings(max_anchors=500, downscale=2)
    device, levels = open_device("cpu"), (replace(PYRAMID[1], tries=2),)
    first, second = (calibrate(device, small, settings, "Thermal", 40, levels) for _ in range(2))
    np.testing.assert_array_equal(first.offset, second.offset)
    assert 0 < first.turn_deg < 10
    np.testing.assert_allclose(first.offset[:3, :3] @ first.offset[:3, :3].T, np.eye(3), atol=1e-9)


def test_a_modality_that_is_not_there_or_alone_is_refused(balls):
    with pytest.raises(BadFile, match="no modality 'X-ray' to calibrate; it has RGB, Thermal"):
        calibrate(None, balls, TrainSettings(), "X-ray")
    no_photos = replace(balls, photos=tuple(p for p in balls.photos if p.modality == "RGB"))
    with pytest.raises(BadFile, match="'Thermal' has no training photos"):
        calibrate(None, no_photos, TrainSettings(), "Thermal")
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
        with_extrinsics(balls, rig)


def test_without_an_offset_nothing_moves(balls):
    assert with_extrinsics(balls, rig_of({})) is balls
    assert with_extrinsics(balls, rig_of({"settings": [1]})) is balls
    assert rig_of({"settings": {"rig": "x"}}) == "x"


def test_light_is_what_others_are_held_to(balls):
    assert reference_of(balls, "Thermal").name == "RGB"
    assert reference_of(balls, "RGB").name == "Thermal"
    x_ray = replace(balls.stops[1], name="X-ray", x=0.9)
    three = replace(balls, stops=(*balls.stops, x_ray))
    assert reference_of(three, "X-ray").name == "RGB"
    assert reference_of(replace(three, stops=three.stops[1:]), "X-ray").name == "Thermal"


def test_both_modalities_are_read_with_pixels_of_one_angle(balls):
    assert factors_of(balls, "Thermal", "RGB", 1) == (1, 1)
    assert factors_of(balls, "Thermal", "RGB", 3) == (3, 3)
    larger = tuple(
        replace(p, view=p.view.resized((480, 480))) if p.modality == "RGB" else p
        for p in balls.photos
    )
    assert factors_of(replace(balls, photos=larger), "Thermal", "RGB", 1) == (1, 6)
    assert factors_of(replace(balls, photos=larger), "RGB", "Thermal", 1) == (2, 1)


@pytest.mark.parametrize("kind", ["turntable", "cut_out"])
def test_what_stands_still_behind_a_calibrated_camera_is_said(tmp_path, kind):
    """Not where masks leave it out, nor where nothing does."""
    make_stranger(tmp_path, kind, 1, (80, 60), 12)
    said = still_warning(read_capture(tmp_path), TrainSettings(), "RGB")
    assert bool(said) == (kind == "turntable")
    if said:
        assert said.startswith("RGB: ") and "--calibrate does not leave that out" in said


def test_of_a_room_nothing_is_said(balls):
    assert still_warning(balls, TrainSettings(), "Thermal") == ""
    assert still_warning(balls, TrainSettings(), "Sound") == "", "that calibrate refuses"
