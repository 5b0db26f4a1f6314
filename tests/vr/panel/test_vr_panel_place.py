"""Where the panel hangs, how rays and fingers reach it, and what it leaves of the hands."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import Stop
from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import LOST, Hand, Pulse
from shapeshift.vr.glove import fingertip, glove
from shapeshift.vr.panel.carried import Carried, carry, panel_row
from shapeshift.vr.panel.panel_layout import knob_place, lay_out
from shapeshift.vr.panel.panel_place import ABOVE_M, ASIDE, NEAR_M, RAY_M, hang, play_point
from shapeshift.vr.panel.panel_state import Facts, Recentre, SetX, Slider
from tests.support.vr.vr_hands import HEAD, OPEN, a_frame, hand_at, moved

STOPS = (Stop("normal", 0.0), Stop("ice", 0.25), Stop("fire", 1.0))
FACTS = Facts((Slider("cube", STOPS, 0.25),))
LEFT = hand_at((-0.15, 1.15, -0.45))
SIZE_M = (0.25, 0.2)


def settled(facts: Facts = FACTS, left: Hand = LEFT) -> Carried:
    carried = OPEN
    for _ in range(3):
        carried, _, _ = carry(carried, facts, a_frame(left), 1.0)
    return carried


def spot(carried: Carried, name: str) -> np.ndarray:
    """(3,) metres of the room: the middle of an item, or the knob."""
    row = panel_row(carried)
    return np.array(row["knob"] if name == "knob" else row["buttons"][name])


def reaching(carried: Carried, name: str, height: float, **state) -> Hand:
    """A right hand whose fingertip is `height` metres over an item."""
    normal = carried.play_from_panel.matrix()[:3, 2]
    tip = spot(carried, name) + normal * height
    rough = hand_at(tip, tip - normal, **state)
    return moved(rough, tip - fingertip("right", rough))


def ray_at(carried: Carried, name: str, **state) -> Hand:
    return hand_at((0.25, 1.1, -0.2), spot(carried, name), **state)


def step(carried: Carried, right: Hand, left: Hand = LEFT, facts: Facts = FACTS, **state):
    return carry(carried, facts, a_frame(left, right, **state), 1 / 72)


@pytest.mark.parametrize(("side", "outwards"), [("left", -1), ("right", 1)])
def test_it_hangs_outwards_of_the_hand_upright_and_faces_the_head(side, outwards):
    """Not over what one looks at between the hands."""
    hand = LEFT if side == "left" else moved(LEFT, (0.3, 0, 0))
    pose = hang(None, hand, HEAD, SIZE_M, 0.0, side)
    right, up, normal = pose.matrix()[:3, :3].T
    away = pose.position - hand.grip.position
    assert away[1] == pytest.approx(ABOVE_M + SIZE_M[1] / 2)
    assert np.hypot(away[0], away[2]) == pytest.approx(ASIDE * SIZE_M[0])
    assert away[0] * outwards > 0.06
    to_head = HEAD.position - pose.position
    np.testing.assert_allclose(normal, to_head / np.linalg.norm(to_head), atol=1e-12)
    assert right[1] == pytest.approx(0) and up[1] > 0.5


def test_it_follows_a_trembling_hand_calmly_and_a_jump_at_once():
    pose = hang(None, LEFT, HEAD, SIZE_M, 0.0)
    trembles = hang(pose, moved(LEFT, (0.002, 0, 0)), HEAD, SIZE_M, 1 / 90)
    assert 0.0001 < (trembles.position - pose.position)[0] < 0.0005
    jumped = moved(LEFT, (0.7, 0, 0))
    there = hang(None, jumped, HEAD, SIZE_M, 0.0)
    now = hang(pose, jumped, HEAD, SIZE_M, 1 / 90)
    np.testing.assert_array_equal(now.position, there.position)


def test_without_a_hand_it_stays_and_at_first_is_at_the_lower_edge():
    pose = hang(None, LOST, HEAD, SIZE_M, 0.0)
    np.testing.assert_allclose(pose.position, np.add(HEAD.position, (-0.24, -0.24, -0.5)))
    other = hang(None, LOST, HEAD, SIZE_M, 0.0, "right")
    np.testing.assert_allclose(other.position, np.add(HEAD.position, (0.24, -0.24, -0.5)))
    assert hang(pose, LOST, HEAD, SIZE_M, 1.0) is pose
    for wxyz in ((0.7071068, -0.7071068, 0, 0), (0.7071068, 0.7071068, 0, 0)):  # up, down
        head = Pose(HEAD.position, np.array(wxyz))
        assert np.isfinite(hang(None, LOST, head, SIZE_M, 0.0).matrix()).all()


def test_straight_below_the_head_it_still_has_a_pose():
    under = hand_at(HEAD.position - (0.0, 0.8, 0.0))
    matrix = hang(None, under, HEAD, SIZE_M, 0.0).matrix()
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-9)


def test_a_menu_button_of_either_hand_closes_and_opens_it():
    carried = settled()
    carried, _, _ = step(carried, LOST, replace(LEFT, menu=True))
    assert not carried.panel.open and carried.play_from_panel is None
    carried, _, _ = step(carried, LOST, replace(LEFT, menu=True))  # held: not again
    assert not carried.panel.open
    carried, _, _ = step(carried, LOST)
    carried, _, _ = step(carried, LOST, replace(LEFT, menu=True))
    assert carried.panel.side == "left"
    for _ in range(100):  # a second and more: the palm is not up, and it stays all the same
        carried, _, _ = step(carried, LOST)
    assert carried.panel.open
    carried, _, _ = step(carried, hand_at((0.2, 1.2, -0.4), menu=True))
    assert not carried.panel.open
    other = Carried(replace(carried.panel), home="right")
    other, _, _ = step(other, hand_at((0.2, 1.2, -0.4), menu=True))
    assert other.panel.side == "right"


def palm(up: float, side: str = "left", **state) -> Hand:
    """A hand whose palm's normal is turned up by radians from level."""
    sign = 1.0 if side == "left" else -1.0  # the grip's X comes out of the left palm alone
    half = sign * up / 2
    pose = Pose(LEFT.grip.position, np.array([np.cos(half), 0, 0, np.sin(half)]))
    return Hand(True, pose, pose, **state)


