"""A gamepad's readings as what the editor does: rest, thresholds, directions, broken numbers."""

import math
from dataclasses import replace

import pytest

from shapeshift.app.editor.state.camera.camera import FAST
from shapeshift.app.editor.window.devices.input_devices import (
    BUTTONS,
    DEAD,
    REST,
    TURN,
    PadState,
    pad_input,
    stick,
    trigger,
)


def reading(**axes: float) -> PadState:
    names = ("lx", "ly", "rx", "ry", "lt", "rt")
    return PadState(tuple(axes.get(n, rest) for n, rest in zip(names, REST.axes, strict=True)))


def test_a_pad_at_rest_asks_for_nothing():
    asked = pad_input(REST)
    assert not asked.moving and asked.fresh == () and asked.push.pace == 1.0


@pytest.mark.parametrize("value", [0.0, DEAD, -DEAD, math.nan, math.inf])
def test_what_is_within_the_dead_zone_or_no_number_is_rest(value):
    assert stick(value, 0.0) == stick(0.0, value) == (0.0, 0.0)


def test_a_stick_rises_from_the_edge_of_the_dead_zone_to_1_and_no_further():
    strengths = [stick(v / 100, 0)[0] for v in range(16, 101)]
    assert strengths == sorted(strengths) and 0 < strengths[0] < 1e-3
    assert stick(1.0, 0.0) == (1.0, 0.0)
    assert math.hypot(*stick(1.0, 1.0)) == pytest.approx(1.0), "a square gate is no faster"


@pytest.mark.parametrize("value,strength", [(-1.0, 0.0), (2 * DEAD - 1 - 1e-9, 0.0), (1.0, 1.0)])
def test_triggers(value, strength):
    assert trigger(value) == strength
    assert trigger(math.nan) == 0


def test_sticks_move_and_turn_the_eye_in_their_directions():
    asked = pad_input(reading(lx=1.0))
    assert (asked.push.right, asked.push.up, asked.push.forward) == (1.0, 0.0, 0.0)
    assert pad_input(reading(ly=-1.0)).push.forward == 1.0  # away from the person
    assert pad_input(reading(rt=1.0)).push.up == 1.0 and pad_input(reading(lt=1.0)).push.up == -1.0
    right = pad_input(reading(rx=1.0))
    assert (right.yaw, right.pitch) == (-TURN, 0.0)  # yaw is positive to the left
    assert pad_input(reading(ry=-1.0)).pitch == TURN  # up
    fast = replace(reading(lx=1.0), pressed=frozenset({"left stick"}))
    assert pad_input(fast).push.pace == FAST


def test_a_button_counts_once_until_it_is_let_go():
    down = PadState(pressed=frozenset({"A", "left"}))
    assert set(pad_input(down).fresh) == {"A", "left"}
    assert pad_input(down, down).fresh == ()
    assert pad_input(down, REST).fresh == tuple(n for n in BUTTONS if n in ("A", "left"))
