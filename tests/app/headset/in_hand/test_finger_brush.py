"""Paint with the finger: what lies about its tip, without gaps, into the desktop's own regions."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.editor.state.arrange import undo
from shapeshift.app.headset.in_hand.finger_brush import FIRST_M, LEAST_M, MOST_M, PRESSED
from shapeshift.app.headset.panel_picture import PANEL
from shapeshift.scene.pick import anchor_places
from shapeshift.scene.selectors.selector import Painted
from shapeshift.vr.frame import LOST
from shapeshift.vr.glove import fingertip
from shapeshift.vr.panel import Carried, Pointing
from shapeshift.vr.play_space import PlaySpace
from tests.support.vr.vr_hands import hand_at, moved
from tests.support.vr.vr_panel import a_state, an_editor, item
from tests.support.vr.vr_tools import ROOM, Hands

TRUE = PlaySpace()


def painter(room: PlaySpace = ROOM) -> Hands:
    hands = Hands(a_state(an_editor(item("lamp"), item("hidden", visible=False))), room)
    hands.tools.brush.on = True
    hands.act()
    return hands


def anchors(hands: Hands, index: int = 0) -> np.ndarray:
    """(A, 3) metres of the world."""
    obj = hands.editor.scene.objects[index]
    matrix = obj.world_from_object.matrix()
    return anchor_places(obj.model) @ matrix[:3, :3].T + matrix[:3, 3]


def tip_at(hands: Hands, world, **state) -> None:
    """The right hand's fingertip is at a place (3,) of the world."""
    matrix = hands.room.world_from_play.matrix()
    place = matrix[:3, :3].T @ (np.asarray(world) - matrix[:3, 3]) / hands.room.scale
    hand = hand_at((0.0, 1.0, -0.5), (0.0, 1.0, -1.5))
    hand = moved(hand, place - fingertip("right", hand))
    hands.act(right=replace(hand, **state))


@pytest.mark.parametrize("room", [TRUE, ROOM], ids=["true size", "half as large, turned"])
def test_the_ball_about_the_tip_is_painted_and_nothing_else(room):
    hands = painter(room)
    places = anchors(hands)
    reach = FIRST_M * room.scale
    hands.tools.brush.radius_m = 10 * FIRST_M
    middle = places[7]
    tip_at(hands, middle, trigger=PRESSED)
    assert not hands.editor.regions.items, "a trigger that is not pulled far enough"
    tip_at(hands, middle, trigger=1.0)
    (region,) = hands.editor.regions.items
    wanted = np.linalg.norm(places - middle, axis=1) <= 10 * reach
    assert region.kind == "painted" and 0 < wanted.sum() < len(places)
    np.testing.assert_array_equal(region.painted, wanted)
    (selector,) = hands.editor.regions.selectors(0, None)
    assert isinstance(selector, Painted) and selector.x == region.x != 0.0, "seen at once"


def test_a_quick_stroke_has_no_gaps_and_is_one_step_to_take_back():
    hands = painter(TRUE)
    places = anchors(hands)
    start, end = places.min(axis=0), places.max(axis=0)
    along = end - start
    share = np.clip((places - start) @ along / (along @ along), 0, 1)
    away = np.linalg.norm(places - start - share[:, None] * along, axis=1)
    hands.tools.brush.radius_m = radius = float(np.sort(away)[8]) * 1.04
    tip_at(hands, start, trigger=1.0)
    tip_at(hands, end, trigger=1.0)  # in one frame
    painted = hands.editor.regions.current.painted
    # Balls half a radius apart hold all within radius * sqrt(1 - 1/16) of the line.
    assert painted[away <= 0.968 * radius].all() and not painted[away > radius].any()
    assert painted.sum() >= 9
    tip_at(hands, end, trigger=0.0)
    other = places[np.argmax(away)]
    tip_at(hands, other)
    tip_at(hands, other, trigger=1.0)
    assert hands.editor.regions.current.painted.sum() > painted.sum()
    tip_at(hands, other)
    assert undo(hands.editor) == "paint painted 1"
    np.testing.assert_array_equal(hands.editor.regions.current.painted, painted)
    assert undo(hands.editor) == "paint painted 1" and not hands.editor.regions.items


