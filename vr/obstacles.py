"""Whether the head is at what stands in the scene: the picture darkens, for nobody can be there.

By the same bodies on which one stands and which hands touch: what does not move, and not the floor.
"""

import math
from dataclasses import dataclass

import numpy as np

from shapeshift.scene.world.world import FLOOR_NAME, World

BEGINS_M, WHOLE_M = 0.10, 0.03  # of the room, from between the eyes: darkens, is darkest
JUMP_M = 0.3  # of the room, in a frame: nobody walks so fast, they were put there
MOST = 0.96  # a trace of the scene says where it is
# (14, 3) length 1: to the faces and the corners of a cube.
WAYS = np.array(
    [way / np.linalg.norm(way) for way in
     (*np.eye(3), *-np.eye(3), *(np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T))]
)  # fmt: skip


@dataclass(frozen=True)
class Sight:
    """Between two frames."""

    place: np.ndarray | None = None  # (3,) metres of the world, of the head
    scale: float = 1.0
    free: bool = False  # the head was away from all of it since the person was put here
    dark: float = 0.0  # 0..1


def look(sight: Sight, world: World, place: np.ndarray, scale: float) -> Sight:
    """With the head at a place (3,) of the world; scale: metres of it a metre of the room.

    Who was put into something, at the start, by a jump or by another size of the world, sees: they
    are not left in the dark.
    """
    away_m = nearest_wall(world, place, BEGINS_M * scale) / scale
    walked = (
        sight.place is not None
        and scale == sight.scale
        and float(np.linalg.norm(place - sight.place)) < JUMP_M * scale
    )
    free = away_m >= BEGINS_M or (sight.free and walked)
    part = (BEGINS_M - away_m) / (BEGINS_M - WHOLE_M) if free else 0.0
    return Sight(place, scale, free, MOST * min(max(part, 0.0), 1.0))


def nearest_wall(world: World, place: np.ndarray, within_m: float) -> float:
    """Metres of the world to what does not move, 0 inside of it; inf beyond within_m."""
    nearest = math.inf
    for way in WAYS if np.isfinite(place).all() else ():
        hit = world.aim(place, way)
        if hit is None or hit.distance_m > within_m or hit.object == FLOOR_NAME:
            continue
        if not (hit.object in world.objects and world.objects[hit.object].moves):
            nearest = min(nearest, hit.distance_m)
    return nearest
