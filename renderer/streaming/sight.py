"""Which leaves a view holds, how much of the picture each covers, how far away it is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.leaf_levels import LeafLevels
from shapeshift.scene.pose import Pose, View

WIDER = math.radians(10)  # on each side: what comes into sight next
TAIL = 0.15  # of a box's half sides: splats may reach out of the box of their leaf
BLUR = 0.02  # tangent: and out of the picture's edge
WIDEST = math.radians(80)  # from straight on; wider pictures have no tangents


@dataclass(frozen=True)
class LeafSight:
    """Of leaves."""

    held: np.ndarray  # (L,) bool: a view may show it
    wide: np.ndarray  # (L,) bool: so may a view WIDER on each side
    cover: np.ndarray  # (L,) pixels that its box covers, if nothing hides it
    distance: np.ndarray  # (L,) metres from the eye to its box


def sight_of(
    levels: LeafLevels, world_from_objects: np.ndarray, views: Sequence[View]
) -> LeafSight:
    """In any of the views, of n copies one after the other; world_from_objects (n, 4, 4), rigid."""
    middle, half = (levels.high + levels.low) / 2, (levels.high - levels.low) / 2
    shape = (len(world_from_objects), len(middle))
    held, wide = np.zeros(shape, bool), np.zeros(shape, bool)
    cover, distance = np.zeros(shape), np.full(shape, np.inf)
    radius = np.linalg.norm(half, axis=1)
    for view in views:
        eye_from_objects = view.eye_from_world() @ world_from_objects
        held |= _inside(middle, half, eye_from_objects, view.tangents, view.near)
        wide |= _inside(middle, half, eye_from_objects, wider(view.tangents), 0.0)
        eyes = np.linalg.inv(eye_from_objects)[:, None, :3, 3]
        away = np.linalg.norm(np.maximum(np.abs(eyes - middle) - half, 0), axis=2)
        distance = np.minimum(distance, away)
        focal = view.size[0] / (view.tangents[1] - view.tangents[0])
        pixels = (focal * radius / np.maximum(away, 0.3 * radius + view.near)) ** 2
        cover = np.maximum(cover, np.minimum(pixels, view.size[0] * view.size[1]))
    return LeafSight(*(each.ravel() for each in (held, wide | held, cover, distance)))


def _inside(
    middle: np.ndarray, half: np.ndarray, eye_from_objects: np.ndarray, tangents: tuple, near: float
) -> np.ndarray:
    """(n, L) bool: boxes that are not wholly outside of one side of a view's pyramid."""
    turns, shifts = eye_from_objects[:, :3, :3], eye_from_objects[:, :3, 3]
    left, right, down, up = tangents
    out = BLUR
    planes = np.array([  # a point in the eye's axes is inside where the product is above 0
        (-1, 0, -(right + out)), (1, 0, left - out), (0, -1, -(up + out)), (0, 1, down - out),
        (0, 0, -1),
    ])  # fmt: skip
    in_objects = np.swapaxes(planes @ turns, 1, 2)  # (n, 3, 5)
    place = middle @ in_objects + (shifts @ planes.T)[:, None]  # (n, L, 5)
    reach = (1 + TAIL) * half @ np.abs(in_objects)
    return np.asarray((place + reach > np.array([0, 0, 0, 0, near])).all(axis=2))


def wider(tangents: tuple, angle: float = WIDER) -> tuple[float, float, float, float]:
    """Tangents so many radians wider on each side."""
    angles = [math.atan(tangent) for tangent in tangents]
    left, right, down, up = (
        math.tan(min(max(a + way * angle, -WIDEST), WIDEST))
        for a, way in zip(angles, (-1, 1, -1, 1), strict=True)
    )
    return left, right, down, up


def look_view(views: Sequence[View], part: int) -> View:
    """One view that holds all of these and WIDER on each side, with 1 / part of the pixels a side:
    from the middle of the eyes, turned as the first.
    """
    first = views[0]
    ends = np.array([view.tangents for view in views])
    whole = (ends[:, 0].min(), ends[:, 1].max(), ends[:, 2].min(), ends[:, 3].max())
    tangents = wider(whole)
    left, right, down, up = first.tangents
    across = first.size[0] / (right - left) / part
    below = first.size[1] / (up - down) / part
    size = (
        max(round((tangents[1] - tangents[0]) * across), 1),
        max(round((tangents[3] - tangents[2]) * below), 1),
    )
    middle = np.mean([view.world_from_eye.position for view in views], axis=0)
    pose = Pose(middle, first.world_from_eye.wxyz)
    return replace(
        first, world_from_eye=pose, tangents=tangents, size=size, whole=None, hidden=None, gaze=None
    )
