"""Cameras and the slider as numbers: what stays, what is limited, what does not depend on dt."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from app.controls import MAX_RADII, MIN_RADII, POLE, Camera, Push
from runtime_models.model import Stop
from scene.control import Sweep, ease, snap, unease
from scene.framing import fit_distance, orbit_path

SIZE = (640, 360)
CENTRE = np.array([1.0, 2.0, 3.0])
RADIUS = 0.7
STOPS = (Stop("bone", 0.0), Stop("muscle", 0.5), Stop("skin", 1.0))


def camera() -> Camera:
    return Camera(orbit_path(1, CENTRE, RADIUS, SIZE)[0], CENTRE, RADIUS)


def settle(cam: Camera, seconds: float = 5.0) -> Camera:
    cam.step(seconds)
    assert not cam.moving
    return cam


def matrix(cam: Camera) -> np.ndarray:
    return cam.view(SIZE).world_from_eye.matrix()


def where_on_screen(cam: Camera, point: np.ndarray) -> np.ndarray:
    view = cam.view(SIZE)
    clip = view.clip_from_eye() @ view.eye_from_world() @ np.r_[point, 1]
    return clip[:2] / clip[3]


def assert_same_view(one: Camera, other: Camera, atol: float = 1e-9):
    np.testing.assert_allclose(matrix(one), matrix(other), atol=atol)


def test_the_first_view_is_the_one_it_was_made_from():
    want = orbit_path(1, CENTRE, RADIUS, SIZE)[0]
    view = camera().view(SIZE)
    np.testing.assert_allclose(
        view.world_from_eye.matrix(), want.world_from_eye.matrix(), atol=1e-12
    )
    np.testing.assert_allclose(view.tangents, want.tangents)
    assert not camera().moving
    for other in orbit_path(5, CENTRE, RADIUS, SIZE):
        np.testing.assert_allclose(
            matrix(Camera(other, CENTRE, RADIUS)), other.world_from_eye.matrix(), atol=1e-12
        )


@given(some.lists(some.tuples(some.floats(-3, 3), some.floats(-3, 3)), max_size=8))
def test_orbit_keeps_its_distance_even_on_the_way(turns):
    cam = camera()
    distance = np.linalg.norm(cam.position - CENTRE)
    for yaw, pitch in turns:
        cam.turn(yaw, pitch)
        cam.step(0.017)
        assert np.linalg.norm(cam.position - CENTRE) == pytest.approx(distance)
        np.testing.assert_allclose(where_on_screen(cam, CENTRE), 0, atol=1e-9)


def test_the_pole_is_never_reached():
    cam = camera()
    for pitch in (100.0, -300.0):
        cam.turn(0.3, pitch)
        settle(cam)
        up = matrix(cam)[:3, 1]
        assert up[1] == pytest.approx(np.cos(POLE)) and up[1] > 0  # never upside down


def test_dolly_stays_between_its_limits_and_is_undone():
    cam = camera()
    start = cam.distance
    cam.dolly(3)
    assert cam.distance < start
    cam.dolly(-3)
    assert cam.distance == pytest.approx(start)
    cam.dolly(1000)
    assert cam.distance == pytest.approx(MIN_RADII * RADIUS)
    assert settle(cam).view(SIZE).near <= cam.distance
    cam.dolly(-1000)
    assert cam.distance == pytest.approx(MAX_RADII * RADIUS)


def test_pan_moves_the_target_by_that_part_of_the_height():
    cam = camera()
    cam.pan(0.25, -0.5)
    np.testing.assert_allclose(
        where_on_screen(settle(cam), CENTRE), [-0.5 * SIZE[1] / SIZE[0], 1.0], atol=1e-9
    )


@pytest.mark.parametrize("flying", [False, True])
@pytest.mark.parametrize("push", [Push(), Push(1, 0, 1), Push(-1, 1, 0, pace=5.0)])
def test_two_short_steps_are_one_long_step(flying, push):
    one, two, many = camera(), camera(), camera()
    for cam, steps in [(one, 1), (two, 2), (many, 1000)]:
        if flying:
            cam.toggle_flying()
        cam.turn(0.4, -0.2)
        cam.dolly(2)
        for _ in range(steps):
            cam.step(0.010 / steps, push)
    assert_same_view(one, two, atol=1e-12)
    assert_same_view(one, many, atol=1e-9)


def test_the_picture_comes_to_rest_exactly_on_its_goal():
    cam = camera()
    cam.turn(0.5, 0.1)
    assert cam.moving
    for _ in range(200):
        cam.step(1 / 60)
    assert not cam.moving
    before = matrix(cam)
    cam.step(1 / 60)
    np.testing.assert_array_equal(matrix(cam), before)


def test_switching_between_orbit_and_flight_moves_nothing_even_under_way():
    cam = camera()
    cam.turn(0.5, 0.1)
    cam.dolly(2)
    cam.step(0.02)
    before = matrix(cam)
    cam.toggle_flying()
    np.testing.assert_allclose(matrix(cam), before, atol=1e-12)
    cam.toggle_flying()
    np.testing.assert_allclose(matrix(cam), before, atol=1e-12)
    settle(cam)
    np.testing.assert_allclose(where_on_screen(cam, CENTRE), 0, atol=1e-9)


def test_flying_turns_on_the_spot_and_keys_move_along_the_eye():
    cam = camera()
    cam.toggle_flying()
    before = cam.position
    cam.turn(1.0, 0.3)
    settle(cam)
    np.testing.assert_allclose(cam.position, before, atol=1e-12)
    forward = -matrix(cam)[:3, 2]
    cam.step(1.0, Push(forward=1))
    settle(cam)
    moved = cam.position - before
    np.testing.assert_allclose(moved / np.linalg.norm(moved), forward, atol=1e-9)
    assert np.linalg.norm(moved) == pytest.approx(0.8 * RADIUS, rel=1e-3)


def test_shift_is_faster_and_ctrl_slower_by_their_factors():
    gone = []
    for pace in (0.2, 1.0, 5.0):
        cam = camera()
        before = cam.position
        cam.step(2.0, Push(right=1, pace=pace))
        gone.append(np.linalg.norm(settle(cam).position - before))
    np.testing.assert_allclose(np.array(gone) / gone[1], [0.2, 1, 5], rtol=1e-9)


@pytest.mark.parametrize("flying", [False, True])
def test_focus_brings_a_point_to_the_middle(flying):
    cam = camera()
    if flying:
        cam.toggle_flying()
    point = CENTRE + np.array([0.3, -0.2, 0.1])
    before = matrix(cam)
    cam.focus(point)
    np.testing.assert_allclose(matrix(cam), before, atol=1e-12)  # nothing jumps
    settle(cam)
    np.testing.assert_allclose(where_on_screen(cam, point), 0, atol=1e-9)
    if not flying:
        np.testing.assert_allclose(cam.target, point, atol=1e-9)


@pytest.mark.parametrize("flying", [False, True])
def test_frame_shows_the_sphere_and_reset_is_the_first_view(flying):
    cam = camera()
    if flying:
        cam.toggle_flying()
    cam.turn(5.0, 0.4)
    cam.dolly(-9)
    settle(cam)
    direction = matrix(cam)[:3, 2]
    cam.frame(CENTRE, fit_distance(RADIUS, SIZE))
    settle(cam)
    np.testing.assert_allclose(matrix(cam)[:3, 2], direction, atol=1e-9)
    np.testing.assert_allclose(where_on_screen(cam, CENTRE), 0, atol=1e-9)
    assert np.linalg.norm(cam.position - CENTRE) == pytest.approx(fit_distance(RADIUS, SIZE))
    cam.reset()
    assert_same_view(settle(cam), camera())


@pytest.mark.parametrize(
    ("x", "want"),
    [(0.49, 0.5), (0.519, 0.5), (0.53, 0.53), (-3, 0), (7, 1), (0.019, 0), (0.97, 0.97)],
)
def test_snap_goes_to_a_stop_that_is_near_and_stays_in_range(x, want):
    assert snap(x, STOPS) == pytest.approx(want)
    assert snap(0.49, STOPS, reach=0) == 0.49  # Alt held
    assert snap(0.3, ()) == 0.3


@given(some.floats(0, 1))
def test_unease_is_the_inverse_of_ease(t):
    assert unease(ease(t)) == pytest.approx(t, abs=1e-6)
    assert ease(unease(t)) == pytest.approx(t, abs=1e-9)


def test_sweep_visits_every_stop_rests_there_and_returns():
    sweep = Sweep.over(STOPS)
    leg = sweep.leg_s + sweep.rest_s
    for i, want in enumerate([0, 0.5, 1, 0.5, 0]):
        assert Sweep(sweep.xs, seconds=i * leg).x == pytest.approx(want)
        assert Sweep(sweep.xs, seconds=i * leg + sweep.rest_s * 0.99).x == pytest.approx(want)
    xs = [sweep.advance(sweep.period / 1000) for _ in range(1000)]
    assert max(xs) == 1 and min(xs) == 0
    assert np.abs(np.diff(xs)).max() < 0.006  # no jumps
    assert sweep.x == pytest.approx(0)


@given(some.floats(0, 1), some.floats(0, 14))
def test_sweep_resumes_where_the_hand_left_the_slider(x, seconds):
    sweep = Sweep.over(STOPS)
    sweep.seconds = seconds
    backwards = seconds % sweep.period >= sweep.period / 2
    sweep.resume_at(x)
    assert sweep.x == pytest.approx(x, abs=1e-6)
    now = sweep.x
    later = sweep.advance(0.01)
    turning = x in (0.0, 1.0) or sweep.seconds % (sweep.period / 2) < 0.02
    assert turning or (later <= now if backwards else later >= now)


def test_sweep_is_of_time_not_of_frames_and_stops_keep_their_place():
    one, many = Sweep.over(STOPS), Sweep.over(STOPS)
    for _ in range(100):
        many.advance(0.013)
    assert one.advance(1.3) == pytest.approx(many.x)
    place = one.seconds
    one.resume_at(one.x)
    assert one.seconds == place


def test_a_single_stop_has_nothing_to_play():
    assert Sweep.over((Stop("only", 0.3),)).advance(5.0) == 0.3
    assert Sweep.over(()).advance(5.0) == 0.0
