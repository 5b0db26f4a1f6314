"""Where the panel hangs, how rays and fingers reach it, and what it leaves of the hands."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import LOST, Hand
from shapeshift.vr.glove import fingertip, glove
from shapeshift.vr.panel import (
    ABOVE_M,
    ASIDE,
    MIDDLE,
    MOVES,
    NEAR_M,
    PRESS,
    RAY_M,
    RELEASE,
    RESTS,
    SCROLLS,
    SLIDES,
    Carried,
    PanelPlane,
    carry,
    hang,
    left_over,
    ray_place,
)
from tests.support.vr.vr_hands import HEAD, OPEN, PLANE, a_frame, hand_at, moved

LEFT = hand_at((-0.15, 1.15, -0.45))
SIZE_M = (0.25, 0.2)
MIDDLE_OF = (160.0, 200.0)  # a place on the panel
BESIDE = (-30.0, 200.0)  # and one on its plane


def settled(left: Hand = LEFT) -> Carried:
    carried = OPEN
    for _ in range(3):
        carried = carry(carried, a_frame(left), 1.0)
    return carried


def spot(carried: Carried, at=MIDDLE_OF) -> np.ndarray:
    """(3,) metres of the room of a place on the panel."""
    return PLANE.play_point(carried.play_from_panel, at)


def reaching(carried: Carried, height: float, at=MIDDLE_OF, **state) -> Hand:
    """A right hand whose fingertip is `height` metres over a place."""
    normal = carried.play_from_panel.matrix()[:3, 2]
    tip = spot(carried, at) + normal * height
    rough = hand_at(tip, tip - normal, **state)
    return moved(rough, tip - fingertip("right", rough))


def ray_at(carried: Carried, at=MIDDLE_OF, **state) -> Hand:
    return hand_at((0.25, 1.1, -0.2), spot(carried, at), **state)


def step(carried: Carried, right: Hand, left: Hand = LEFT, **state):
    """The panel after a frame, and the hands that it leaves."""
    frame = a_frame(left, right, **state)
    carried = carry(carried, frame, 1 / 72)
    return carried, left_over(carried, frame.hands)


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
    carried, _ = step(carried, LOST, replace(LEFT, menu=True))
    assert not carried.open and carried.play_from_panel is None
    carried, _ = step(carried, LOST, replace(LEFT, menu=True))  # held: not again
    assert not carried.open
    carried, _ = step(carried, LOST)
    carried, _ = step(carried, LOST, replace(LEFT, menu=True))
    assert carried.open
    for _ in range(100):  # a second and more: the palm is not up, and it stays all the same
        carried, _ = step(carried, LOST)
    assert carried.open
    carried, _ = step(carried, hand_at((0.2, 1.2, -0.4), menu=True))
    assert not carried.open
    other = Carried(PLANE, home="right")
    other, _ = step(other, hand_at((0.2, 1.2, -0.4), menu=True))
    assert other.open and (other.home, other.pointer) == ("right", "left")


def palm(up: float, side: str = "left", **state) -> Hand:
    """A hand whose palm's normal is turned up by radians from level."""
    sign = 1.0 if side == "left" else -1.0  # the grip's X comes out of the left palm alone
    half = sign * up / 2
    pose = Pose(LEFT.grip.position, np.array([np.cos(half), 0, 0, np.sin(half)]))
    return Hand(True, pose, pose, **state)


def turned(carried: Carried, hand: Hand, seconds: float) -> Carried:
    for _ in range(round(seconds * 90)):
        hands = (hand, LOST) if carried.home == "left" else (LOST, hand)
        carried = carry(carried, a_frame(*hands), 1 / 90)
    return carried


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_palm_that_is_turned_up_opens_it_for_as_long(side):
    carried = turned(Carried(PLANE, home=side), palm(0.0, side), 1.0)
    assert not carried.open, "closed at first: the scene is what one sees"
    level = turned(carried, palm(0.8, side), 1.0)  # sin 0.72: not yet
    assert not level.open
    carried = turned(carried, palm(1.4, side), 0.15)
    assert not carried.open, "a hand that passes by"
    carried = turned(carried, palm(1.4, side), 0.1)
    assert carried.open and not carried.pinned
    carried = turned(carried, palm(0.8, side), 3.0)  # no trembling between yes and no
    assert carried.open
    carried = turned(carried, palm(0.2, side), 0.3)
    assert carried.open
    assert not turned(carried, palm(0.2, side), 0.2).open
    assert not turned(turned(carried, palm(1.4, side), 1.0), LOST, 0.5).open


def test_the_back_of_a_hand_and_a_hand_that_holds_something_open_nothing():
    for hand in (palm(-1.4), palm(1.4, squeeze=0.9), palm(1.4, "right")):
        assert not turned(Carried(PLANE), hand, 1.0).open


