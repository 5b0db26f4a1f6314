"""The slider's track in numbers: gripping, ticks, steps, what is typed; what the viewer says."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state import arrange
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source
from shapeshift.app.editor.state.messages import LONGEST, MOST_PROBLEMS, NOTE_S, Messages
from shapeshift.app.editor.state.shown_scene import SplitState, name_of
from shapeshift.app.editor.state.track import Grip, Track, half_ways, next_stop, read_x, stepped
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.control import SNAP, Shift
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.desktop.opened_states import model, state_of

STOPS = (Stop("RGB", 0.0), Stop("Thermal", 0.5), Stop("Opened", 1.0))
TRACK = Track(left=100.0, width=400.0, knob=10.0)


@pytest.mark.parametrize("x", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("off", [-10.0, -9.0, 0.0, 9.0, 10.0])
def test_a_knob_keeps_under_the_finger(x, off):
    grip, mouse = Grip(), TRACK.place(x) + off
    grip.press(TRACK, (x,), mouse)
    assert grip.drag(TRACK, x, mouse, STOPS) == x  # a press alone
    assert grip.drag(TRACK, x, mouse + 20, STOPS, 0.0) == pytest.approx(min(x + 0.05, 1))
    assert grip.drag(TRACK, x, mouse - 20, STOPS, 0.0) == pytest.approx(max(x - 0.05, 0))
    assert grip.drag(TRACK, x, mouse, STOPS, 0.0) == pytest.approx(x)  # back where it was taken


@pytest.mark.parametrize("off", [-10.1, 10.1, 60.0])
def test_beside_the_knob_it_comes_to_the_mouse(off):
    grip, mouse = Grip(), TRACK.place(0.3) + off
    grip.press(TRACK, (0.3,), mouse)
    assert grip.drag(TRACK, 0.3, mouse, STOPS, 0.0) == pytest.approx(0.3 + off / 400)


def test_of_two_knobs_the_nearer_is_taken_and_the_upper_of_equals():
    grip = Grip()
    for mouse, knob in ((90.0, 0), (290.0, 0), (310.0, 1), (500.0, 1)):
        grip.press(TRACK, (0.2, 0.8), mouse)
        assert grip.knob == knob
    grip.press(TRACK, (0.5, 0.5), 300.0)
    assert grip.knob == 1


def test_stops_catch_the_knob_on_the_way():
    grip = Grip()
    grip.press(TRACK, (0.0,), 100.0)
    inside, outside = 0.5 + SNAP - 1e-9, math.nextafter(0.5 + SNAP, 1) + 1e-9
    assert grip.drag(TRACK, 0.0, TRACK.place(inside), STOPS) == 0.5
    assert grip.drag(TRACK, 0.0, TRACK.place(outside), STOPS) == pytest.approx(outside)
    assert grip.drag(TRACK, 0.0, TRACK.place(inside), STOPS, 0.0) == pytest.approx(inside)
    assert grip.drag(TRACK, 0.0, -1e9, STOPS) == 0 and grip.drag(TRACK, 0.0, 1e9, STOPS) == 1


def test_half_ways_and_next_stops():
    assert half_ways(STOPS) == [0.25, 0.75]
    assert half_ways(()) == half_ways(STOPS[:1]) == []
    assert half_ways((Stop("a", 1.0), Stop("b", 0.0), Stop("c", 0.0))) == [0.5]
    for x, up, down in (
        (0.0, 0.5, 0.0), (0.49, 0.5, 0.0), (0.5, 1.0, 0.0), (0.51, 1.0, 0.5), (1.0, 1.0, 0.5),
        (0.5 + 1e-9, 1.0, 0.0),
    ):  # fmt: skip
        assert (next_stop(STOPS, x, 1), next_stop(STOPS, x, -1)) == (up, down)
    assert next_stop((), 0.3, 1) == 0.3


def test_a_hundred_steps_are_the_whole_track_exactly():
    x = 0.0
    for count in range(1, 101):
        x = stepped(x, 1)
        assert x == count / 100
    assert stepped(x, 1) == 1.0 and stepped(0.0, -1) == 0.0 and stepped(0.274, 1) == 0.284


@pytest.mark.parametrize(
    ("text", "x"),
    [
        ("0", 0.0), ("1", 1.0), ("0.274", 0.274), (" .5 ", 0.5), ("0,25", 0.25), ("1e-3", 0.001),
        ("Thermal", 0.5), ("opened", 1.0), (" RGB ", 0.0),
    ],
)  # fmt: skip
def test_x_that_is_typed(text, x):
    assert read_x(text, STOPS) == x


@pytest.mark.parametrize("text", ["", "nan", "inf", "-0.1", "1.0001", "bone", "0.5.5", "x" * 999])
def test_what_is_no_x_is_one_sentence_with_the_stops(text):
    with pytest.raises(ValueError, match="RGB, Thermal, Opened") as told:
        read_x(text, STOPS)
    assert len(str(told.value)) < 200 and "\n" not in str(told.value)


def test_of_a_rings_two_ends_the_name_means_the_first():
    assert read_x("normal", (Stop("normal", 0.0), Stop("ice", 0.5), Stop("normal", 1.0))) == 0.0


# Two values of x at once


def obj(name: str, x: float, stops=STOPS) -> SceneObject:
    one = np.zeros((1, 3), np.float32)
    model = SplatLayers(
        one, one + 1, np.array([[1, 0, 0, 0]], np.float32), np.ones(1, np.float32),
        one[:, None], np.zeros(1, np.int32), tuple(stops),
    )  # fmt: skip
    return SceneObject(name, model, x=x)


def test_the_other_side_is_thermal_where_there_is_such_a_stop():
    thermal = (STOPS[0], Stop("Heat", 0.5, "thermal"), STOPS[2])
    for stops, x, wanted in ((thermal, 0.0, 0.5), (thermal, 0.5, 0.0), (STOPS, 0.2, 1.0)):
        state = SplitState()
        state.toggle(obj("a", x, stops))
        assert state.on and abs(state.x - wanted) <= (wanted == 0.0)  # of equals either end
    state.toggle(obj("a", 0.2))
    assert not state.on
    going = obj("a", 0.46, thermal)  # a key has sent it to Heat, and it is not there yet
    state = SplitState()
    state.toggle(going, way=Shift(0.0, 0.5, going.model.blend, 0.3))
    assert state.on and state.x != 0.5


def test_one_object_alone_is_another_right_of_the_line():
    scene, state = Scene((obj("a", 0.0), obj("b", 0.0))), SplitState(True, "b", 0.75)
    right = state.right(scene)
    assert [obj.x for obj in right.objects] == [0.0, 0.75]
    assert right.objects[0] is scene.objects[0]
    assert SplitState(True, "gone", 0.75).right(scene) is scene
    assert name_of(0.5, STOPS) == "Thermal" and name_of(0.274, STOPS) == "x 0.27"


# What is said


def test_a_note_ends_once_and_longer_ones_later():
    messages = Messages()
    messages.say("one", 10.0)
    assert not messages.ended(10.0 + NOTE_S - 1e-6) and messages.note == "one"
    assert messages.ended(10.0 + NOTE_S) and messages.note == ""
    assert not messages.ended(99.0)
    messages.say("two\nlines", 0.0)
    assert not messages.ended(NOTE_S) and messages.ended(2 * NOTE_S)
    messages.say("how", 0.0, 9.0)
    assert not messages.ended(8.9) and messages.ended(9.0)


def test_problems_stay_in_order_without_repeating_and_the_oldest_go():
    messages = Messages()
    for sentence in ("a", "b", "a"):
        messages.fail(sentence)
    assert messages.problems == ["b", "a"]
    for number in range(MOST_PROBLEMS):
        messages.fail(str(number))
    assert messages.problems == [str(number) for number in range(MOST_PROBLEMS)]
    messages.dismiss("1")
    assert messages.problems == ["0", "2"] and messages.dismiss_newest()
    assert messages.problems == ["0"] and messages.dismiss_newest()
    assert not messages.dismiss_newest()
    messages.fail("x" * 5000)
    assert len(messages.problems[0]) == LONGEST


# ---- What was cut out of a scene goes along with its slider.


@pytest.fixture
def chained() -> EditorState:
    """A scene, two things that were cut out of it, and one with stops of its own."""
    other = replace(model("cold"), stops=(Stop("cold", 0.0), Stop("warm", 1.0)))
    rows = [("background", model("RGB")), ("mug", model("RGB")), ("nut", model("RGB"))]
    rows.append(("lamp", other))
    items = [SceneItem(name=name, model=f"/{name}.ply") for name, _ in rows]
    file = SceneFile(folder=Path("/"), background=items[0], items=tuple(items[1:]))
    sources = tuple(Source(Path(f"/{n}.ply"), m) for n, m in rows)
    return state_of(OpenedFiles(sources, file, Path("/a.scene.json")))


def xs(state: EditorState) -> list[float]:
    return [obj.slider_x for obj in state.scene.objects]


def test_one_slider_moves_what_was_cut_out_until_somebody_says_otherwise(chained):
    state = chained
    assert state.movable == [0, 1, 2, 3] and state.tracks == state.sliders == [0, 3]
    arrange.steer_by_hand(state, 0, 0.25)
    assert xs(state) == [0.25, 0.25, 0.25, 0.0]
    assert [item.x for item in state.edited.file.all_items] == xs(state)  # it starts there, too
    state.chosen = "mug"  # its keys are the scene's
    arrange.step_x(state, 1)
    assert xs(state) == [0.26, 0.26, 0.26, 0.0]
    arrange.go_to_stop(state, 0, 1)
    state.advance(0.1)
    assert 0.26 < xs(state)[0] < 1 and len(set(xs(state)[:3])) == 1
    state.finish_shifts()
    assert xs(state) == [1.0, 1.0, 1.0, 0.0]
    arrange.all_go_to_stop(state, 0)
    state.finish_shifts()
    assert xs(state) == [0.0] * 4

    arrange.unchain(state, 1)
    assert state.tracks == [0, 1, 3]
    arrange.steer_by_hand(state, 1, 1.0)
    arrange.steer_by_hand(state, 0, 0.5)
    assert xs(state) == [0.5, 1.0, 0.5, 0.0]
    assert xs(state_of_file(state)) == xs(state)  # and so it opens again, apart
    arrange.rejoin(state, 1)
    assert xs(state) == [0.5, 0.5, 0.5, 0.0] and state.tracks == [0, 3]


def state_of_file(state: EditorState) -> EditorState:
    """The same file opened anew."""
    again = state_of(OpenedFiles(state.sources, state.edited.file, state.edited.path))
    assert again.tracks == [0, 1, 3]
    return again


def test_one_play_moves_them_all_and_the_second_picture_has_them(chained):
    state = chained
    state.toggle_play(1)  # of a thing that follows: the scene's
    assert [sweep.playing for sweep in state.sweeps] == [True, False, False, False]
    state.advance(2.0)
    assert 0 < xs(state)[0] == xs(state)[1] == xs(state)[2] and xs(state)[3] == 0
    state.toggle_play(0)
    assert not state.playing
    state.split.on, state.split.name, state.split.x = True, "background", 1.0
    right = state.split.right(state.scene, state.chain)
    assert [obj.x for obj in right.objects] == [1.0, 1.0, 1.0, 0.0]
    state.toggle_play()
    assert [sweep.playing for sweep in state.sweeps] == [True, False, False, True]
