"""A hand without a controller: what its joints say of grip, ray, squeeze, trigger and button.

Joints are those of XR_EXT_hand_tracking, in metres of the room.  Thumb and index finger together
are trigger and squeeze at once, as the one button of a simple controller: they take what is within
reach, else act on what the ray meets, else hold the world.  A fist is the squeeze alone, thumb and
middle finger together aim a jump, and a palm that is turned up opens the panel.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.scene.pose import Pose, look_at
from shapeshift.vr.frame import SIDES, Hand

JOINTS = 26
PALM, WRIST, THUMB_TIP = 0, 1, 5
INDEX_PROXIMAL, INDEX_TIP = 7, 10
MIDDLE_PROXIMAL, MIDDLE_TIP = 12, 15
LITTLE_PROXIMAL = 22
# Knuckle to tip of index, middle, ring and little finger.
FINGERS = ((7, 8, 9, 10), (12, 13, 14, 15), (17, 18, 19, 20), (22, 23, 24, 25))
TOGETHER_M, APART_M = 0.016, 0.042  # of two fingertips: all of a pinch, nothing of it
HOLDS_M, LEAVES_M = 0.020, 0.032  # of thumb and middle finger: a button goes down, comes up
STRAIGHT, CURLED = 0.92, 0.55  # from knuckle to tip, of the length of the bones between
PALM_M = 0.03  # before the joint in the palm: what a fist holds
FIST = 0.5  # of a squeeze: its thumb lies on the index finger and pinches nothing
SHOULDER_M = np.array([0.17, -0.22, 0.03])  # from the head: right, up, back


@dataclass(frozen=True)
class BareHand:
    """A hand as its joints say, and whether its button was down, for the next frame."""

    hand: Hand
    button: bool = False


def bare_hand(side: str, joints: np.ndarray, head: Pose, button: bool = False) -> BareHand:
    """Of joints (26, 4), place and radius, metres of the room; head: play_from_head."""
    places = joints[:, :3]
    squeeze = curl(places)
    fist = squeeze > FIST
    index_m, middle_m = (
        float(np.linalg.norm(places[THUMB_TIP] - places[tip])) for tip in (INDEX_TIP, MIDDLE_TIP)
    )
    # Of a thumb at both fingers the nearer one counts.
    button = not fist and (middle_m < LEAVES_M if button else middle_m < min(HOLDS_M, index_m))
    pinch = 0.0 if fist or button else pinched(index_m)
    grip, aim = grip_pose(side, places), aim_pose(side, places, head)
    squeeze = 0.0 if button else max(squeeze, pinch)
    return BareHand(Hand(True, grip, aim, squeeze, pinch, primary=button, joints=joints), button)


def grip_pose(side: str, places: np.ndarray) -> Pose:
    """play_from_grip as a controller's: fingers to -Y, the thumb at -Z, the right hand's back at
    +X; in the middle of what a fist holds.
    """
    back = _unit(places[WRIST] - places[MIDDLE_PROXIMAL])  # +Y
    along = places[LITTLE_PROXIMAL] - places[INDEX_PROXIMAL]
    along = _unit(along - back * (along @ back))  # +Z
    across = np.cross(back, along)  # +X
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([across, back, along], axis=1)
    out = 1.0 if side == SIDES[0] else -1.0  # +X comes out of the left palm
    matrix[:3, 3] = places[PALM] + across * (out * PALM_M)
    return Pose.from_matrix(matrix)


def aim_pose(side: str, places: np.ndarray, head: Pose) -> Pose:
    """play_from_aim: from the shoulder through the knuckle of the index finger, which a pinch does
    not move.
    """
    back = head.matrix()[:3, 2] * (1, 0, 1)
    back = _unit(back) if np.linalg.norm(back) > 1e-3 else np.array([0.0, 0.0, 1.0])
    right = np.cross([0.0, 1.0, 0.0], back)
    x, y, z = SHOULDER_M
    shoulder = head.position + right * (x if side == SIDES[1] else -x) + back * z
    shoulder = shoulder + np.array([0.0, y, 0.0])
    knuckle = places[INDEX_PROXIMAL]
    along = _unit(knuckle - shoulder)
    # Straight up or down any other direction will do for its upper side.
    upper = (0.0, 1.0, 0.0) if abs(along[1]) < 0.99 else (float(back[0]), 0.0, float(back[2]))
    return look_at(knuckle, knuckle + along, upper)


def curl(places: np.ndarray) -> float:
    """0..1: how much of a fist it is; none with a finger that points."""
    parts = []
    for finger in FINGERS:
        bones = places[list(finger)]
        length = float(np.linalg.norm(np.diff(bones, axis=0), axis=1).sum())
        straight = float(np.linalg.norm(bones[-1] - bones[0])) / max(length, 1e-6)
        parts.append((STRAIGHT - straight) / (STRAIGHT - CURLED))
    return min(max(min(parts[0], sum(parts[1:]) / len(parts[1:])), 0.0), 1.0)


def pinched(gap_m: float) -> float:
    """0..1 of two fingertips so far apart."""
    return float(np.clip((APART_M - gap_m) / (APART_M - TOGETHER_M), 0, 1))


def _unit(vector: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