def test_a_menu_button_puts_away_what_the_palm_opened_until_it_turns_again():
    carried = turned(Carried(PLANE), palm(1.4), 1.0)
    carried = turned(carried, palm(1.4, menu=True), 0.1)
    assert not carried.open and not carried.pinned
    carried = turned(carried, palm(1.4), 2.0)
    assert not carried.open
    carried = turned(turned(carried, palm(0.0), 1.0), palm(1.4), 0.5)
    assert carried.open


def test_a_panel_in_use_does_not_close_under_the_hand():
    carried = turned(Carried(PLANE), palm(1.4), 1.0)
    carried, _ = step(carried, ray_at(carried), palm(1.4))
    for _ in range(90):
        carried, _ = step(carried, ray_at(carried, trigger=1.0), palm(0.0))
    assert carried.pointing.pressing and carried.open
    for _ in range(90):
        carried, _ = step(carried, LOST, palm(0.0))
    assert not carried.open


def test_a_ray_presses_and_the_world_gets_nothing_of_it():
    carried = settled()
    carried, hands = step(carried, ray_at(carried, trigger=0.3, squeeze=0.9))
    assert carried.taken and not carried.pointing.pressing
    assert hands["right"].trigger == 0 and hands["right"].squeeze == 0.9  # far: squeezes the world
    carried, _ = step(carried, ray_at(carried, trigger=PRESS))
    assert carried.pointing.pressing
    carried, hands = step(carried, ray_at(carried, BESIDE, trigger=RELEASE))  # pressed until then
    assert carried.pointing.pressing and hands["right"].trigger == 0, "it drags on beside it"
    np.testing.assert_allclose(carried.pointing.at, BESIDE, atol=1e-6)
    carried, hands = step(carried, ray_at(carried, trigger=RELEASE - 0.01))
    assert not carried.pointing.pressing and hands["left"] == LEFT


def test_what_was_pressed_elsewhere_presses_nothing_here():
    """A hand that carries something over the panel, or fires while it sweeps across."""
    carried, _ = step(settled(), ray_at(settled(), BESIDE))
    carried, _ = step(carried, ray_at(carried, BESIDE, trigger=1.0))
    carried, hands = step(carried, ray_at(carried, trigger=1.0))
    assert not carried.pointing.pressing and not carried.taken
    assert hands["right"].trigger == 1.0
    carried, _ = step(carried, ray_at(carried))
    assert carried.taken
    carried, _ = step(carried, ray_at(carried, trigger=1.0))
    assert carried.pointing.pressing


@pytest.mark.parametrize(
    ("away", "to"), [(-0.5, 0.0), (-0.5, -1.0), (0.5, 1.0), (RAY_M + 0.2, 0.0)]
)
def test_a_ray_from_behind_or_away_or_too_far_does_not_point(away, to):
    carried = settled()
    normal = carried.play_from_panel.matrix()[:3, 2]
    place, target = (spot(carried) + normal * metres for metres in (away, to))
    for trigger in (0.0, 1.0):
        carried, _ = step(carried, hand_at(place, target, trigger=trigger))
    assert carried.pointing.at is None and not carried.on_panel


@pytest.mark.parametrize("seed", range(20))
def test_where_a_ray_meets_the_panel_is_where_the_plane_says(seed):
    """Against the closed form of a ray and a plane in the room: t = n (p - o) / n d, and the place
    by the panel's own axes.
    """
    rng = np.random.default_rng(seed)
    wxyz = rng.normal(size=4)
    pose = Pose(rng.normal(size=3), wxyz / np.linalg.norm(wxyz))
    right, up, normal = pose.matrix()[:3, :3].T
    plane = PanelPlane((300, 400), 0.0007)
    at = rng.uniform(-0.2, 1.2, 2) * plane.size
    metres = (at - np.array(plane.size) / 2) * 0.0007
    target = pose.position + right * metres[0] - up * metres[1]
    origin = target + normal * rng.uniform(0.1, 1.5) + rng.normal(size=3) * 0.1
    aim = hand_at(origin, target).aim
    found = ray_place(np.linalg.inv(pose.matrix()), aim, plane)
    along = -aim.matrix()[:3, 2]
    length = normal @ (pose.position - origin) / (normal @ along)
    meets = origin + along * length
    closed = (
        150 + (meets - pose.position) @ right / 0.0007,
        200 - (meets - pose.position) @ up / 0.0007,
    )
    np.testing.assert_allclose(found, closed, atol=1e-6)  # float64 over a metre: 1e-9 and less
    np.testing.assert_allclose(found, at, atol=1e-6)
    np.testing.assert_allclose(plane.play_point(pose, found), target, atol=1e-9)
    assert plane.holds(found) == bool((at >= 0).all() and (at < plane.size).all())


