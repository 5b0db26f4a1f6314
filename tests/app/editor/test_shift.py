"""Shifts from any stop to any other: the keys of the viewer, and who has the last word."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state import arrange
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import Pace, StopBlend
from shapeshift.scene.control import SHIFT_S, Shift
from tests.support.models import make_random_model

STOPS = (Stop("RGB", 0.0), Stop("Thermal", 0.5, "thermal", "ironbow"), Stop("Opened", 1.0))


@pytest.fixture
def state() -> EditorState:
    """A package of three stops, opened alone."""
    model = replace(make_random_model(20, k=2), stops=STOPS)
    found = OpenedFiles((Source(Path("/data/a.shift"), model),))
    made = EditorState(lambda path: None)
    scene, edited = opened_scene(found)
    made.open_sources(found.sources, scene, None, edited)
    return made


def shown(state: EditorState) -> np.ndarray:
    obj = state.scene.objects[0]
    return obj.model.blend.weights(obj.x)


def test_key_3_from_rgb_goes_to_opened_directly(state):
    arrange.all_go_to_stop(state, 2)
    assert state.playing and shown(state).tolist() == [1, 0, 0]
    rows, places = [], []
    for _ in range(12):
        state.advance(SHIFT_S / 10)
        rows.append(shown(state))
        places.append(state.scene.objects[0].slider_x)
    assert not any(row[1] for row in rows), "no heat on the way"
    assert (np.diff([row[2] for row in rows]) >= 0).all() and rows[4][2] == pytest.approx(0.5)
    assert (np.diff(places) >= 0).all() and places[4] == pytest.approx(0.5)
    assert state.scene.objects[0].x == 1.0 and not state.playing


def test_it_is_of_time_and_not_of_frames(state):
    arrange.all_go_to_stop(state, 2)
    state.advance(0.3)
    at_once = shown(state)
    arrange.all_go_to_stop(state, 0)
    state.finish_shifts()
    arrange.all_go_to_stop(state, 2)
    for _ in range(30):
        state.advance(0.01)
    np.testing.assert_allclose(shown(state), at_once, atol=1e-9)


def test_another_key_on_the_way_goes_on_from_there(state):
    arrange.all_go_to_stop(state, 2)
    state.advance(SHIFT_S / 2)
    arrange.all_go_to_stop(state, 1)
    state.advance(SHIFT_S / 2)
    np.testing.assert_allclose(shown(state), [0.25, 0.5, 0.25], atol=1e-9)
    state.advance(SHIFT_S)
    assert state.scene.objects[0].x == 0.5


def test_a_hand_on_the_slider_has_the_last_word(state):
    arrange.all_go_to_stop(state, 2)
    state.advance(SHIFT_S / 2)
    arrange.steer(state, 0, 0.3)
    state.advance(SHIFT_S)
    assert state.scene.objects[0].x == 0.3 and not state.playing


def test_play_goes_on_from_a_blend_to_the_next_stop(state):
    arrange.all_go_to_stop(state, 2)
    state.advance(SHIFT_S / 2)
    state.toggle_play()
    for _ in range(200):
        state.advance(0.05)
        assert 0 <= state.scene.objects[0].slider_x <= 1
    assert state.sweeps[0].playing


def test_a_key_for_where_it_is_or_a_stop_that_is_not_there_does_nothing(state):
    for number in (0, 3, 8):
        arrange.all_go_to_stop(state, number)
        assert not state.playing and state.scene.objects[0].x == 0.0


def test_other_objects_end_a_shift_at_its_end(state):
    arrange.all_go_to_stop(state, 2)
    state.advance(SHIFT_S / 2)
    file = state.edited.file
    arrange.edit(state, replace(file, floor_y=0.5), "floor")
    assert state.scene.objects[0].x == 1.0 and not state.shifts


def test_a_shift_is_eased_and_at_the_pace_of_its_pair():
    blend = StopBlend(STOPS, (Pace("RGB", "Opened", (0, 0.9, 1)),))
    shift = Shift(0.0, 1.0, blend)
    assert shift.control == 0.0
    shift.seconds = SHIFT_S / 2
    np.testing.assert_allclose(blend.weights(shift.control), [0.1, 0, 0.9], atol=1e-12)
    shift.seconds = 9.0
    assert shift.control == 1.0 and shift.over
