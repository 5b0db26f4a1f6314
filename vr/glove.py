"""A hand as capsules: a glove whose fingers follow trigger and squeeze.

In the grip's own frame, as OpenXR has it: the fist holds a tube along Z with the thumb at -Z, and
an open hand's fingers point to -Y; the right hand's back is at +X.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shapeshift.vr.frame import Hand, grip_of

GLOVE, CUFF, LIT = (0.82, 0.83, 0.86), (0.30, 0.31, 0.35), (0.96, 0.66, 0.30)  # display sRGB
WRIST = np.array([0.020, 0.058, 0.0])  # metres, right hand
# Of index, middle, ring, little finger: where the knuckle is across the palm, and how long it is
FINGERS = ((-0.032, 0.95), (-0.0105, 1.06), (0.0105, 1.0), (0.030, 0.80))
BONES = np.array([0.043, 0.027, 0.021])  # metres, of a finger of length 1
THICK = (0.0108, 0.0098, 0.0090, 0.0080)  # radius at the knuckle, the joints, the tip
REST, FIST = np.array([0.62, 0.85, 0.45]), np.array([1.30, 1.50, 0.95])  # radians at the joints
THUMB_BASE = np.array([0.008, 0.030, -0.030])  # metres, right hand
THUMB_OPEN = np.array([[-0.45, -0.55, -0.70], [-0.20, -0.90, -0.40]])  # where its bones point
THUMB_SHUT = np.array([[-0.80, -0.55, -0.25], [-0.50, -0.60, 0.60]])
MIRROR = {"right": np.array([1.0, 1.0, 1.0]), "left": np.array([-1.0, 1.0, 1.0])}
# Of XR_EXT_hand_tracking: the palm, the wrist, first and last joint of each finger.
PALM_JOINT, WRIST_JOINT, CHAINS = 0, 1, ((2, 5), (6, 10), (11, 15), (16, 20), (21, 25))
INDEX_JOINTS = (9, 10)  # the last two of the pointing finger
JOINT_M = (0.006, 0.024)  # radii that look like a hand's
SHORTEST_M = 1e-6  # of a bone that has a direction
MOST_ASIDE = 0.8  # radians from straight ahead that the pointing finger turns to the aim


@dataclass(frozen=True)
class Capsule:
    """A line with a thickness."""

    a: np.ndarray  # (3,) metres
    b: np.ndarray
    radii: tuple[float, float]  # at a and b
    color: tuple[float, ...]  # display sRGB, and opacity where it has one
    color_b: tuple[float, ...] | None = None  # at b; None: as at a


def glove(side: str, hand: Hand, holds: bool = False) -> list[Capsule]:
    """The capsules of a hand in the room; none when it is lost."""
    if hand.grip is None:
        return []
    if hand.joints is not None:
        return bare_glove(hand.joints, holds)
    to_play = hand.grip.matrix()[:3, :3] * MIRROR[side]  # columns: of the right hand's frame
    at = hand.grip.position

    def capsule(a, b, radii, color) -> Capsule:
        return Capsule(to_play @ a + at, to_play @ b + at, radii, color)

    parts = []
    for number, (across, _) in enumerate(FINGERS):
        knuckle = _knuckle(across)
        wrist = _beside(WRIST, 0.0, across * 0.62)
        parts.append(capsule(wrist, _beside(knuckle, 0.004, 0.0), (0.0165, 0.0135), GLOVE))
        joints = _finger(number, side, hand)
        for bone in range(3):
            radii = (THICK[bone], THICK[bone + 1])
            parts.append(capsule(joints[bone], joints[bone + 1], radii, GLOVE))
    joints = _thumb(hand.squeeze)
    for bone, radii in enumerate(((0.0150, 0.0118), (0.0118, 0.0095))):
        parts.append(capsule(joints[bone], joints[bone + 1], radii, GLOVE))
    cuff = LIT if holds else CUFF
    for y in (0.010, 0.024):
        ends = _beside(WRIST, y, -0.012), _beside(WRIST, y, 0.012)
        parts.append(capsule(*ends, (0.024, 0.024), cuff))
    return parts


def bare_glove(joints: np.ndarray, holds: bool) -> list[Capsule]:
    """Around the joints (26, 4) that a hand without a controller has."""
    ends, radii = joints[:, :3], np.clip(joints[:, 3], *JOINT_M)
    parts = [
        Capsule(ends[a], ends[b], (float(radii[a]), float(radii[b])), GLOVE)
        for first, last in CHAINS
        for a, b in pairwise((WRIST_JOINT, *range(first, last + 1)))
    ]
    cuff, wide = LIT if holds else CUFF, float(radii[WRIST_JOINT]) * 1.15
    back = _unit(ends[WRIST_JOINT] - ends[PALM_JOINT]) * wide
    return [
        *parts,
        Capsule(ends[WRIST_JOINT] + back * 0.3, ends[WRIST_JOINT] + back, (wide, wide), cuff),
    ]


def fingertip(side: str, hand: Hand) -> np.ndarray:
    """(3,) metres in the room: the end of the outstretched pointing finger.

    As it is with the trigger at rest: pulling it shall not draw the finger off what it touches.
    """
    if hand.joints is not None:
        tip, before = hand.joints[INDEX_JOINTS[1]], hand.joints[INDEX_JOINTS[0], :3]
        return tip[:3] + _unit(tip[:3] - before) * tip[3]
    joints = _finger(0, side, Hand(True, hand.grip, hand.aim))
    along = _unit(joints[3] - joints[2])
    tip = (joints[3] + along * THICK[3]) * MIRROR[side]
    grip = grip_of(hand)
    return grip.matrix()[:3, :3] @ tip + grip.position


def _knuckle(across: float) -> np.ndarray:
    """(3,) metres, right hand: the row of knuckles is a shallow arch."""
    return np.array([0.019 - 6.0 * across**2, -0.034 + 9.0 * (across + 0.006) ** 2, across])


def _finger(number: int, side: str, hand: Hand) -> np.ndarray:
    """(4, 3) metres, right hand: knuckle, two joints, tip."""
    across, length = FINGERS[number]
    curl = max(hand.trigger, 0.0) if number == 0 else hand.squeeze
    rest = np.zeros(3) if number == 0 else REST
    bends = np.cumsum(rest + (FIST - rest) * min(max(curl, 0.0), 1.0))
    straight = _ahead(side, hand) if number == 0 else np.array([0.0, -1.0, 0.0])
    # A finger bends about the palm's breadth, from straight ahead towards the palm.
    inward = np.array([-1.0, 0.0, 0.0])
    inward = inward - straight * (inward @ straight)
    inward /= np.linalg.norm(inward)
    joints = [_knuckle(across)]
    for bend, bone in zip(bends, BONES * length, strict=True):
        joints.append(joints[-1] + bone * (straight * np.cos(bend) + inward * np.sin(bend)))
    return np.array(joints)


def _ahead(side: str, hand: Hand) -> np.ndarray:
    """(3,) where the pointing finger points: along the aim, as far as a finger goes."""
    ahead = np.array([0.0, -1.0, 0.0])
    if hand.aim is None:
        return ahead
    aim = grip_of(hand).matrix()[:3, :3].T @ -hand.aim.matrix()[:3, 2]
    if side == "left":
        aim[0] = -aim[0]
    angle = np.arccos(np.clip(aim @ ahead, -1, 1))
    aside = aim - ahead * (aim @ ahead)
    if not np.linalg.norm(aside) > 1e-6:
        return ahead
    angle = min(angle, MOST_ASIDE)
    return ahead * np.cos(angle) + aside / np.linalg.norm(aside) * np.sin(angle)


def _thumb(squeeze: float) -> np.ndarray:
    """(3, 3) metres, right hand: base, joint, tip."""
    part = min(max(squeeze, 0.0), 1.0)
    bones = THUMB_OPEN + (THUMB_SHUT - THUMB_OPEN) * part
    joint = THUMB_BASE + 0.044 * _unit(bones[0])
    return np.stack([THUMB_BASE, joint, joint + 0.032 * _unit(bones[1])])


def _beside(place: np.ndarray, y: float, z: float) -> np.ndarray:
    return place + np.array([0.0, y, z])


def _unit(vector: np.ndarray) -> np.ndarray:
    """Of length 1; of no length where the two joints it lies between are in one place."""
    length = np.linalg.norm(vector)
    return vector / length if length > SHORTEST_M else np.zeros(3)
