"""Controllers as they are drawn: every button that is named is there, shows that it is pressed, and
its name's line ends on it.
"""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.controller_cards import AWAY_M, HOW_FAR, KEY, controller, hint_rows, labelled
from shapeshift.vr.frame import LOST, SIDES, Hand
from shapeshift.vr.glove import LIT
from shapeshift.vr.locomotion import RULES, Rules
from shapeshift.vr.openxr.hands import PROFILES
from tests.support.vr.vr_hands import HEAD, hand_at

GRIP = (0.1, 1.3, -0.4)
LEVEL = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
DOWN = {
    "trigger": {"trigger": 1.0}, "squeeze": {"squeeze": 1.0}, "stick": {"stick": (1.0, 0.0)},
    "primary": {"primary": True}, "secondary": {"secondary": True}, "menu": {"menu": True},
}  # fmt: skip


def lit(held) -> int:
    """How many pieces shine as what is pressed."""
    return sum(np.allclose(part.color[:3], LIT) for part in held.parts)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("profile", PROFILES)
def test_each_button_that_a_hint_names_is_there_and_lights_up(profile, side):
    rest = hand_at(GRIP)
    held = controller(side, rest, profile)
    assert lit(held) == 0
    for rules in (RULES, Rules(walks=side, one_hand=side)):
        named = set(hint_rows(profile, side, rules, "left")) - {"palm"}
        assert named <= set(held.buttons), profile
    for button in hint_rows(profile, side, RULES, "left"):
        if button == "palm":
            continue
        pressed = controller(side, replace(rest, **DOWN[button]), profile)
        assert lit(pressed) > 0, f"{profile} {button}"
    half = controller(side, replace(rest, trigger=0.5, squeeze=0.5), profile)
    between = [p.color for p in half.parts if KEY[0] < p.color[0] < LIT[0]]
    assert between or "simple" in profile or "vive" in profile


def test_what_is_pressed_is_what_the_hand_says():
    assert set(HOW_FAR) == set(DOWN)
    for name, how_far in HOW_FAR.items():
        assert how_far(Hand()) == 0 and how_far(replace(Hand(), **DOWN[name])) == 1
    assert HOW_FAR["stick"](Hand(stick_click=True)) == 1
    half = controller("right", replace(hand_at(GRIP), trigger=0.5), "oculus/touch_controller")
    whole = controller("right", replace(hand_at(GRIP), trigger=9.0), "oculus/touch_controller")
    rest = controller("right", hand_at(GRIP), "oculus/touch_controller")
    ways = [np.linalg.norm(c.buttons["trigger"] - rest.buttons["trigger"]) for c in (half, whole)]
    assert ways[1] == pytest.approx(2 * ways[0]) and 0.005 < ways[1] < 0.01


@pytest.mark.parametrize("profile", PROFILES)
def test_the_left_one_is_the_right_one_in_a_mirror(profile):
    """But for a B that is the menu in the left hand: it covers the one below it."""
    hand = Hand(True, LEVEL)
    left, right = (controller(side, hand, profile) for side in SIDES)
    for name, place in right.buttons.items():
        np.testing.assert_allclose(left.buttons[name], place * (-1, 1, 1), atol=1e-12)
    for ours, theirs in zip(left.parts, right.parts, strict=False):
        np.testing.assert_allclose(ours.a, theirs.a * (-1, 1, 1), atol=1e-12)
    for part in (*left.parts, *right.parts):
        assert np.isfinite([*part.a, *part.b]).all() and min(part.radii) > 0.001
        assert max(np.linalg.norm(part.a), np.linalg.norm(part.b)) < 0.17, "within a hand's reach"


def test_a_stick_leans_where_it_is_pushed_in_the_room():
    """Right is right in both hands, though one is the other's mirror image."""
    for side in SIDES:
        rest, right = (
            controller(side, Hand(True, LEVEL, stick=stick), "").buttons["stick"]
            for stick in ((0.0, 0.0), (1.0, 0.0))
        )
        np.testing.assert_allclose(right - rest, (0.007, 0, 0), atol=1e-9)


def test_it_goes_with_the_hand_and_there_is_none_without_a_controller():
    moved = controller("right", hand_at(np.add(GRIP, (1, 2, 3))), "")
    for a, b in zip(controller("right", hand_at(GRIP), "").parts, moved.parts, strict=True):
        np.testing.assert_allclose(b.a - a.a, (1, 2, 3), atol=1e-12)
    assert controller("left", LOST, "") is None
    assert controller("left", replace(hand_at(GRIP), joints=np.zeros((26, 4))), "") is None
    one, other = (
        controller("right", hand_at(GRIP), p) for p in ("x/unknown", "oculus/touch_controller")
    )
    assert set(one.buttons) == set(other.buttons)
    holding = controller("right", hand_at(GRIP), "", holds=True)
    assert lit(holding) == 1


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("profile", PROFILES)
def test_each_name_has_a_line_from_its_card_to_its_button(profile, side):
    hand = hand_at(np.multiply(GRIP, (1 if side == "right" else -1, 1, 1)))
    held = controller(side, hand, profile)
    rows = hint_rows(profile, side, RULES, side)
    cards, lines = labelled(side, held, rows, hand.grip.position, HEAD, 0.5)
    assert sorted(card.lines[0] for card in cards) == sorted(rows.values())
    assert len(lines) == len(rows) - 1, "the palm is no button"
    assert cards[-1].lines == ("Palm up: panel",)
    axes = cards[0].play_from_card.matrix()[:3, :3]
    outwards = axes[:, 0] * (1 if side == "right" else -1)
    ends = {tuple(np.round(line.a, 9)) for line in lines}
    assert ends == {tuple(np.round(held.buttons[name], 9)) for name in rows if name != "palm"}
    for card, line in zip(cards, lines, strict=False):
        near = card.play_from_card.position - outwards * card.size_m[0] / 2
        np.testing.assert_allclose(line.b, near, atol=1e-9)
        assert (near - hand.grip.position) @ outwards == pytest.approx(AWAY_M)
        assert line.color[3] == pytest.approx(0.45) and card.opacity == 0.5
    # From top to bottom as their buttons are: no two lines cross; and no card lies on another.
    heights = [line.a @ axes[:, 1] for line in lines]
    assert heights == sorted(heights, reverse=True)
    tops = [c.play_from_card.position @ axes[:, 1] + c.size_m[1] / 2 for c in cards]
    feet = [c.play_from_card.position @ axes[:, 1] - c.size_m[1] / 2 for c in cards]
    assert all(foot > top for foot, top in zip(feet, tops[1:], strict=False))