@pytest.mark.parametrize("at", [None, (math.nan, 5.0), (5.0, math.nan), (-1e-9, 0.0), (320.0, 5.0)])
def test_beside_the_panel_is_not_on_it(at):
    assert not PLANE.holds(at)


@pytest.mark.parametrize("at", [(0.0, 0.0), (319.999, 359.999)])
def test_its_edges_are_its_own(at):
    assert PLANE.holds(at)


def test_a_finger_presses_by_touching_once():
    carried = settled()
    begins = 0
    for height in (0.05, 0.02, 0.001, -0.01, -0.02, -0.01, 0.01, 0.03):
        before = carried.pointing.pressing
        carried, _ = step(carried, reaching(carried, height))
        begins += carried.pointing.pressing and not before
    assert begins == 1 and not carried.pointing.pressing


def test_a_near_squeeze_grabs_and_is_not_the_worlds():
    carried = settled()
    carried, hands = step(carried, reaching(carried, 0.03))
    assert carried.pointing.near
    carried, hands = step(carried, reaching(carried, 0.03, squeeze=1.0))
    assert carried.pointing.pressing and hands["right"].squeeze == 0
    carried, _ = step(carried, LOST)
    assert not carried.pointing.pressing and not carried.pointing.down


def test_a_hand_that_comes_back_pulling_presses_nothing_until_it_opens():
    carried = settled()
    pulling, open_ = (ray_at(carried, trigger=trigger) for trigger in (1.0, 0.0))
    for closes in (False, True):
        carried, _ = step(carried, open_)
        if closes:
            carried, _ = step(carried, pulling, replace(LEFT, menu=True))
            carried, _ = step(carried, pulling)
            carried, _ = step(carried, pulling, replace(LEFT, menu=True))
        else:
            carried, _ = step(carried, LOST)
            carried, _ = step(carried, pulling)
        assert carried.open and not carried.pointing.pressing
        carried, _ = step(carried, pulling)
        assert not carried.pointing.pressing
        carried, _ = step(carried, open_)
        carried, _ = step(carried, pulling)
        assert carried.pointing.pressing


@pytest.mark.parametrize("seen", [True, False])
@pytest.mark.parametrize("trigger", [0.0, 1.0])
def test_a_hand_that_carries_something_over_the_panel_keeps_it(trigger, seen):
    carried = settled()
    aside = hand_at((0, 0, 0)).aim
    if seen:
        carried, _ = step(carried, replace(ray_at(carried), aim=aside))
    far = replace(ray_at(carried, squeeze=1.0, trigger=trigger), aim=aside)
    carried, _ = step(carried, far)
    carried, hands = step(carried, reaching(carried, 0.03, squeeze=1.0, trigger=trigger))
    assert not carried.pointing.pressing and hands["right"].squeeze == 1.0


@pytest.mark.parametrize(
    ("does", "ours"),
    [(SLIDES, True), (RESTS, True), (SCROLLS, True), (MOVES, False), (MIDDLE, False)],
)
def test_a_stick_that_is_the_panels_moves_nobody(does, ours):
    carried = settled()
    pushed = replace(LEFT, stick=(0.9, 0.1))
    for side in ("left", "right"):
        frame = a_frame(pushed, pushed)
        hands = left_over(replace(carried, sticks={side: does}), frame.hands)
        assert hands[side].stick == ((0.0, 0.0) if ours else (0.9, 0.1))
        other = "right" if side == "left" else "left"
        assert hands[other].stick == (0.9, 0.1)


def test_a_room_with_a_new_origin_has_it_on_the_hand_at_once():
    carried = settled()
    shifted = moved(LEFT, (0.3, 0.0, 0.1))
    carried, _ = step(carried, LOST, shifted, recentred=True)
    there = hang(None, shifted, HEAD, PLANE.size_m, 0.0)
    np.testing.assert_array_equal(carried.play_from_panel.position, there.position)


def test_places_and_points_are_inverse():
    carried = settled()
    carried, _ = step(carried, ray_at(carried))
    np.testing.assert_allclose(carried.pointing.at, MIDDLE_OF, atol=1e-6)
    corner = PLANE.play_point(carried.play_from_panel, (0.0, 0.0))
    away = np.linalg.norm(corner - carried.play_from_panel.position)
    assert away == pytest.approx(np.hypot(*PLANE.size_m) / 2)


def test_a_closed_panel_leaves_the_hands_alone():
    right = hand_at((0.2, 1.2, -0.3), trigger=1.0, squeeze=1.0)
    carried, hands = step(Carried(PLANE), right)
    assert hands == {"left": LEFT, "right": right}
    assert not (carried.open or carried.on_panel or carried.taken)


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
