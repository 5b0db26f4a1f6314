"""A 3D mouse's readings as what the editor does: rest, ends, directions in flight and in orbit."""

import math

import numpy as np
import pytest

from shapeshift.app.editor.state.camera.camera import EditorCamera, Push
from shapeshift.app.editor.window.devices.space_mice import (
    DEAD,
    DOLLY,
    TURN,
    CapInput,
    CapState,
    cap_input,
    cap_of_axes,
    share,
)
from shapeshift.scene.pose import View, look_at

REST = CapState()
AXES = ("right", "up", "ahead", "about_right", "about_up", "roll")


def test_a_cap_at_rest_asks_for_nothing():
    for flying in (False, True):
        assert cap_input(REST, REST, flying) == CapInput()
        assert not cap_input(REST, REST, flying).moving


@pytest.mark.parametrize("value", [0.0, DEAD, -DEAD, 5e-324, math.nan, math.inf, -math.inf])
def test_what_is_within_the_dead_zone_or_no_number_is_rest(value):
    assert share(value) == 0.0


def test_a_share_rises_from_the_edge_of_the_dead_zone_to_1_and_no_further():
    shares = [share(v / 100) for v in range(5, 101)]
    assert shares == sorted(shares) and 0 < shares[0] < 2e-3
    assert share(1.0) == share(1e9) == 1.0
    assert share(np.nextafter(DEAD, 1)) > 0
    assert [share(-v / 100) for v in range(5, 101)] == [-s for s in shares]


@pytest.mark.parametrize("axis", AXES[:5])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_orbit_is_flight_the_other_way_round(axis, way):
    """In flight the eye moves, in orbit the scene: the same motion of the one to the other."""
    cap = CapState(**{axis: way})
    flight, orbit = (cap_input(cap, REST, flying) for flying in (True, False))
    assert flight.moving and orbit.moving
    assert (flight.yaw, flight.pitch) == (-orbit.yaw, -orbit.pitch)
    assert (flight.push.right, flight.push.up) == (-orbit.push.right, -orbit.push.up)
    assert orbit.push.forward == 0.0 and orbit.dolly == -DOLLY * flight.push.forward


def test_directions_of_flight():
    assert cap_input(CapState(1.0, -1.0, 1.0), REST, True).push == Push(1.0, -1.0, 1.0)
    assert cap_input(CapState(about_up=1.0), REST, True).yaw == TURN  # to the left
    assert cap_input(CapState(about_right=-1.0), REST, True).pitch == -TURN  # down
    assert not cap_input(CapState(roll=1.0), REST, True).moving  # the horizon stays level


@pytest.mark.parametrize(
    "axis,what",
    [("right", (1, 0)), ("up", (0, 1)), ("about_up", (1, 0)), ("about_right", (0, -1))],
)
def test_in_orbit_what_is_seen_follows_the_cap(axis, what):
    """A point nearer than the middle moves on the screen as the hand does, right and up."""
    view = View(look_at((0, 0, 3), (0, 0, 0)), (-0.4, 0.4, -0.4, 0.4), 0.05, 50, (100, 100))
    camera = EditorCamera(view, np.zeros(3), 1.0)
    before = on_screen(camera, np.array([0.0, 0.0, 0.5]))
    asked = cap_input(CapState(**{axis: 0.5}), REST, False)
    camera.turn(asked.yaw * 0.1, asked.pitch * 0.1)
    camera.step(0.1, asked.push)
    for _ in range(50):
        camera.step(0.1)
    moved = on_screen(camera, np.array([0.0, 0.0, 0.5])) - before
    assert moved @ np.array(what) > 0.9 * np.linalg.norm(moved) > 0


def on_screen(camera: EditorCamera, point: np.ndarray) -> np.ndarray:
    """(2,) slopes to the right and up."""
    eye_from_world = np.linalg.inv(camera.view((100, 100)).world_from_eye.matrix())
    x, y, z, _ = eye_from_world @ np.append(point, 1.0)
    return np.array([x, y]) / -z


def test_buttons_act_once():
    down = CapState(pressed=frozenset({0, 1}))
    assert cap_input(down, REST, False).fresh == (0, 1)
    assert cap_input(down, down, False).fresh == ()


def test_axes_of_a_joystick_are_those_of_the_cap():
    """HID: X right, Y towards the person, Z down, and turns about these by the right hand."""
    axes_of_cap = {0: ("right", 1), 1: ("ahead", -1), 2: ("up", -1), 3: ("about_right", 1),
                   4: ("roll", -1), 5: ("about_up", -1)}  # fmt: skip
    for number, (name, sign) in axes_of_cap.items():
        axes = [0.0] * 6
        axes[number] = 0.5
        expected = {each: 0.0 for each in AXES} | {name: 0.5 * sign}
        got = cap_of_axes(axes)
        assert {each: getattr(got, each) for each in AXES} == expected
