"""What touching does where there is nothing to touch, or not yet."""

import pytest

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.touch_state import (
    FLASH_S,
    KEPT,
    LABEL_S,
    NO_BODIES,
    Flash,
    Label,
    TouchState,
)


@pytest.fixture
def state() -> EditorState:
    return EditorState(lambda path: pytest.fail("nothing is read"))


@pytest.mark.parametrize("deed", ["step", "reset_objects", "release"])
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


class StandIn:
    """A world that can be paused and goes nowhere."""

    paused = True

    def held(self, hand: str) -> None:
        return None


def test_t_before_there_are_bodies_is_kept_said_and_carried_out(state, monkeypatch):
    touch, bodies = TouchState(state, play=False), state.bodies
    monkeypatch.setattr(touch, "begin", lambda world: True)  # nothing stands in anything
    touch.toggle()
    assert "They move then" in state.messages.note and touch.status() == KEPT
    touch.toggle()  # taken back
    assert touch.status() == "" and not touch.wanted
    touch.toggle()
    assert not touch.meet_world() and touch.wanted
    bodies.world = StandIn()
    assert touch.meet_world() and not bodies.world.paused and not touch.wanted


def test_t_where_there_never_will_be_bodies_says_why(state):
    touch, bodies = TouchState(state, play=False), state.bodies
    touch.toggle()
    bodies.stale = False  # all is up to date, and there is none
    assert not touch.meet_world() and not touch.wanted
    assert state.messages.note == NO_BODIES
    bodies.why_none = "'mug': there is nothing to touch."
    touch.toggle()
    assert state.messages.note == bodies.why_none and not touch.wanted