def turned(carried: Carried, hand: Hand, seconds: float) -> Carried:
    for _ in range(round(seconds * 90)):
        hands = (hand, LOST) if carried.home == "left" else (LOST, hand)
        carried, _, _ = carry(carried, FACTS, a_frame(*hands), 1 / 90)
    return carried


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_palm_that_is_turned_up_opens_it_for_as_long(side):
    carried = turned(Carried(home=side), palm(0.0, side), 1.0)
    assert not carried.panel.open, "closed at first: the scene is what one sees"
    level = turned(carried, palm(0.8, side), 1.0)  # sin 0.72: not yet
    assert not level.panel.open
    carried = turned(carried, palm(1.4, side), 0.15)
    assert not carried.panel.open, "a hand that passes by"
    carried = turned(carried, palm(1.4, side), 0.1)
    assert carried.panel.side == side and not carried.pinned
    carried = turned(carried, palm(0.8, side), 3.0)  # no trembling between yes and no
    assert carried.panel.open
    carried = turned(carried, palm(0.2, side), 0.3)
    assert carried.panel.open
    assert not turned(carried, palm(0.2, side), 0.2).panel.open
    assert not turned(turned(carried, palm(1.4, side), 1.0), LOST, 0.5).panel.open


def test_the_back_of_a_hand_and_a_hand_that_holds_something_open_nothing():
    for hand in (palm(-1.4), palm(1.4, squeeze=0.9), palm(1.4, "right")):
        assert not turned(Carried(), hand, 1.0).panel.open


def test_a_menu_button_puts_away_what_the_palm_opened_until_it_turns_again():
    carried = turned(Carried(), palm(1.4), 1.0)
    carried = turned(carried, palm(1.4, menu=True), 0.1)
    assert not carried.panel.open and not carried.pinned
    carried = turned(carried, palm(1.4), 2.0)
    assert not carried.panel.open
    carried = turned(turned(carried, palm(0.0), 1.0), palm(1.4), 0.5)
    assert carried.panel.open


