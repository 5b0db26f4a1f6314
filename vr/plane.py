"""Where the panel hangs in the room, and where a hand points at it.

Its own frame: the origin in its middle, +X right, +Y up, +Z towards who reads it; metres.  Places
on it are logical pixels of what draws it, from its upper left corner, right and down.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import SIDES, Hand
from shapeshift.vr.glove import fingertip

ASIDE, ABOVE_M = 0.35, 0.03  # from the grip: outwards, of the width; up, metres to the lower edge
BESIDE_HEAD = np.array([0.24, -0.24, -0.5])  # without a hand, metres outwards, up, back of a head
CALM_S = 0.06  # time constant at which it follows: hands tremble
JUMP_M = 0.5  # farther than this it is there at once
RAY_M = 3.0  # as far one can point at it
NEAR_M = 0.09  # a fingertip so close points itself, not the ray
TOUCH_M, LEAVE_M, THROUGH_M = 0.004, 0.016, 0.07  # a finger presses, lets go, is behind it
PRESS, RELEASE = 0.6, 0.4  # of trigger and squeeze

Place = tuple[float, float]  # logical pixels of the panel


@dataclass(frozen=True)
class PanelPlane:
    """How large a panel is: for who draws it, and in the room."""

    size: tuple[int, int]  # logical pixels, width and height
    metres_per_pixel: float

    @property
    def size_m(self) -> tuple[float, float]:
        return self.size[0] * self.metres_per_pixel, self.size[1] * self.metres_per_pixel

    def holds(self, at: Place | None) -> bool:
        """Whether a place lies on it, not beside it."""
        return at is not None and 0 <= at[0] < self.size[0] and 0 <= at[1] < self.size[1]

    def place(self, local: np.ndarray) -> Place:
        """Of a point (3,) of the panel's frame, metres, or of what lies straight below it."""
        x, y = local[0] / self.metres_per_pixel, local[1] / self.metres_per_pixel
        return float(self.size[0] / 2 + x), float(self.size[1] / 2 - y)

    def play_point(self, play_from_panel: Pose, at: Place) -> np.ndarray:
        """(3,) metres of the room of a place."""
        width, height = self.size
        local = np.array([at[0] - width / 2, height / 2 - at[1], 0.0]) * self.metres_per_pixel
        return play_from_panel.matrix()[:3, :3] @ local + play_from_panel.position


@dataclass(frozen=True)
class Pointing:
    """The hand that points at the panel, the one that does not carry it; kept between frames."""

    at: Place | None = None  # where it points, on the plane of the panel; None: away from it
    near: bool = False  # its finger points, not its ray
    down: bool = False  # it presses: trigger, a squeeze at close range, a finger that touches
    full: bool = False  # it squeezed before it came near: something else
    unsure: bool = True  # it was away, and has not been seen open since
    elsewhere: bool = False  # its press began beside the panel, or nobody knows where
    pressing: bool = False  # its press began on the panel and goes on, wherever it points now


NOBODY = Pointing()


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


def point(
    pointing: Pointing, play_from_panel: Pose, plane: PanelPlane, side: str, hand: Hand
) -> Pointing:
    """Where the hand of a side points in this frame, and whether it presses; a lost hand does
    neither, and what it held is let go.
    """
    if hand.grip is None:
        return NOBODY
    panel_from_play = np.linalg.inv(play_from_panel.matrix())
    near = _near(panel_from_play, fingertip(side, hand), plane, pointing.near)
    full = hand.squeeze >= RELEASE and (near is None or pointing.full)
    if near is None:
        at = ray_place(panel_from_play, hand.aim, plane)
        down = _firm(hand.trigger, pointing.down)
    else:
        at, height = near
        touches = height < (LEAVE_M if pointing.down else TOUCH_M)
        squeeze = 0.0 if full else hand.squeeze
        down = touches or _firm(max(hand.trigger, squeeze), pointing.down)
    unsure = down and pointing.unsure
    now = replace(pointing, at=at, near=near is not None, down=down, full=full, unsure=unsure)
    return _pressed(now, plane)


def _pressed(pointing: Pointing, plane: PanelPlane) -> Pointing:
    """Only what begins on the panel presses there: a hand that fires while it sweeps across, or
    carries something over it, does not.
    """
    if not pointing.down:
        return replace(pointing, elsewhere=False, pressing=False)
    if pointing.pressing:
        return pointing
    begins = plane.holds(pointing.at) and not pointing.unsure and not pointing.elsewhere
    return replace(pointing, elsewhere=not begins, pressing=begins)


def _near(
    panel_from_play: np.ndarray, tip: np.ndarray, plane: PanelPlane, was: bool
) -> tuple[Place, float] | None:
    """The place below a fingertip close to the panel, and its height over it, metres."""
    local = panel_from_play[:3, :3] @ tip + panel_from_play[:3, 3]
    slack = 1.3 if was else 1.0  # no trembling between finger and ray
    half = np.array(plane.size_m) / 2 + (0.03 if was else 0.0)
    if not (-THROUGH_M < local[2] < NEAR_M * slack and (np.abs(local[:2]) <= half).all()):
        return None
    return plane.place(local), float(local[2])


def ray_place(panel_from_play: np.ndarray, aim: Pose | None, plane: PanelPlane) -> Place | None:
    """Where a ray along -Z of a pose meets the plane from its front; None where it does not."""
    if aim is None:
        return None
    origin = panel_from_play[:3, :3] @ aim.position + panel_from_play[:3, 3]
    along = panel_from_play[:3, :3] @ -aim.matrix()[:3, 2]
    if not (origin[2] > 0 and along[2] < -1e-3 and -origin[2] / along[2] <= RAY_M):
        return None
    return plane.place(origin - along * origin[2] / along[2])


def _firm(value: float, was: bool) -> bool:
    return value >= (RELEASE if was else PRESS)


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
