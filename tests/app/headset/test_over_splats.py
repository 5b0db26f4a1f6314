"""What is over the splats: gloves, controllers while their buttons are named, and for good."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.app.headset.over.over_splats import OverSplats
from shapeshift.app.headset.panel_picture import PANEL
from shapeshift.app.headset.worn_settings import Wearing
from shapeshift.vr.controller_cards import FADES_S, SHOWN_S
from shapeshift.vr.drawn import Drawn
from shapeshift.vr.frame import LOST, SIDES
from shapeshift.vr.glove import CUFF, LIT
from shapeshift.vr.panel import Carried
from shapeshift.vr.touching import Touched
from tests.support.vr.vr_hands import a_frame, hand_at
from tests.support.vr.vr_panel import a_state

INDEX = dict.fromkeys(SIDES, "/interaction_profiles/valve/index_controller")
SESSION = SimpleNamespace(profiles=INDEX, pace=SimpleNamespace(dropped=0))
NO_GLASS = SimpleNamespace(hold=lambda frame, *_: frame.hands, added=lambda over, _: over)
LEFT, RIGHT = hand_at((-0.2, 1.2, -0.4)), hand_at((0.2, 1.2, -0.4))
GLOVE_PARTS = 4 * (1 + 3) + 2 + 2  # palm and fingers, thumb, cuff


def over_of(state, worn_s: float, left=LEFT, right=RIGHT, **wearing) -> Drawn:
    panel = SimpleNamespace(texture=None, version=0)
    over = OverSplats(Wearing(**wearing), panel, NO_GLASS)
    return over.of(a_frame(left, right), state, Carried(PANEL), SESSION, worn_s)


def gloves(over: Drawn) -> int:
    """How many of the hands are gloves: their cuffs are two."""
    return sum(part.color == CUFF for part in over.hands) / 2


def test_for_ten_seconds_hands_are_controllers_with_names_then_gloves():
    state = a_state()
    first = over_of(state, 0.0)
    assert gloves(first) == 0 and len(first.hands) > 20
    assert len(first.cards) == 6 + 5, "the left hand's palm, too"
    assert {card.opacity for card in first.cards} == {1.0}
    last = over_of(state, SHOWN_S - FADES_S / 2)
    assert gloves(last) == 0 and [c.opacity for c in last.cards] == [pytest.approx(0.5)] * 11
    later = over_of(state, SHOWN_S)
    assert (gloves(later), len(later.hands), later.cards) == (2, 2 * GLOVE_PARTS, ())
    assert len(first.lines) == len(later.lines) + 10, "a line from each name but the palm's"
    quiet = over_of(state, 0.0, hints=False)
    assert gloves(quiet) == 2 and quiet.cards == ()


def test_who_wants_controllers_keeps_them_and_bare_hands_stay_hands():
    state = a_state()
    state.worn.choose(hand_model="controllers")
    for hints in (True, False):
        later = over_of(state, 60.0, hints=hints)
        assert gloves(later) == 0 and later.cards == ()
    assert gloves(over_of(state, 60.0, left=LOST)) == 0
    bare = replace(LEFT, joints=np.full((26, 4), 0.01))
    first = over_of(state, 0.0, left=bare)
    assert any(card.lines[0].startswith("Pinch") for card in first.cards)
    assert gloves(over_of(state, 60.0, left=bare, right=LOST)) == 0.5, "one piece at a bare wrist"


def test_a_controller_whose_hand_holds_something_has_a_lit_band():
    state = a_state()
    state.worn.choose(hand_model="controllers")
    assert not any(np.allclose(part.color, LIT) for part in over_of(state, 60.0).hands)
    state.user.touched = Touched(held={"left": "leg", "right": None})
    assert sum(np.allclose(part.color, LIT) for part in over_of(state, 60.0).hands) == 1