def test_a_panel_in_use_does_not_close_under_the_hand():
    carried = turned(Carried(), palm(1.4), 1.0)
    carried, _, _ = step(carried, ray_at(carried, "knob"), palm(1.4))
    for _ in range(90):
        carried, _, _ = step(carried, ray_at(carried, "knob", trigger=1.0), palm(0.0))
    assert carried.panel.held == {"right": "track"}
    for _ in range(90):
        carried, _, _ = step(carried, LOST, palm(0.0))
    assert not carried.panel.open


def test_a_ray_drags_the_knob_and_the_world_gets_nothing_of_it():
    carried = settled()
    carried, wishes, hands = step(carried, ray_at(carried, "knob", trigger=0.3, squeeze=0.9))
    assert [type(wish) for wish in wishes] == [Pulse]  # a tick: it points at something
    assert hands["right"].trigger == 0 and hands["right"].squeeze == 0.9  # far: squeezes the world
    carried, wishes, _ = step(carried, ray_at(carried, "knob", trigger=1.0))
    assert carried.panel.held == {"right": "track"}
    ends = np.array(panel_row(carried)["slider"])
    there = ends[0] + 0.6 * (ends[1] - ends[0])
    carried, wishes, hands = step(carried, hand_at((0.25, 1.1, -0.2), there, trigger=0.5))
    assert SetX("cube", pytest.approx(0.6, abs=1e-3)) in wishes  # 0.5: pressed until 0.4
    assert hands["right"].trigger == 0
    carried, _, hands = step(carried, ray_at(carried, "knob", trigger=0.3))
    assert carried.panel.held == {} and hands["left"] == LEFT


def test_a_ray_from_behind_or_too_far_does_not_point():
    carried = settled()
    normal = carried.play_from_panel.matrix()[:3, 2]
    for away in (-0.5, RAY_M + 0.2):
        place = spot(carried, "knob") + normal * away
        carried, _, _ = step(carried, hand_at(place, spot(carried, "knob"), trigger=1.0))
        assert carried.panel.hovers == {} and carried.panel.held == {}


def test_a_finger_presses_by_touching_once():
    carried = settled()
    wishes = []
    for height in (0.05, 0.02, 0.001, -0.01, -0.02, -0.01, 0.01, 0.03):
        carried, more, _ = step(carried, reaching(carried, "recentre", height))
        wishes += [wish for wish in more if not isinstance(wish, Pulse)]
    assert wishes == [Recentre()] and carried.panel.held == {}


def test_a_near_squeeze_grabs_the_knob_and_is_not_the_worlds():
    carried = settled()
    carried, _, hands = step(carried, reaching(carried, "knob", 0.03))
    assert carried.pointing.near == {"right"}
    carried, _, hands = step(carried, reaching(carried, "knob", 0.03, squeeze=1.0))
    assert carried.panel.held == {"right": "track"} and hands["right"].squeeze == 0
    carried, _, _ = step(carried, LOST)
    assert carried.panel.held == {} and carried.pointing.down == frozenset()


def test_a_hand_that_comes_back_pulling_presses_nothing_until_it_opens():
    carried = settled()
    pulling, open_ = (ray_at(carried, "recentre", trigger=trigger) for trigger in (1.0, 0.0))
    for closes in (False, True):
        carried, _, _ = step(carried, open_)
        if closes:
            carried, _, _ = step(carried, pulling, replace(LEFT, menu=True))
            carried, _, _ = step(carried, pulling)
            carried, wishes, _ = step(carried, pulling, replace(LEFT, menu=True))
        else:
            carried, _, _ = step(carried, LOST)
            carried, wishes, _ = step(carried, pulling)
        assert Recentre() not in wishes and carried.panel.held == {}
        carried, wishes, _ = step(carried, pulling)
        assert Recentre() not in wishes
        carried, _, _ = step(carried, open_)
        carried, wishes, _ = step(carried, pulling)
        assert Recentre() in wishes


@pytest.mark.parametrize("seen", [True, False])
@pytest.mark.parametrize("trigger", [0.0, 1.0])
def test_a_hand_that_carries_something_over_the_panel_keeps_it(trigger, seen):
    carried = settled()
    aside = hand_at((0, 0, 0)).aim
    if seen:
        carried, _, _ = step(carried, replace(ray_at(carried, "knob"), aim=aside))
    far = replace(ray_at(carried, "knob", squeeze=1.0, trigger=trigger), aim=aside)
    carried, _, _ = step(carried, far)
    carried, wishes, hands = step(
        carried, reaching(carried, "knob", 0.03, squeeze=1.0, trigger=trigger)
    )
    assert carried.panel.held == {} and hands["right"].squeeze == 1.0
    assert not any(isinstance(wish, SetX) for wish in wishes)


