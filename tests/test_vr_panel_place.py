"""Where the panel hangs, how rays and fingers reach it, and what it leaves of the hands."""

from dataclasses import replace

import numpy as np
import pytest
from vr_hands import HEAD, a_frame, hand_at, moved

from runtime_models.model import Stop
from scene.pose import Pose
from vr.carried import Carried, carry, panel_row
from vr.frame import LOST, Hand, Pulse
from vr.glove import fingertip, glove
from vr.panel_layout import knob_place, lay_out
from vr.panel_place import ABOVE_HAND, NEAR_M, RAY_M, hang, play_point
from vr.panel_state import Facts, Recentre, SetX, Slider

STOPS = (Stop("normal", 0.0), Stop("ice", 0.25), Stop("fire", 1.0))
FACTS = Facts((Slider("cube", STOPS, 0.25),))
LEFT = hand_at((-0.15, 1.15, -0.45))
SIZE_M = (0.37, 0.27)


def settled(facts: Facts = FACTS, left: Hand = LEFT) -> Carried:
    carried = Carried()
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


def test_it_hangs_over_the_hand_upright_and_faces_the_head():
    pose = hang(None, LEFT, HEAD, SIZE_M, 0.0)
    right, up, normal = pose.matrix()[:3, :3].T
    over = pose.position - LEFT.grip.position
    np.testing.assert_allclose(over, (0, ABOVE_HAND + SIZE_M[1] / 2, 0), atol=1e-12)
    to_head = HEAD.position - pose.position
    np.testing.assert_allclose(normal, to_head / np.linalg.norm(to_head), atol=1e-12)
    assert right[1] == pytest.approx(0) and up[1] > 0.5


def test_it_follows_a_trembling_hand_calmly_and_a_jump_at_once():
    pose = hang(None, LEFT, HEAD, SIZE_M, 0.0)
    for by, least, most in ((0.002, 0.0001, 0.0005), (0.7, 0.699, 0.701)):
        now = hang(pose, moved(LEFT, (by, 0, 0)), HEAD, SIZE_M, 1 / 90)
        assert least < (now.position - pose.position)[0] < most


def test_without_a_hand_it_stays_and_at_first_is_before_the_head():
    pose = hang(None, LOST, HEAD, SIZE_M, 0.0)
    assert pose.position[2] == pytest.approx(-0.55) and 1.3 < pose.position[1] < 1.6
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
    carried, _, _ = step(carried, hand_at((0.2, 1.2, -0.4), menu=True))
    assert not carried.panel.open
    other = Carried(replace(carried.panel), home="right")
    other, _, _ = step(other, hand_at((0.2, 1.2, -0.4), menu=True))
    assert other.panel.side == "right"


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
    over = carried.play_from_panel.position - shifted.grip.position
    np.testing.assert_allclose(over[[0, 2]], 0, atol=1e-12)


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
    carried = replace(settled(), panel=replace(settled().panel, side=""))
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
