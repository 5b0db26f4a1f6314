"""A round glass in a hand: where it is, its rim and handle, and which pixels of an eye it covers.

Metres of the room.  In the grip's frame a fist holds a tube along Z, the thumb at -Z: the handle
lies there, and the glass stands on it with its faces ahead and back of the hand.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shapeshift.scene.pose import Pose, View
from shapeshift.vr.frame import Hand
from shapeshift.vr.glove import Capsule

RADIUS_M = 0.085  # of the glass
HANDLE_M = 0.075  # from the grip to the rim: over the fist and a thumb
BELOW_M = 0.045  # of the handle, below the grip
RIM_M, HANDLE_THICK_M = 0.005, 0.009  # radii
METAL, WOOD = (0.62, 0.64, 0.68), (0.34, 0.35, 0.39)  # display sRGB
PARTS = 40  # of the rim
SIDEWAYS, FACES = 0.20, 0.28  # cosine to the line of sight: below it is hidden, above seen again
STEP_PX = 32  # by which pictures grow: a new texture a frame would cost more than its pixels

PixelBox = tuple[int, int, int, int]  # left, bottom, width, height


@dataclass(frozen=True)
class HeldGlass:
    """Its middle; +Z to the side that is looked at, +Y away from the hand."""

    play_from_glass: Pose
    radius_m: float = RADIUS_M

    def point(self, x: float, y: float, z: float = 0.0) -> np.ndarray:
        """(3,) metres of the room of a place on it."""
        matrix = self.play_from_glass.matrix()
        return matrix[:3, :3] @ np.array([x, y, z]) + matrix[:3, 3]

    def around(self, count: int, wider: float = 1.0) -> np.ndarray:
        """(count, 3) points of its edge, or of a circle so much wider."""
        turns = np.linspace(0, 2 * np.pi, count, endpoint=False)
        flat = np.stack([np.cos(turns), np.sin(turns), np.zeros(count)]) * self.radius_m * wider
        matrix = self.play_from_glass.matrix()
        return (matrix[:3, :3] @ flat).T + matrix[:3, 3]


def held_glass(hand: Hand, head: Pose, was: bool = False) -> HeldGlass | None:
    """The glass in a hand that is there; None where its edge is turned to the head.

    was: it was seen before; so it does not tremble between yes and no.
    """
    if hand.grip is None:
        return None
    grip = hand.grip.matrix()
    up, back = -grip[:3, 2], grip[:3, 1]
    middle = grip[:3, 3] + up * (HANDLE_M + RADIUS_M)
    sight = head.position - middle
    length = float(np.linalg.norm(sight))
    if not length > RADIUS_M:
        return None  # the head is in it
    facing = float(back @ sight) / length
    if not abs(facing) >= (SIDEWAYS if was else FACES):
        return None
    normal = back if facing > 0 else -back
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([np.cross(up, normal), up, normal], axis=1)
    matrix[:3, 3] = middle
    return HeldGlass(Pose.from_matrix(matrix))


def frame_of(glass: HeldGlass) -> list[Capsule]:
    """Its rim and its handle, lit and solid."""
    edge = glass.around(PARTS)
    parts = [
        Capsule(a, b, (RIM_M, RIM_M), METAL) for a, b in pairwise(np.concatenate([edge, edge[:1]]))
    ]
    foot = -glass.radius_m
    ends = glass.point(0.0, foot - HANDLE_M - BELOW_M), glass.point(0.0, foot - 0.03)
    parts.append(Capsule(*ends, (HANDLE_THICK_M, HANDLE_THICK_M), WOOD))
    neck = ends[1], glass.point(0.0, foot)
    return [*parts, Capsule(*neck, (HANDLE_THICK_M * 0.8, RIM_M), METAL)]


def boxes_of(glass: HeldGlass, views: Sequence[View]) -> list[PixelBox] | None:
    """The pixels of each view, in the room, that the glass may cover: equally many in those of one
    size, so that both eyes are drawn at once, few where none of them sees it; None where no view
    does.
    """
    spans = [_span(glass, view) for view in views]
    if all(span is None for span in spans):
        return None
    boxes = []
    for span, view in zip(spans, views, strict=True):
        alike = [s for s, v in zip(spans, views, strict=True) if s and v.size == view.size]
        most = [max((s[axis + 2] for s in alike), default=1) for axis in (0, 1)]
        size = [min(-(-most[i] // STEP_PX) * STEP_PX, view.size[i]) for i in (0, 1)]
        low = [0, 0]
        if span is not None:
            low = [min(span[axis], view.size[axis] - size[axis]) for axis in (0, 1)]
        boxes.append((low[0], low[1], size[0], size[1]))
    return boxes


def _span(glass: HeldGlass, view: View) -> PixelBox | None:
    """The least box around it; all of the picture where it reaches behind the eye."""
    eye_from_play = view.eye_from_world()
    # The polygon around the disc: seen from anywhere in front it holds the disc.
    corners = glass.around(PARTS, 1 / np.cos(np.pi / PARTS))
    x, y, z = eye_from_play[:3, :3] @ corners.T + eye_from_play[:3, 3:]
    width, height = view.size
    if not (-z).max() > view.near:
        return None
    if not (-z).min() > view.near:
        return 0, 0, width, height
    left, right, down, up = view.tangents
    scale = np.array([[width / (right - left)], [height / (up - down)]])
    pixels = (np.stack([x / -z, y / -z]) - np.array([[left], [down]])) * scale
    low = np.floor(pixels.min(axis=1)).astype(int) - 1
    high = np.ceil(pixels.max(axis=1)).astype(int) + 1
    low, high = low.clip(0, view.size), high.clip(0, view.size)
    if not (high > low).all():
        return None
    return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])