def test_the_thumbstick_of_the_hand_that_carries_it_slides_and_does_not_walk():
    carried = settled()
    carried, wishes, hands = step(carried, LOST, replace(LEFT, stick=(0.9, 0.1)))
    assert SetX("cube", pytest.approx(0.25 + 0.525 / 72)) in wishes
    assert hands["left"].stick == (0.0, 0.0)
    carried, _, _ = step(carried, LOST)
    carried, wishes, hands = step(carried, LOST, replace(LEFT, stick=(0.1, 0.9)))
    assert wishes == [] and hands["left"].stick == (0.1, 0.9)


def test_a_room_with_a_new_origin_has_it_on_the_hand_at_once():
    carried = settled()
    shifted = moved(LEFT, (0.3, 0.0, 0.1))
    carried, _, _ = step(carried, LOST, shifted, recentred=True)
    there = hang(None, shifted, HEAD, lay_out(carried.panel).size_m, 0.0)
    np.testing.assert_array_equal(carried.play_from_panel.position, there.position)


def test_places_and_pixels_are_inverse():
    carried = settled()
    layout = lay_out(carried.panel)
    at = knob_place(carried.panel)
    carried, _, _ = step(carried, ray_at(carried, "knob"))
    np.testing.assert_allclose(carried.places["right"], at, atol=0.02)
    corner = (
        play_point(carried.play_from_panel, layout, (0.0, 0.0)) - carried.play_from_panel.position
    )
    assert np.linalg.norm(corner) == pytest.approx(np.hypot(*layout.size_m) / 2)


def test_a_closed_panel_leaves_the_hands_alone():
    carried = Carried()
    right = hand_at((0.2, 1.2, -0.3), trigger=1.0, squeeze=1.0)
    carried, wishes, hands = step(carried, right)
    assert wishes == [] and hands == {"left": LEFT, "right": right}
    assert panel_row(carried) == {"open": False, "hand": "", "shown": "ice"}


def test_the_left_glove_mirrors_the_right():
    right = hand_at((0.0, 0.0, 0.0), squeeze=0.4, trigger=0.7)
    ahead = replace(right, aim=None)
    for a, b in zip(glove("right", ahead), glove("left", ahead), strict=True):
        np.testing.assert_allclose(a.a * (-1, 1, 1), b.a, atol=1e-12)
        np.testing.assert_allclose(a.b * (-1, 1, 1), b.b, atol=1e-12)
    assert glove("left", LOST) == []


def test_fingers_shut_towards_the_palm():
    open_, shut = (hand_at((0, 0, 0), squeeze=s, trigger=s) for s in (0.0, 1.0))
    tips = [np.array([glove("right", h)[4 * i + 3].b for i in range(4)]) for h in (open_, shut)]
    spread = [np.linalg.norm(t, axis=1).mean() for t in tips]
    assert spread[1] < 0.65 * spread[0]
    palm = -open_.grip.matrix()[:3, 0]  # of a right hand
    assert ((tips[1] @ palm) > -0.02).all()


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_pointing_finger_follows_the_aim_and_pulling_the_trigger_does_not_move_its_tip(side):
    grip = hand_at((0.1, 1.2, -0.4)).grip
    aims = [Pose(grip.position, np.array([np.cos(a), np.sin(a), 0, 0])) for a in (0.0, 0.15)]
    tips = [fingertip(side, Hand(True, grip, aim)) for aim in aims]
    along = [-aim.matrix()[:3, 2] for aim in aims]
    assert (tips[1] - tips[0]) @ (along[1] - along[0]) > 0
    np.testing.assert_array_equal(tips[0], fingertip(side, Hand(True, grip, aims[0], trigger=1.0)))
    last = glove(side, Hand(True, grip, aims[0]))[3]
    assert np.linalg.norm(last.b - tips[0]) < 0.0081 < NEAR_M
