"""The slider in the real window, by events that the X server sends: knob, names, keys, typing."""

import numpy as np
import pytest

from tests.support.desktop.desktop_stand import run_frames

ACCENT = np.array([242, 161, 69])  # app/editor/panels/widgets/theme.py
NAMES_PX = 34  # of the bar, from its upper edge: padding, and the names of the stops


def x_of(viewer) -> float:
    return viewer.state.scene.objects[0].x


def put(viewer, x: float) -> None:
    viewer.state.set_x(0, x)
    run_frames(viewer, 3)


def knob(viewer) -> tuple[float, float, float]:
    """Middle (x, y) and radius of the knob as it is seen in the picture, pixels."""
    viewer.window.begin_frame()
    viewer.draw_splats()
    viewer.draw_overlay()
    viewer.window.end_frame()
    left, top, right, bottom = map(int, viewer.window.covered[1])
    part = viewer.window.picture()[top + NAMES_PX : bottom, left:right].astype(int)
    lit = np.abs(part - ACCENT).max(axis=2) < 60
    tall = lit.sum(axis=0)  # the line is 4 high, the knob as high as it is wide
    columns = np.flatnonzero(tall > 5)
    rows = np.flatnonzero(lit[:, columns].any(axis=1))
    x, y = (columns[0] + columns[-1] + 1) / 2, (rows[0] + rows[-1] + 1) / 2
    return left + x, top + NAMES_PX + y, (rows[-1] - rows[0] + 1) / 2


def track_ends(viewer) -> tuple[float, float]:
    """Where x = 0 and x = 1 lie, logical pixels."""
    before, ends = x_of(viewer), []
    for x in (0.0, 1.0):
        put(viewer, x)
        ends.append(knob(viewer)[0])
    put(viewer, before)
    return tuple(ends)


@pytest.mark.parametrize("x", [0.0, 0.37, 1.0])
@pytest.mark.parametrize(
    "place",
    [(0, 0), *((side, off, axis) for side in (-1, 1) for off in (-1, 0, 1) for axis in "xy")],
)
def test_the_knob_is_gripped_all_over(viewer, hands, x, place):
    """Taken at its middle and around each of its edges, it goes as far as the mouse does."""
    low, high = track_ends(viewer)
    put(viewer, x)
    middle_x, middle_y, radius = knob(viewer)
    side, off, *axis = place
    by = side * (radius - 0.5) + side * off  # just inside, on, and just beside the edge
    start = (middle_x + by * (axis != ["y"]), middle_y + by * (axis == ["y"]))
    hands.move(*start)
    hands.button(True)
    assert x_of(viewer) == x  # a press moves nothing
    far = 80 if x < 0.5 else -80
    hands.move(start[0] + far, start[1])
    assert x_of(viewer) == pytest.approx(x + far / (high - low), abs=1.5 / (high - low))
    hands.button(False)
    hands.move(start[0], start[1] - 100)
    assert x_of(viewer) == pytest.approx(x + far / (high - low), abs=1.5 / (high - low))


def test_a_drag_between_two_frames_is_whole(viewer, hands):
    """Where a frame takes half a second, a hand is faster than that."""
    low, high = track_ends(viewer)
    x, y, _ = knob(viewer)
    hands.flick((x, y), (x + 0.3 * (high - low), y))
    assert x_of(viewer) == pytest.approx(0.3, abs=1.5 / (high - low))
    hands.move(x, y - 60)
    assert x_of(viewer) == pytest.approx(0.3, abs=1.5 / (high - low))


@pytest.mark.parametrize("x", [0.0, 1.0])
def test_the_knob_comes_back_to_its_end_and_beyond_it_stays(viewer, hands, x):
    middle_x, y, _ = knob(viewer) if x == 0 else (put(viewer, x), knob(viewer))[1]
    inward = 60 if x == 0 else -60
    hands.move(middle_x, y)
    hands.button(True)
    hands.move(middle_x + inward, y)
    assert x_of(viewer) != x
    hands.move(middle_x - inward, y)
    assert x_of(viewer) == x
    hands.button(False)


def test_a_press_beside_the_knob_brings_it_there(viewer, hands):
    low, high = track_ends(viewer)
    _, y, _ = knob(viewer)
    hands.click(low + 0.6 * (high - low), y)
    assert x_of(viewer) == pytest.approx(0.6, abs=1 / (high - low))


def test_a_press_on_a_knob_beside_a_stop_leaves_it_there(viewer, hands):
    put(viewer, 0.012)  # typed, or by Alt: within reach of the stop
    hands.click(*knob(viewer)[:2])
    assert x_of(viewer) == 0.012


def test_a_click_on_a_stops_name_goes_there(viewer, hands):
    left, top, right, _ = viewer.window.covered[1]
    _, high = track_ends(viewer)
    hands.click(high - 20, top + 12 + 8)  # "thermal" ends where the track does
    run_frames(viewer, 2, seconds=0.5)  # the way there takes SHIFT_S
    assert x_of(viewer) == 1.0
    assert left < high < right


def test_arrow_keys_step_and_shift_goes_to_the_next_stop(viewer, hands):
    hands.move(600, 200)
    for _ in range(3):
        hands.key("Right")
    assert x_of(viewer) == 0.03
    hands.key("Left")
    assert x_of(viewer) == 0.02
    hands.key("Right", "Shift_L")
    run_frames(viewer, 2, seconds=0.5)
    assert x_of(viewer) == 1.0
    hands.key("Right")
    hands.key("Right", "Shift_L")
    run_frames(viewer, 2, seconds=0.5)
    assert x_of(viewer) == 1.0
    hands.key("Left", "Shift_L")
    run_frames(viewer, 2, seconds=0.5)
    assert x_of(viewer) == 0.0
    hands.key("Left")
    assert x_of(viewer) == 0.0


def test_x_is_typed_as_a_number_or_a_name(viewer, hands):
    right = viewer.window.covered[1][2]
    field = (right - 30, knob(viewer)[1])
    for text, x in (("0.274", 0.274), ("Thermal", 1.0), ("0,5", 0.5)):
        hands.click(*field)
        hands.type(text)
        hands.key("Return")
        assert x_of(viewer) == x
    for text in ("7", "nothing"):
        hands.click(*field)
        hands.type(text)
        hands.key("Return")
        assert x_of(viewer) == 0.5
        assert text in viewer.state.problem and "photo, thermal" in viewer.state.problem
        viewer.state.problem = ""
    hands.click(*field)
    hands.type("0.9")
    hands.key("Escape")
    assert x_of(viewer) == 0.5


def test_typing_beside_other_keys_moves_nothing_else(viewer, hands):
    """While the number is typed, arrows and letters are the field's."""
    right, y = viewer.window.covered[1][2], knob(viewer)[1]
    before = viewer.viewpoint.view().eye_from_world()
    hands.click(right - 30, y)
    hands.key("Right")
    hands.key("w")
    hands.key("Escape")
    assert x_of(viewer) == 0.0
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), before)
    hands.key("Right")
    assert x_of(viewer) == 0.01


def test_the_seconds_of_playing_are_beside_the_play_button(viewer, hands):
    left, top, _, bottom = viewer.window.covered[1]
    y = knob(viewer)[1]
    hands.click(left + 80, y)  # the seconds: a list opens
    assert viewer.window.popup_open
    hands.key("Escape")
    assert not viewer.window.popup_open
    hands.click(left + 30, (top + bottom) / 2)
    assert viewer.state.playing
    hands.click(left + 30, (top + bottom) / 2)
    assert not viewer.state.playing
