"""What touching does where there is nothing to touch: nothing."""

import pytest

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.touch_state import FLASH_S, LABEL_S, Flash, Label, TouchState


@pytest.fixture
def state() -> EditorState:
    return EditorState(lambda path: pytest.fail("nothing is read"))


@pytest.mark.parametrize("deed", ["toggle", "step", "reset_objects", "release"])
def test_without_a_world_nothing_moves_and_nothing_is_said(state, deed):
    touch, before = TouchState(state, play=False), state.scene
    getattr(touch, deed)()
    assert touch.world is None and touch.status() == "" and not touch.reactions
    assert state.scene is before


def test_marks_fade_also_where_the_world_is_gone(state):
    touch = TouchState(state, play=False)
    touch.labels, touch.flashes = [Label("cube", "red")], [Flash(None)]
    touch.advance(FLASH_S)
    assert touch.fading and touch.labels[0].age_s == FLASH_S and not touch.flashes
    touch.advance(LABEL_S)
    assert not touch.fading
