"""What the panel tells of a world, and what is said over frames that are late: no drawing."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.editor.state.track import shown_stop, shown_words
from shapeshift.app.headset.over.over_splats import (
    BEGINS_S,
    BELOW,
    QUIET_S,
    SHOWN_S,
    Late,
    late_card,
)
from shapeshift.app.headset.sections.room_section import SIZES, next_scale, size_text
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.document.edits import hide
from shapeshift.scene.document.scene_file import named_stops
from shapeshift.scene.world.reactions import State
from tests.support.vr.vr_hands import HEAD
from tests.support.vr.vr_panel import HEAT, a_state, an_editor, item, some_things

STOPS = (Stop("normal", 0.0), Stop("ice", 0.25), Stop("fire", 0.5), Stop("charcoal", 1.0))


def names(editor, indices) -> list[str]:
    return [editor.scene.objects[index].name for index in indices]


def test_sliders_are_of_what_is_seen_and_goes_somewhere():
    editor = some_things()
    assert names(editor, editor.movable) == ["lamp", "leg", "gone"]
    assert names(editor, editor.sliders) == ["lamp"], "one at a time"
    assert [stop.name for stop in editor.stops(1)] == ["layer 0", "layer 1", "layer 2"]
    assert [(stop.name, stop.x, stop.palette) for stop in editor.stops(2)] == [
        ("cold", 0.0, ""), ("warm", 0.25, ""), ("half", 0.5, ""), ("heat", 1.0, "ironbow")
    ]  # fmt: skip


def test_a_hidden_object_is_not_the_first_whose_slider_is_shown():
    editor = an_editor(item("gone", visible=False), item("lamp"))
    assert names(editor, editor.sliders) == ["lamp"]
    alone = an_editor(item("gone", visible=False), item("hidden", visible=False))
    assert names(alone, alone.sliders) == ["gone"]


def test_a_ring_ends_where_it_begins():
    states = (State("normal", 0.0), State("fire", 0.5))
    obj = some_things().world.objects["leg"]
    ring = replace(obj, item=item("leg", states=states, ring=True))
    assert [(stop.name, stop.x) for stop in named_stops(ring.item, ring.drawn.model)] == [
        ("normal", 0.0), ("fire", 0.5), ("normal", 1.0)
    ]  # fmt: skip


def test_the_editor_works_on_the_world_that_the_hands_are_in():
    """A slider moves it, what moves there is seen, an edit is heard of and makes no other world."""
    editor = some_things()
    world = editor.world
    editor.set_x(editor.movable[1], 0.7)
    assert world.objects["leg"].reaction_state.x == 0.7
    world.control("lamp", 0.3)
    world.advance(0.05)
    editor.follow_world()
    assert editor.scene.objects[1].x == 0.3
    editor.edited.history = editor.edited.history.record(
        hide(editor.edited.file, "leg", True), "hide"
    )
    editor.bodies.follow(editor.edited)
    assert editor.world is world and not world.objects["leg"].drawn.visible
    assert world.objects["leg"].reaction_state.x == 0.7, "what was not edited goes on as it was"


def test_a_palette_is_another_look_of_what_the_headset_draws():
    state = a_state(an_editor(item("leg"), leg=HEAT))
    state.editor.choose_palette("viridis")
    state.world.control("leg", 0.6)
    state.touch.advance(0.05)
    (obj,) = state.editor.scene.objects
    assert obj.x == 0.6 and obj.model.stops[2].palette == "viridis"


@pytest.mark.parametrize(
    ("scale", "larger", "want"),
    [
        (1.0, True, 1 / 1.5),
        (1.0, False, 1 / 0.75),
        (1 / 0.6, True, 1 / 0.75),
        (1 / 20, True, 1 / 20),
        (100.0, False, 100.0),
        (1e4, False, 1e4),
    ],
)
def test_size_goes_in_steps(scale, larger, want):
    assert next_scale(scale, larger) == pytest.approx(want)


def test_larger_and_smaller_come_back():
    scale = 1.0
    for larger in (True,) * 4 + (False,) * 4:
        scale = next_scale(scale, larger)
    assert scale == pytest.approx(1.0) and sorted(SIZES) == list(SIZES)


def test_sizes_are_told_in_percent():
    assert [size_text(s) for s in (1.0, 2.0, 100.0, 0.05)] == ["100 %", "50 %", "1 %", "2000 %"]


@pytest.mark.parametrize(
    ("x", "want"),
    [
        (0.0, "normal"), (0.25, "ice"), (0.2505, "ice"), (0.35, "ice to fire, 40 %"),
        (0.252, "ice to fire, 1 %"), (0.99, "fire to charcoal, 98 %"), (1.0, "charcoal"),
    ],
)  # fmt: skip
def test_it_says_which_stop_is_shown(x, want):
    assert shown_stop(STOPS, x) == want


def test_beyond_the_last_stop_and_without_any():
    assert shown_stop(STOPS[:3], 0.9) == "fire  x 0.90"
    assert shown_stop((), 0.9) == "x 0.90"


def test_a_blend_is_named_by_its_stops_wherever_its_knob_stands():
    half = StopWeights(((STOPS[0].name, 0.4), (STOPS[-1].name, 0.6)))
    for x in (STOPS[1].x, 0.6):
        assert shown_words(STOPS, half, x) == f"{STOPS[0].name} to {STOPS[-1].name}, 60 %"
    alone = StopWeights(((STOPS[1].name, 1.0),))
    assert shown_words(STOPS, alone, STOPS[1].x) == STOPS[1].name
    assert shown_words(STOPS, STOPS[1].x, STOPS[1].x) == STOPS[1].name


def test_late_frames_are_told_for_a_moment_and_not_again_at_once():
    late = Late()
    assert not any(late.watch(0.1 * i, 100 * i) for i in range(50)), "all begins slowly"
    rows = ((5.0, 0), (5.5, 1), (6.0, 7), (6.5, 7), (9.9, 7), (10.1, 7), (11.0, 20), (35.0, 20))
    said = [late.watch(second, dropped) for second, dropped in rows]
    assert said == [False, False, True, True, True, False, False, False]
    assert (BEGINS_S, SHOWN_S) == (5.0, 4.0)
    assert not late.watch(6.0 + QUIET_S, 40) and late.watch(6.1 + QUIET_S, 60)


@pytest.mark.parametrize(
    ("quality", "line"),
    [("auto", "Frames are late"), ("best", "Frames are late: try Auto")],
)
def test_the_word_on_late_frames_is_below_what_one_looks_at(quality, line):
    card = late_card(HEAD, quality)
    assert card.lines == (line,)
    np.testing.assert_allclose(card.play_from_card.position, HEAD.position + BELOW)
    ahead = -card.play_from_card.matrix()[:3, 2]
    assert ahead @ BELOW / np.linalg.norm(BELOW) > 0.999, "it faces the head"
