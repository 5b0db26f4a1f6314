"""What lights up: the outline of what a hand would take, what buttons do, cards."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.cards import HALF_CLEAR, card_picture
from shapeshift.vr.controller_cards import FADES_S, SHOWN_S, hint_lines, hints
from shapeshift.vr.frame import LOST, SIDES
from shapeshift.vr.locomotion import Rules
from shapeshift.vr.openxr.hands import PROFILES
from shapeshift.vr.outline import AWAY_M, BY_HAND, Outlines, hull_of, outline
from shapeshift.vr.play_space import PlaySpace
from tests.support.vr.vr_hands import HEAD, a_frame, hand_at

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * 0.05
THERE = Pose(np.array([0.3, 0.9, -0.6]), np.array([1.0, 0.0, 0.0, 0.0]))
EYE = HEAD.position
RULES = Rules()


def sphere(count: int = 400) -> np.ndarray:
    points = np.random.default_rng(3).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True) * 0.1


def loop_of(lines) -> int:
    """How many lines a closed loop has that they form; asserts that they form one alone."""
    ends = {}
    for line in lines:
        for a, b in ((line.a, line.b), (line.b, line.a)):
            ends.setdefault(tuple(np.round(a, 9)), []).append(tuple(np.round(b, 9)))
    assert all(len(others) == 2 for others in ends.values()), "every corner has two lines"
    start = before = next(iter(ends))
    now, steps = ends[start][0], 1
    while now != start:
        before, now = now, next(other for other in ends[now] if other != before)
        steps += 1
    assert steps == len(lines), "one loop"
    return steps


def test_the_outline_of_a_cube_is_its_silhouette():
    """Seen from a corner six of its edges, from straight before a face four."""
    hull = hull_of(CUBE)
    assert loop_of(outline(hull, THERE, PlaySpace(), EYE, BY_HAND)) == 6
    ahead = np.add(THERE.position, (0.0, 0.0, 1.0))
    assert loop_of(outline(hull, THERE, PlaySpace(), ahead, BY_HAND)) == 4
    for line in outline(hull, THERE, PlaySpace(), ahead, BY_HAND):
        local = np.abs(np.stack([line.a, line.b]) - THERE.position)
        np.testing.assert_allclose(local, 0.05 + AWAY_M / 3**0.5, atol=1e-9)


def test_the_outline_of_a_ball_is_a_circle_around_it():
    """Its lines are at the right angle to the line of sight, where a tangent meets the ball."""
    centre, eye = THERE.position, EYE
    lines = outline(hull_of(sphere()), THERE, PlaySpace(), eye, BY_HAND)
    assert loop_of(lines) > 20
    away = np.linalg.norm(eye - centre)
    along = (eye - centre) / away
    for line in lines:
        off = line.a - centre
        assert np.linalg.norm(off) == pytest.approx(0.1 + AWAY_M, abs=1e-3)
        assert off @ along == pytest.approx(0.1**2 / away, abs=0.03)  # facets are that coarse


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_it_is_in_the_room_at_any_size_of_the_world(scale):
    turn = Pose(np.array([4.0, -2.0, 7.0]), np.array([0.9238795325, 0, 0.3826834324, 0]))
    play_space = PlaySpace(turn, scale)
    at = play_space.pose(THERE)
    hull = hull_of(CUBE * scale)
    lines = outline(hull, at, play_space, EYE, BY_HAND)
    same = outline(hull_of(CUBE), THERE, PlaySpace(), EYE, BY_HAND)
    found = {tuple(np.round((a.a + a.b) / 2, 6)) for a in lines}
    assert found == {tuple(np.round((b.a + b.b) / 2, 6)) for b in same}
    assert lines[0].radii == same[0].radii


def test_from_inside_nothing_is_seen_of_it():
    assert outline(hull_of(CUBE), THERE, PlaySpace(), THERE.position, BY_HAND) == []


@pytest.mark.parametrize(
    "points", [np.zeros((0, 3)), np.zeros((5, 3)), CUBE[:3], CUBE * (1, 1, 0), CUBE * np.nan]
)
def test_what_has_no_volume_has_no_outline(points):
    assert hull_of(points) is None


def test_a_hull_is_made_once_a_collider():
    outlines, body = Outlines(), SimpleNamespace(parts=(CUBE, np.add(CUBE, (0.1, 0, 0))))
    first = outlines.hull(body)
    assert outlines.hull(body) is first and len(first.points) == 8
    assert (
        outlines.hull(None) is None and outlines.hull(SimpleNamespace(parts=(CUBE,))) is not first
    )


def test_every_controller_says_what_it_has_and_nothing_else():
    """The names of buttons follow the table of bindings."""
    for profile, bound in PROFILES.items():
        for side in SIDES:
            lines = hint_lines(profile, side, RULES, "left")
            told = {line.partition(": ")[2] for line in lines}
            has = {
                action for action, where in bound.items()
                if not isinstance(where, dict) or side in where
            }  # fmt: skip
            assert ("jump: point, let go" in told) == bool(has & {"primary", "pad_click"}), profile
            assert ("true size" in told) == ("secondary" in has), profile
            menus = [line for line in lines if line.endswith(": panel") and "Palm" not in line]
            assert bool(menus) == ("menu" in has), profile
            walks = {"stick", "pad"} & has
            assert (("walk" if side == "left" else "turn, fly") in told) == bool(walks), profile
            assert ("Palm up: panel" in lines) == (side == "left")
    assert hint_lines("", "left", RULES, "right")[0] == "Grip: take, or hold the world"
    touch = "/interaction_profiles/oculus/touch_controller"
    assert "X: jump: point, let go" in hint_lines(touch, "left", RULES, "left")
    assert "A: jump: point, let go" in hint_lines(touch, "right", RULES, "left")
    assert "Stick: walk" in hint_lines(touch, "right", Rules(walks="right"), "left")


def test_a_bare_hand_has_no_buttons_to_name():
    hand = replace(hand_at((0.2, 1.2, -0.4)), joints=np.zeros((26, 4)))
    profiles = dict.fromkeys(SIDES, "/interaction_profiles/valve/index_controller")
    left, right = (card.lines for card in hints(a_frame(hand, hand), 0, profiles, RULES, "left"))
    assert left == (*right, "Palm up: panel")
    assert [line.split(":")[0] for line in right] == ["Pinch", "Fist", "Thumb, middle"]


def test_hints_are_beside_the_hands_for_ten_seconds():
    left, right = hand_at((-0.2, 1.2, -0.4)), hand_at((0.2, 1.2, -0.4))
    cards = hints(a_frame(left, right), 0.0, {}, RULES, "left")
    assert [card.opacity for card in cards] == [1.0, 1.0]
    for card, hand, side in zip(cards, (left, right), (-1, 1), strict=True):
        away = card.play_from_card.position - hand.grip.position
        assert away[0] * side > 0.1 and abs(away[1]) < 0.05
        facing = card.play_from_card.matrix()[:3, 2]
        to_head = HEAD.position - card.play_from_card.position
        assert facing @ to_head / np.linalg.norm(to_head) > 0.999
    half = hints(a_frame(left), SHOWN_S - FADES_S / 2, {}, RULES, "left")
    assert [card.opacity for card in half] == [pytest.approx(0.5)]
    assert hints(a_frame(left, right), SHOWN_S, {}, RULES, "left") == ()
    assert hints(a_frame(LOST, LOST), 0.0, {}, RULES, "left") == ()


def test_a_card_has_its_words_on_a_dark_ground_with_round_corners():
    one, three = card_picture(("Menu: panel",)), card_picture(("Menu: panel", "A: jump", "Hello"))
    assert one.dtype == np.uint8 and three.shape[0] > 1.5 * one.shape[0]
    assert one[0, 0, 3] == 0 and one[one.shape[0] // 2, 4, 3] == round(255 * HALF_CLEAR)
    assert one[..., :3].max() > 200 and (one[..., :3] <= one[..., 3:]).all()  # premultiplied
    assert card_picture(("Menu: panel",)) is one, "kept"
