"""Where a thrown arc comes down: points in the room, a landing, and whether one can stand there."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.locomotion.play_space import PlaySpace

SPEED = 6.0  # m/s of the room at which the arc leaves the hand: 3.7 m far on level ground, and more
FALL = 9.81  # m/s2
STEP_S, STEPS = 0.05, 40  # of the arc
SLIVER = 0.02  # metres: from so far above a floor is looked for where a wall was met

# ground(start, end), (3,) metres of the world each -> (point, can be stood on), or None
Ground = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, bool] | None]


@dataclass(frozen=True)
class Arc:
    """What is drawn while one aims."""

    points: np.ndarray  # (n, 3) metres, room
    landing: np.ndarray | None  # (3,) metres, room
    fine: bool  # one can stand there


def level_ground(floor_y: float) -> Ground:
    """An endless floor in the world."""

    def ground(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, bool] | None:
        if not start[1] >= floor_y > end[1]:
            return None
        part = (start[1] - floor_y) / (start[1] - end[1])
        return start + part * (end - start), True

    return ground


def ground_of(world, level_y: float | None = None) -> Ground:
    """What does not move in a scene.world.World, and a level where that has no floor.

    At a wall one lands at its foot; on what can be carried away nobody stands.
    """
    level = level_ground(level_y) if level_y is not None else None

    def ground(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, bool] | None:
        way = end - start
        length = float(np.linalg.norm(way))
        hit = world.aim(start, way) if length > 0 else None
        if hit is None or hit.distance_m > length:
            return level(start, end) if level else None
        above = hit.point - way / length * SLIVER + [0.0, SLIVER, 0.0]
        below = world.aim(above, np.array([0.0, -1.0, 0.0]))
        if below is None:
            return hit.point, False
        stands = all(
            met.object not in world.objects or not world.objects[met.object].moves
            for met in (hit, below)
        )
        return below.point, stands

    return ground


def throw_arc(aim: Pose, play_space: PlaySpace, ground: Ground) -> Arc:
    """The arc of a hand that aims."""
    along = -aim.matrix()[:3, 2]
    if not math.isfinite(float(along.sum())):
        return Arc(aim.position[None], None, False)
    seconds = np.arange(STEPS + 1)[:, None] * STEP_S
    points = aim.position + along * SPEED * seconds  # (n, 3) metres, room
    points[:, 1] -= FALL / 2 * seconds[:, 0] ** 2
    room = play_space.world_from_play
    world = room.position + play_space.scale * points @ room.matrix()[:3, :3].T  # (n, 3)
    for number in range(STEPS):
        met = ground(world[number], world[number + 1])
        if met is not None:
            landing = _into_room(play_space, met[0])
            return Arc(np.vstack([points[: number + 1], landing]), landing, met[1])
    return Arc(points, None, False)


def _into_room(play_space: PlaySpace, world: np.ndarray) -> np.ndarray:
    room = play_space.world_from_play
    return room.matrix()[:3, :3].T @ (world - room.position) / play_space.scale
