"""Cameras and the slider as numbers: what stays, what is limited, what does not depend on dt."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from shapeshift.app.editor.state.camera.camera import (
    DIRECTIONS,
    MAX_RADII,
    MIN_RADII,
    POLE,
    EditorCamera,
    Push,
)
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import StopBlend, StopWeights
from shapeshift.scene.cameras.framing import fit_distance, orbit_path
from shapeshift.scene.control import EASES, MODES, Sweep, ease, snap, unease
from shapeshift.scene.scene import Scene, SceneObject

SIZE = (640, 360)
CENTRE = np.array([1.0, 2.0, 3.0])
RADIUS = 0.7
STOPS = (Stop("bone", 0.0), Stop("muscle", 0.5), Stop("skin", 1.0))


def camera() -> EditorCamera:
    return EditorCamera(orbit_path(1, CENTRE, RADIUS, SIZE)[0], CENTRE, RADIUS)


def settle(cam: EditorCamera, seconds: float = 5.0) -> EditorCamera:
    cam.step(seconds)
    assert not cam.moving
    return cam


def matrix(cam: EditorCamera) -> np.ndarray:
    return cam.view(SIZE).world_from_eye.matrix()


def where_on_screen(cam: EditorCamera, point: np.ndarray) -> np.ndarray:
    view = cam.view(SIZE)
    clip = view.clip_from_eye() @ view.eye_from_world() @ np.r_[point, 1]
    return clip[:2] / clip[3]


def assert_same_view(one: EditorCamera, other: EditorCamera, atol: float = 1e-9):
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
            matrix(EditorCamera(other, CENTRE, RADIUS)), other.world_from_eye.matrix(), atol=1e-12
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


@pytest.mark.parametrize("flying", [False, True])
@pytest.mark.parametrize("name", DIRECTIONS)
def test_views_from_the_sides_are_level_and_keep_their_distance(flying, name):
    cam = camera()
    if flying:
        cam.toggle_flying()
    cam.turn(2.0, 0.7)
    settle(cam)
    eye, target, distance = cam.position, cam.target, cam.distance
    cam.look_from(name)
    settle(cam)
    sides = {
        "front": (0, 0, 1), "back": (0, 0, -1), "right": (1, 0, 0), "left": (-1, 0, 0),
        "top": (0, 1, 0), "bottom": (0, -1, 0),
    }  # fmt: skip
    axes = matrix(cam)[:3, :3]
    np.testing.assert_allclose(axes[:, 2], sides[name], atol=1e-6)
    assert axes[1, 0] == pytest.approx(0, abs=1e-9)  # right is level
    assert np.linalg.det(axes) == pytest.approx(1)
    wanted = eye if flying else target + distance * np.array(sides[name])
    np.testing.assert_allclose(cam.position, wanted, atol=1e-6)


def test_from_straight_above_it_turns_on_without_a_jump():
    cam = camera()
    cam.look_from("top")
    settle(cam)
    cam.turn(0.2, 0.0)
    settle(cam)
    np.testing.assert_allclose(matrix(cam)[:3, 2], (0, 1, 0), atol=1e-6)
    cam.turn(0.0, 0.01)
    settle(cam)
    assert matrix(cam)[1, 2] == pytest.approx(np.cos(0.01), abs=1e-6)
    cam.turn(0.0, -9.0)  # back to the pole that hands may reach, not beyond
    settle(cam)
    assert matrix(cam)[:3, 1][1] >= 0


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
    sweep = Sweep.over(StopBlend(STOPS))
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
    sweep = Sweep.over(StopBlend(STOPS))
    sweep.seconds = seconds
    backwards = seconds % sweep.period >= sweep.period / 2
    sweep.resume_at(x)
    assert sweep.x == pytest.approx(x, abs=1e-6)
    now = sweep.x
    later = sweep.advance(0.01)
    turning = x in (0.0, 1.0) or sweep.seconds % (sweep.period / 2) < 0.02
    assert turning or (later <= now if backwards else later >= now)


def test_sweep_is_of_time_not_of_frames_and_stops_keep_their_place():
    one, many = Sweep.over(StopBlend(STOPS)), Sweep.over(StopBlend(STOPS))
    for _ in range(100):
        many.advance(0.013)
    assert one.advance(1.3) == pytest.approx(many.x)
    place = one.seconds
    one.resume_at(one.x)
    assert one.seconds == place


def test_a_single_stop_has_nothing_to_play():
    assert Sweep.over(StopBlend((Stop("only", 0.3),))).advance(5.0) == 0.3
    assert Sweep.over(StopBlend(())).advance(5.0) == 0.0


@pytest.mark.parametrize("name", EASES)
def test_every_pace_goes_from_0_to_1_forwards_and_has_its_inverse(name):
    forward, inverse = EASES[name]
    t = np.linspace(0, 1, 101)
    y = np.array([forward(v) for v in t])
    assert y[0] == 0 and y[-1] == 1 and (np.diff(y) > 0).all()
    np.testing.assert_allclose([inverse(v) for v in y], t, atol=1e-7)


@pytest.mark.parametrize(
    ("mode", "way"),
    [("ping-pong", [0, 0.5, 1, 0.5, 0, 0.5]), ("loop", [0, 0.5, 1, 0, 0.5, 1]),
     ("once", [0, 0.5, 1, 1, 1, 1])],
)  # fmt: skip
@pytest.mark.parametrize("ease_name", EASES)
def test_after_the_last_stop_each_mode_goes_its_own_way(mode, way, ease_name):
    sweep = Sweep.over(StopBlend(STOPS))
    sweep.mode, sweep.ease, sweep.rest_s = mode, ease_name, 0.0
    assert sweep.play(0.0) == 0.0
    got = [sweep.x] + [sweep.advance(sweep.leg_s) for _ in way[1:]]
    np.testing.assert_allclose(got, way, atol=1e-9)
    assert sweep.playing == (mode != "once")


def test_the_way_back_of_a_loop_passes_no_stop_between():
    sweep = Sweep.over(StopBlend(STOPS))
    sweep.mode, sweep.rest_s, sweep.ease = "loop", 0.0, "even"
    sweep.seconds = 2.5 * sweep.leg_s
    halfway = StopWeights((("bone", 0.5), ("skin", 0.5)))
    assert sweep.control == halfway and sweep.x == pytest.approx(0.5)
    sweep.resume_at(halfway)
    assert sweep.seconds == 2.5 * sweep.leg_s
    sweep.resume_at(0.5)  # a hand puts it on the stop that lies there
    assert sweep.blend.weights(sweep.control).tolist() == [0, 1, 0]
    sweep.resume_at(halfway)
    assert sweep.control == halfway


def test_between_two_stops_that_are_visited_the_others_do_not_show():
    sweep = Sweep((0.0, 1.0), StopBlend(STOPS), rest_s=0.0)
    for _ in range(40):
        assert sweep.blend.weights(sweep.advance(0.1))[1] == 0


def test_played_once_it_rests_at_the_end_and_the_next_play_begins_anew():
    sweep = Sweep.over(StopBlend(STOPS))
    sweep.mode = "once"
    sweep.play(0.0)
    sweep.advance(100.0)
    assert not sweep.playing and sweep.x == 1.0
    assert sweep.play(1.0) == 0.0 and sweep.playing and sweep.x == 0.0
    assert sweep.play(0.3) == 0.3  # from where the hand has left it


@given(
    some.sampled_from(MODES), some.sampled_from(list(EASES)), some.floats(0.2, 20),
    some.floats(0, 10), some.floats(0, 1), some.floats(0, 30),
)  # fmt: skip
def test_changing_how_it_plays_does_not_move_it(mode, pace, leg, rest, x, seconds):
    sweep = Sweep.over(StopBlend(STOPS))
    sweep.seconds = seconds
    sweep.resume_at(x)
    sweep.mode, sweep.ease, sweep.leg_s, sweep.rest_s = mode, pace, leg, rest
    sweep.resume_at(x)  # what the state does before each step
    assert sweep.x == pytest.approx(x, abs=1e-6)
    sweep.advance(1e-4)
    assert abs(sweep.x - x) < 0.02


def test_the_stage_visits_two_stops_at_least():
    state = EditorState(lambda path: Dummy(STOPS))
    state.sweeps = [Sweep.over(StopBlend(STOPS))]
    state.scene = Scene((SceneObject("a", Dummy(STOPS), x=0.5),))
    state.visit(0, 0.0, on=False)
    assert state.sweeps[0].xs == (0.5, 1.0)
    state.visit(0, 1.0, on=False)
    assert state.sweeps[0].xs == (0.5, 1.0) and state.sliders == [0]
    state.visit(0, 0.0, on=True)
    assert state.sweeps[0].xs == (0.0, 0.5, 1.0)


@dataclass
class Dummy:
    """What a state needs of a model to play it."""

    stops: tuple

    @property
    def blend(self) -> StopBlend:
        return StopBlend(self.stops)
