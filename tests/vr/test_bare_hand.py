"""What the joints of a hand without a controller say: grip, ray, squeeze, trigger, button."""

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import Hand
from shapeshift.vr.glove import fingertip, glove
from shapeshift.vr.openxr.tracked import (
    APART_M,
    FINGERS,
    HOLDS_M,
    INDEX_PROXIMAL,
    INDEX_TIP,
    JOINTS,
    LEAVES_M,
    MIDDLE_TIP,
    THUMB_TIP,
    TOGETHER_M,
    bare_hand,
)
from tests.support.vr.vr_hands import HEAD

ACROSS = (-0.027, -0.009, 0.009, 0.027)  # metres, of index to little finger, right hand
BONES = (0.045, 0.028, 0.024)


def joints_of(side: str, bend: float = 0.0, at=(0.2, 1.2, -0.4)) -> np.ndarray:
    """(26, 4) of a flat hand, palm down, fingers ahead; each joint of a finger bent by radians."""
    places = np.zeros((JOINTS, 3))
    places[0], places[1] = (0, 0, -0.05), (-0.009, 0, 0.0)
    thumb = np.array([(-0.02, -0.01, -0.02), (-0.045, -0.01, -0.045), (-0.06, -0.01, -0.07)])
    places[2:6] = [*thumb, (-0.07, -0.01, -0.095)]
    for number, across in enumerate(ACROSS):
        first = 6 + 5 * number
        places[first], at_joint = (across * 0.6, 0, -0.02), np.array([across, 0.0, -0.09])
        places[first + 1] = at_joint
        for step, length in enumerate(BONES):
            angle = bend * (step + 1)
            at_joint = at_joint + length * np.array([0, -np.sin(angle), -np.cos(angle)])
            places[first + 2 + step] = at_joint
    if side == "left":
        places[:, 0] *= -1
    return np.column_stack([places + at, np.full(JOINTS, 0.009)])


