"""Where the panel hangs in the room, and where hands point at it.

Its own frame: the origin in its middle, +X right, +Y up, +Z towards who reads it; metres.
"""

import math
from dataclasses import dataclass

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import SIDES, Hand
from shapeshift.vr.glove import fingertip
from shapeshift.vr.panel.panel import Pointer
from shapeshift.vr.panel.panel_layout import METRES_PER_PIXEL, Layout
from shapeshift.vr.panel.panel_state import Place

ASIDE, ABOVE_M = 0.35, 0.03  # from the grip: outwards, of the width; up, metres to the lower edge
BESIDE_HEAD = np.array([0.24, -0.24, -0.5])  # without a hand, metres outwards, up, back of a head
CALM_S = 0.06  # time constant at which it follows: hands tremble
JUMP_M = 0.5  # farther than this it is there at once
RAY_M = 3.0  # as far one can point at it
NEAR_M = 0.09  # a fingertip so close points itself, not the ray
TOUCH_M, LEAVE_M, THROUGH_M = 0.004, 0.016, 0.07  # a finger presses, lets go, is behind it
PRESS, RELEASE = 0.6, 0.4  # of trigger and squeeze


@dataclass(frozen=True)
class Pointing:
    """What is remembered of the hands between frames; sides."""

    near: frozenset[str] = frozenset()  # their finger points, not their ray
    down: frozenset[str] = frozenset()  # they press
    full: frozenset[str] = frozenset()  # they squeezed before they came near: something else
    unsure: frozenset[str] = frozenset()  # they were away and have not been seen open since

    def without(self, side: str) -> "Pointing":
        """That of a hand that is gone."""
        near, down, full = (sides - {side} for sides in (self.near, self.down, self.full))
        return Pointing(near, down, full, self.unsure | {side})

    def of(self, side: str, near: bool, down: bool, full: bool) -> "Pointing":
        return Pointing(
            _with(self.near, side, near),
            _with(self.down, side, down),
            _with(self.full, side, full),
            _with(self.unsure, side, down and side in self.unsure),
        )


NOBODY = Pointing(unsure=frozenset(SIDES))


def hang(
    before: Pose | None, hand: Hand, head: Pose, size_m: tuple[float, float], seconds: float,
    side: str = SIDES[0],
) -> Pose:  # fmt: skip
    """play_from_panel: beside the hand of a side, outwards, turned to the head; where it was once
    the hand is lost.

    A left hand has it at the lower left: not over what one looks at, and down with the hand.
    """
    outwards = -1.0 if side == SIDES[0] else 1.0
    if hand.grip is None:
        return before or facing(_beside(head, outwards), head)
    right = facing(hand.grip.position, head).matrix()[:3, 0]
    aside = right * outwards * ASIDE * size_m[0]
    place = hand.grip.position + aside + np.array([0.0, ABOVE_M + size_m[1] / 2, 0.0])
    if before is not None and np.linalg.norm(place - before.position) < JUMP_M:
        part = -math.expm1(-max(seconds, 0.0) / CALM_S)
        place = before.position + (place - before.position) * part
    return facing(place, head)


def point_at(
    pointing: Pointing, panel_pose: Pose, layout: Layout, hands: dict[str, Hand], carrier: str
) -> tuple[Pointing, list[Pointer]]:
    """The pointers of all hands but the one that carries the panel; a lost hand has none."""
    panel_from_play = np.linalg.inv(panel_pose.matrix())
    pointers = []
    for side in SIDES:
        hand = hands[side]
        if side == carrier or hand.grip is None:
            pointing = pointing.without(side)
            continue
        near = _near(panel_from_play, fingertip(side, hand), layout, side in pointing.near)
        full = hand.squeeze >= RELEASE and (near is None or side in pointing.full)
        if near is None:
            at = _ray_place(panel_from_play, hand, layout)
            down = _firm(hand.trigger, side, pointing)
        else:
            at, height = near
            squeeze = 0.0 if full else hand.squeeze
            touches = height < (LEAVE_M if side in pointing.down else TOUCH_M)
            down = touches or _firm(max(hand.trigger, squeeze), side, pointing)
        pointing = pointing.of(side, near is not None, down, full)
        pointers.append(Pointer(side, at, down, side in pointing.unsure))
    return pointing, pointers


def play_point(panel_pose: Pose, layout: Layout, at: Place) -> np.ndarray:
    """(3,) metres of the room of a place on the panel's picture."""
    width, height = layout.size
    local = np.array([at[0] - width / 2, height / 2 - at[1], 0.0]) * METRES_PER_PIXEL
    return panel_pose.matrix()[:3, :3] @ local + panel_pose.position


def _near(
    panel_from_play: np.ndarray, tip: np.ndarray, layout: Layout, was: bool
) -> tuple[Place, float] | None:
    """The place below a fingertip close to the panel, and its height over it, metres."""
    local = panel_from_play[:3, :3] @ tip + panel_from_play[:3, 3]
    slack = 1.3 if was else 1.0  # no trembling between finger and ray
    half = np.array(layout.size_m) / 2 + (0.03 if was else 0.0)
    if not (-THROUGH_M < local[2] < NEAR_M * slack and (np.abs(local[:2]) <= half).all()):
        return None
    return _pixels(local, layout), float(local[2])


def _ray_place(panel_from_play: np.ndarray, hand: Hand, layout: Layout) -> Place | None:
    """Where the hand's ray meets the plane from its front; None where it does not."""
    if hand.aim is None:
        return None
    origin = panel_from_play[:3, :3] @ hand.aim.position + panel_from_play[:3, 3]
    along = panel_from_play[:3, :3] @ -hand.aim.matrix()[:3, 2]
    if not (origin[2] > 0 and along[2] < -1e-3 and -origin[2] / along[2] <= RAY_M):
        return None
    return _pixels(origin - along * origin[2] / along[2], layout)


def _pixels(local: np.ndarray, layout: Layout) -> Place:
    width, height = layout.size
    return (
        float(width / 2 + local[0] / METRES_PER_PIXEL),
        float(height / 2 - local[1] / METRES_PER_PIXEL),
    )


def _firm(value: float, side: str, pointing: Pointing) -> bool:
    return value >= (RELEASE if side in pointing.down else PRESS)


def _with(sides: frozenset[str], side: str, belongs: bool) -> frozenset[str]:
    return sides | {side} if belongs else sides - {side}


def _beside(head: Pose, outwards: float) -> np.ndarray:
    """(3,) a place before the head, below and aside, -1 left, 1 right; it may look up or down."""
    back = head.matrix()[:3, 2] * (1, 0, 1)
    length = np.linalg.norm(back)
    back = back / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])
    right = np.array([back[2], 0.0, -back[0]])
    x, y, z = BESIDE_HEAD
    return head.position + right * (x * outwards) + np.array([0.0, y, 0.0]) + back * z


def facing(place: np.ndarray, head: Pose) -> Pose:
    """A pose at a place (3,), upright, its +Z to where the head is."""
    normal = head.position - place
    length = np.linalg.norm(normal)
    normal = normal / length if length > 1e-6 else head.matrix()[:3, 2]
    right = np.cross([0.0, 1.0, 0.0], normal)
    if not np.linalg.norm(right) > 1e-3:  # straight below or above the head
        right = head.matrix()[:3, 0] - normal * (head.matrix()[:3, 0] @ normal)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(normal, right), normal], axis=1)
    matrix[:3, 3] = place
    return Pose.from_matrix(matrix)
