"""The value of a place in the world, without a view: read from where its surface faces the eye."""

from collections.abc import Callable

import numpy as np

from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View, look_at

EYES = 32  # directions, spread evenly over the sphere
AWAY = 0.8  # of the scene's radius, from the place to each eye
PIXELS = 33  # a side
FOOTPRINT = 0.002  # of the scene's radius: what a pixel is wide at the place
REACH = 2  # pixels to each side, for the surface's direction
STEEPEST = 0.2  # cosine: more grazing views tell nothing of a surface
GOLDEN_ANGLE = np.pi * (3 - 5**0.5)  # radians


def value_facing(
    values_of: Callable[[View], ValuePicture], point: np.ndarray, radius: float
) -> float:
    """The value at a point (3,) metres, world, in the view of EYES that sees it most from the
    front: emission falls off at grazing angles.  NaN where none sees it.

    radius: of the scene, metres.
    """
    best, found = STEEPEST, float("nan")
    for view in eyes_around(point, radius):
        picture = values_of(view)
        value = float(picture.values_at(point[None])[0])
        if not np.isfinite(value):
            continue
        cosine = facing(picture)
        if cosine > best:
            best, found = cosine, value
    return found


def eyes_around(point: np.ndarray, radius: float) -> list[View]:
    """Small views on a point from all sides: a spiral by the golden angle."""
    distance = AWAY * radius
    side = PIXELS / 2 * FOOTPRINT * radius / distance  # tangent
    heights = 1 - 2 * (np.arange(EYES) + 0.5) / EYES
    turns = GOLDEN_ANGLE * np.arange(EYES)
    level = np.sqrt(1 - heights**2)
    directions = np.stack([level * np.sin(turns), heights, level * np.cos(turns)], axis=1)
    tangents = (-side, side, -side, side)
    return [
        View(look_at(point + distance * d, point), tangents, 0.01 * distance, 100 * distance,
             (PIXELS, PIXELS))
        for d in directions
    ]  # fmt: skip


def facing(picture: ValuePicture) -> float:
    """Cosine between the surface in the middle of a picture and the ray to it; 0: not known."""
    row, column = (side // 2 for side in picture.depth_m.shape)
    points = picture.points
    across = points[row, column + REACH] - points[row, column - REACH]
    down = points[row + REACH, column] - points[row - REACH, column]
    normal = np.cross(across, down)
    ray = points[row, column] - picture.view.world_from_eye.position
    size = float(np.linalg.norm(normal) * np.linalg.norm(ray))
    cosine = abs(float(normal @ ray)) / size if size > 0 else 0.0
    return cosine if np.isfinite(cosine) else 0.0