def seen(side: str, joints: np.ndarray, button: bool = False) -> Hand:
    return bare_hand(side, joints, HEAD, button).hand


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_grip_is_that_of_a_controller(side):
    """Palm down, fingers ahead: an open hand's fingers point to -Y, thumbs to -Z, and +X goes into
    the right palm and comes out of the left one.
    """
    grip = seen(side, joints_of(side)).grip.matrix()
    inwards = -1.0 if side == "right" else 1.0  # where the thumb is
    np.testing.assert_allclose(grip[:3, 1], (0, 0, 1), atol=1e-9)
    np.testing.assert_allclose(grip[:3, 2], (-inwards, 0, 0), atol=1e-9)
    np.testing.assert_allclose(grip[:3, 0], (0, 1 if side == "right" else -1, 0), atol=1e-9)
    assert np.linalg.det(grip[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(grip[:3, 3], (0.2, 1.17, -0.45), atol=1e-9)  # below the palm


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_fist_squeezes_and_pinches_nothing(side):
    flat, fist = joints_of(side), joints_of(side, bend=1.5)
    assert seen(side, flat).squeeze == 0 and seen(side, fist).squeeze == 1
    fist[THUMB_TIP, :3] = fist[INDEX_TIP, :3]
    assert seen(side, fist).trigger == 0 and not seen(side, fist).primary
    fist[THUMB_TIP] = joints_of(side)[THUMB_TIP]
    fist[FINGERS[0], :] = flat[FINGERS[0], :]
    assert seen(side, fist).squeeze == 0  # it points
    half = [seen(side, joints_of(side, bend=bend)).squeeze for bend in np.linspace(0, 1.5, 25)]
    assert (np.diff(half) >= 0).all() and any(0.2 < value < 0.8 for value in half)


@pytest.mark.parametrize(
    ("gap_m", "trigger"),
    [(0.0, 1.0), (TOGETHER_M, 1.0), (APART_M, 0.0), (1.0, 0.0), ((TOGETHER_M + APART_M) / 2, 0.5)],
)
def test_thumb_and_index_finger_are_the_trigger(gap_m, trigger):
    joints = joints_of("right")
    joints[THUMB_TIP, :3] = joints[INDEX_TIP, :3] + (0, -gap_m, 0)
    hand = seen("right", joints)
    assert hand.trigger == hand.squeeze == pytest.approx(trigger) and not hand.primary


def test_thumb_and_middle_finger_are_a_button_that_does_not_tremble():
    joints, held, told = joints_of("right"), False, []
    for gap_m in (0.05, LEAVES_M - 1e-4, HOLDS_M - 1e-4, LEAVES_M - 1e-4, LEAVES_M + 1e-4):
        joints[THUMB_TIP, :3] = joints[MIDDLE_TIP, :3] + (0.0, -gap_m, 0.0)
        made = bare_hand("right", joints, HEAD, held)
        held = made.button
        assert not held or made.hand.trigger == made.hand.squeeze == 0
        told.append(held)
    assert told == [False, False, True, True, False]


def test_of_a_thumb_at_both_fingers_the_nearer_one_counts():
    joints = joints_of("right")
    joints[INDEX_TIP, :3] = joints[MIDDLE_TIP, :3] + (-0.012, 0, 0)
    for share, button in ((0.2, True), (0.8, False)):
        between = joints[[MIDDLE_TIP, INDEX_TIP], :3]
        joints[THUMB_TIP, :3] = between[0] + share * (between[1] - between[0])
        hand = seen("right", joints)
        assert hand.primary == button and (hand.trigger == 0) == button


def test_a_ray_goes_from_the_knuckle_and_a_pinch_does_not_move_it():
    joints = joints_of("right")
    before = seen("right", joints).aim
    joints[THUMB_TIP, :3] = joints[INDEX_TIP, :3] = joints[INDEX_TIP, :3] + (0, -0.03, 0.03)
    after = seen("right", joints).aim
    np.testing.assert_allclose(before.matrix(), after.matrix())
    np.testing.assert_allclose(before.position, joints[INDEX_PROXIMAL, :3])
    ahead = -before.matrix()[:3, 2]
    assert ahead[2] < -0.7 and abs(ahead[0]) < 0.2
    # Straight below the shoulder and above it, a head that looks down: still a pose.
    down = Pose(HEAD.position, np.array([np.sqrt(0.5), -np.sqrt(0.5), 0, 0]))
    for up in (-0.6, 0.6):
        shoulder = np.add(HEAD.position, (0.17, -0.22 + up, 0.03))
        at = shoulder - (joints[INDEX_PROXIMAL, :3] - (0.2, 1.2, -0.4))
        for head in (HEAD, down):
            aim = bare_hand("right", joints_of("right", at=at), head).hand.aim
            assert np.isfinite(aim.matrix()).all()


def test_its_glove_follows_the_joints_and_its_finger_is_the_real_one():
    joints = joints_of("left")
    hand = seen("left", joints)
    parts = glove("left", hand)
    ends = np.array([[part.a, part.b] for part in parts]).reshape(-1, 3)
    away = np.linalg.norm(ends[:, None] - joints[None, :, :3], axis=2).min(axis=0)
    assert np.delete(away, 0).max() < 1e-9  # each joint but the palm's own
    bones = {tuple(np.round(part.b - part.a, 6)) for part in parts}
    assert tuple(np.round(joints[INDEX_TIP, :3] - joints[INDEX_TIP - 1, :3], 6)) in bones
    tip = fingertip("left", hand)
    np.testing.assert_allclose(tip, joints[INDEX_TIP, :3] + (0, 0, -0.009), atol=1e-9)
    assert glove("left", hand, True)[-1].color != parts[-1].color


def test_joints_in_one_place_are_numbers_all_the_same():
    hand = seen("right", np.zeros((JOINTS, 4)))
    for pose in (hand.grip, hand.aim):
        assert np.isfinite(pose.matrix()).all()
    assert 0 <= hand.squeeze <= 1 and 0 <= hand.trigger <= 1


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("side", ["left", "right"])
def test_joints_in_one_place_have_no_direction_and_divide_by_nothing(side):
    """What runtimes say of a finger that they lose, and of a hand of one point: lines of a report
    have no room for NaN.
    """
    joints = joints_of(side)
    joints[9] = joints[10]
    np.testing.assert_array_equal(fingertip(side, Hand(joints=joints)), joints[10, :3])
    joints[9, :3] += 1e-12  # nearer than a bone
    np.testing.assert_array_equal(fingertip(side, Hand(joints=joints)), joints[10, :3])
    joints = joints_of(side)
    joints[9, :3] = joints[10, :3] - (0.0, 0.0, 2e-6)
    tip = joints[10, :3] + (0.0, 0.0, joints[10, 3])
    np.testing.assert_allclose(fingertip(side, Hand(joints=joints)), tip, atol=1e-12)
    joints[:, :3] = joints[0, :3]
    hand = Hand(True, grip=Pose(joints[0, :3], np.array([1.0, 0, 0, 0])), joints=joints)
    for part in glove(side, hand):
        assert np.isfinite([*part.a, *part.b, *part.radii]).all()
