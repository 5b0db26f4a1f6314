"""Framing: floaters do not move it, all that is seen is in the picture, edge cases are finite."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.cameras.framing import (
    broadside,
    common_side,
    default_background,
    default_view,
    fit_distance,
    frame_points,
    framing_view,
    orbit_path,
    scene_points,
)
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import make_random_model


def ball(count: int = 2000, seed: int = 0) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def layers(means: np.ndarray, provenance: dict | None = None) -> SplatLayers:
    n = len(means)
    return SplatLayers(
        means.astype(np.float32),
        np.full((n, 3), 0.01, np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (n, 1)),
        np.ones(n, np.float32),
        np.zeros((n, 1, 3), np.float32),
        np.zeros(n, np.int32),
        (Stop("a", 0.0),),
        provenance=provenance or {},
    )


def to_ndc(view, points):
    clip = np.c_[points, np.ones(len(points))] @ (view.clip_from_eye() @ view.eye_from_world()).T
    return clip[:, :3] / clip[:, 3:]


def test_floaters_and_faint_splats_do_not_move_the_frame():
    points = ball() * 2 + [1, 2, 3]
    centre, radius = frame_points(points, np.ones(len(points)))
    np.testing.assert_allclose(centre, [1, 2, 3], atol=0.05)
    assert radius == pytest.approx(2, rel=0.03)
    far = np.full((20, 3), 1e6)
    floaters = frame_points(np.r_[points, far], np.ones(len(points) + 20))
    np.testing.assert_allclose(floaters[0], centre, atol=0.05)
    assert floaters[1] == pytest.approx(radius, rel=0.03)
    faint = frame_points(np.r_[points, np.tile(far, (200, 1))], np.r_[np.ones(2000), [0.1] * 4000])
    np.testing.assert_array_equal(faint[0], centre)
    assert faint[1] == radius


@pytest.mark.parametrize(
    "points",
    [np.zeros((0, 3)), np.zeros((1, 3)), np.full((4, 3), np.nan), np.tile([1.0, 2, 3], (9, 1))],
)
def test_nothing_or_one_point_still_gives_a_finite_view(points):
    centre, radius = frame_points(points, np.ones(len(points)))
    assert np.isfinite(centre).all() and radius == 1.0


def test_nan_splats_are_left_out_of_the_frame():
    points = ball()
    bad = points.copy()
    bad[::7, 1] = np.nan
    opacity = np.ones(len(points))
    opacity[::5] = np.nan
    centre, radius = frame_points(bad, opacity)
    assert np.isfinite(centre).all() and radius == pytest.approx(1, rel=0.05)


@pytest.mark.parametrize("size", [(1280, 720), (720, 1280), (64, 64)])
def test_the_whole_sphere_is_inside_every_picture_of_the_orbit(size):
    centre = np.array([3.0, -1.0, 2.0])
    for view in orbit_path(7, centre, 2.0, size):
        ndc = to_ndc(view, ball() * 2 + centre)
        assert np.abs(ndc).max() < 1
        assert np.abs(ndc[:, :2]).max() > 0.85  # and fills it
        assert view.size == size


def test_orbit_is_level_evenly_spaced_and_starts_in_front():
    views = orbit_path(8, np.zeros(3), 1.0, (64, 64))
    eyes = np.array([v.world_from_eye.position for v in views])
    distance = fit_distance(1.0, (64, 64))
    np.testing.assert_allclose(np.linalg.norm(eyes, axis=1), distance)
    np.testing.assert_allclose(eyes[:, 1], np.sin(0.3) * distance)
    assert eyes[0, 0] == pytest.approx(0) and eyes[0, 2] > 0
    steps = np.linalg.norm(eyes - np.roll(eyes, 1, 0), axis=1)
    np.testing.assert_allclose(steps, steps[0])
    assert orbit_path(0, np.zeros(3), 1.0, (64, 64)) == []


def test_default_view_takes_the_view_of_the_package():
    view = default_view(layers(ball(), {"view": {"eye": [0, 1, 5], "target": [0, 1, 0]}}), (80, 60))
    np.testing.assert_allclose(view.world_from_eye.position, [0, 1, 5])
    np.testing.assert_allclose(view.world_from_eye.matrix()[:3, :3], np.eye(3), atol=1e-12)
    framed = default_view(layers(ball()), (80, 60))
    assert np.abs(to_ndc(framed, ball())).max() < 1


@pytest.mark.parametrize("size", [(1280, 720), (360, 640)])
@pytest.mark.parametrize("shape", [(1, 1, 1), (5, 1, 1), (1, 1, 5), (0.2, 4, 0.2), (3, 0, 3)])
def test_default_view_fills_the_picture_whatever_the_shape(shape, size):
    points = ball() * shape
    ndc = to_ndc(default_view(layers(points), size), points)
    assert 0.8 < np.abs(ndc[:, :2]).max() < 1
    floaters = np.r_[points, np.random.default_rng(1).normal(size=(30, 3)) * 100]
    inside = np.abs(to_ndc(default_view(layers(floaters), size), points)[:, :2]).max()
    assert 0.55 < inside < 1.1


@pytest.mark.parametrize("degrees", [-80, -30, 0, 45, 85])
def test_long_things_are_seen_from_their_long_side(degrees):
    angle = np.radians(degrees)
    long_in_x = ball() * [6, 1, 1]
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    got = broadside(long_in_x @ turn.T, np.ones(2000))
    assert np.sin(got - angle) == pytest.approx(0, abs=0.02) and abs(got) <= np.pi / 2
    assert broadside(ball(), np.ones(2000)) == 0.0
    assert broadside(np.zeros((0, 3)), np.zeros(0)) == 0.0


def test_scene_points_are_in_the_world_and_of_visible_objects_only():
    half = np.sqrt(0.5)
    turned = Pose(np.array([0.0, 0, 10]), np.array([half, 0, half, 0]))  # quarter turn about y
    one = layers(np.array([[0.0, 0, -1]]))
    scene = Scene((SceneObject("a", one, turned), SceneObject("b", one, visible=False)))
    means, opacity = scene_points(scene)
    np.testing.assert_allclose(means, [[-1, 0, 10]], atol=1e-6)
    assert opacity.shape == (1,)
    assert scene_points(Scene(()))[0].shape == (0, 3)


@pytest.mark.parametrize(
    "found", [None, "white", [1, 1], [2, 0, 0], [float("nan"), 0, 0], [None] * 3]
)
def test_a_background_that_is_no_colour_is_passed_over(found):
    model = replace(make_random_model(3), provenance={"background": found})
    assert default_background(model, (0.1, 0.2, 0.3)) == (0.1, 0.2, 0.3)


def test_the_background_of_the_photos_is_taken():
    model = replace(make_random_model(3), provenance={"background": [1, 0.5, 0]})
    assert default_background(model, (0.1, 0.2, 0.3)) == (1.0, 0.5, 0.0)


def ring(centre_deg: float, spread_deg: float, count: int = 24) -> list:
    """Views on a circle, spread evenly about one side, degrees about +Y from +Z."""
    angles = np.radians(centre_deg + np.linspace(-1, 1, count) * spread_deg / 2)
    return [
        orbit_path(1, np.zeros(3), 1.0, (64, 48), start=angle, elevation=0.4)[0] for angle in angles
    ]


@pytest.mark.parametrize("side", [0, 40, 90, 170, -120])
@pytest.mark.parametrize("spread", [0, 60, 180])
def test_photos_of_one_side_say_which_it_is(side, spread):
    found = common_side(ring(side, spread))
    assert np.exp(1j * found) == pytest.approx(np.exp(1j * np.radians(side)), abs=1e-6)


def test_photos_from_all_around_say_nothing():
    assert common_side(ring(30, 360 * 23 / 24)) is None and common_side([]) is None
    assert common_side(ring(30, 260)) is None and common_side(ring(30, 200)) is not None
    above = View(look_at(np.array([0.0, 5, 1e-9]), np.zeros(3)), (-1, 1, -1, 1), 0.1, 9.0, (8, 8))
    assert common_side([above]) is None  # straight down there is no side


def test_a_scene_is_framed_from_the_side_that_is_wanted():
    view = framing_view(ball(), np.ones(2000), (64, 48), np.pi)
    x, _, z = view.world_from_eye.position
    assert z < -1 and x == pytest.approx(0, abs=0.05)