def test_it_erases_as_the_panel_says_or_while_a_button_is_held():
    hands = painter(TRUE)
    middle = anchors(hands)[3]
    tip_at(hands, middle, trigger=1.0, secondary=True)
    assert not hands.editor.regions.items, "nothing is there to be erased"
    for how in ({"secondary": True}, {}):
        tip_at(hands, middle)
        tip_at(hands, middle, trigger=1.0)
        assert hands.editor.regions.current.painted[3]
        tip_at(hands, middle)
        hands.tools.brush.erases = not how
        tip_at(hands, middle, trigger=1.0, **how)
        assert not hands.editor.regions.current.painted.any()
        hands.tools.brush.erases = False


def test_the_stick_makes_it_larger_and_is_not_the_worlds_then():
    hands = painter()
    brush = hands.tools.brush
    middle = anchors(hands)[0]
    tip_at(hands, middle, stick=(0.1, 1.0))
    assert FIRST_M < brush.radius_m < 1.1 * FIRST_M
    for _ in range(400):
        tip_at(hands, middle, stick=(0.0, 1.0))
    assert brush.radius_m == MOST_M
    for _ in range(400):
        tip_at(hands, middle, stick=(0.0, -1.0))
    assert brush.radius_m == LEAST_M
    tip_at(hands, middle)
    left = hands.act(right=replace(hands.hands["right"], stick=(0.9, 0.3)))
    assert left.hands["right"].stick == (0.9, 0.3) and brush.radius_m == LEAST_M, "one turns"
    left = hands.act(right=replace(hands.hands["right"], stick=(0.0, 0.5), trigger=1.0))
    assert left.hands["right"].stick == (0.0, 0.0) and left.hands["right"].trigger == 0.0


def test_over_the_panel_away_or_lost_it_paints_nothing_and_what_is_hidden_is_not_painted():
    hands = painter(TRUE)
    hidden = anchors(hands, 1)
    tip_at(hands, hidden[0], trigger=1.0)
    assert all(region.index == 0 for region in hands.editor.regions.items)
    hands.editor.regions.clear()
    tip_at(hands, anchors(hands)[0])
    over = replace(Carried(PANEL), open=True, pointing=Pointing(at=(10.0, 10.0)))
    pulled = replace(hands.hands["right"], trigger=1.0)
    left = hands.act(over, right=pulled)
    assert left.hands["right"].trigger == 1.0 and not hands.editor.regions.items
    hands.act(right=LOST)
    assert hands.tools.brush.tip is None
    hands.tools.brush.on = False
    left = hands.act(right=pulled)
    assert left.hands["right"].trigger == 1.0 and not hands.editor.regions.items


def test_a_pinch_paints_at_the_end_of_the_index_finger_and_takes_nothing():
    hands = painter(TRUE)
    middle = anchors(hands)[5]
    joints = np.zeros((26, 4))
    joints[:, 3] = 0.008
    joints[9, :3], joints[10, :3] = middle - (0.028, 0, 0), middle - (0.008, 0, 0)
    bare = replace(hand_at(middle), joints=joints, trigger=1.0, squeeze=1.0)
    left = hands.act(right=bare).hands["right"]
    assert hands.editor.regions.current.painted[5]
    assert (left.trigger, left.squeeze) == (0.0, 0.0)


def test_one_tool_has_the_trigger():
    """What is taken last puts the others away."""
    hands = painter()
    tools = hands.tools
    tools.inspecting.on = True
    hands.act()
    assert (tools.brush.on, tools.inspecting.on) == (False, True)
    tools.brush.on = True
    hands.act()
    assert (tools.brush.on, tools.inspecting.on) == (True, False)
    tools.parts.toggle()
    hands.act()
    assert tools.parts.on and not tools.brush.on
    tools.brush.on = True
    hands.act()
    assert tools.brush.on and not tools.parts.on
    tools.brush.on = False
    hands.act()
    assert tools.row()["has"] == ""
