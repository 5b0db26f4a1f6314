"""Taking hold of the world: one hand draws it along, two turn and stretch it as well.

Each hand pins a point of the world to itself; one is kept exactly, of two the middle, the
direction seen from above and the distance.
"""

import math

import numpy as np

from shapeshift.vr.frame import Frame, grip_of
from shapeshift.vr.locomotion.play_space import PlaySpace
from shapeshift.vr.locomotion.stance import pinned, scaled, turned

LEAST_APART = 0.05  # metres between two hands: nearer, their distance and direction say nothing

Grips = tuple[tuple[str, np.ndarray], ...]  # side, (3,) metres of the world that it holds


def held_points(play_space: PlaySpace, frame: Frame, sides: frozenset[str]) -> Grips:
    """What these hands hold now."""
    return tuple(
        (side, play_space.point(grip_of(frame.hands[side]).position)) for side in sorted(sides)
    )


def drawn_along(play_space: PlaySpace, frame: Frame, grips: Grips) -> PlaySpace:
    """The standing in which the hands hold what they took."""
    here = [grip_of(frame.hands[side]).position for side, _ in grips]  # (3,) metres, room
    there = [world for _, world in grips]
    if len(grips) == 1:
        return pinned(play_space, here[0], there[0])
    middle = (here[0] + here[1]) / 2
    apart, apart_world = here[1] - here[0], there[1] - there[0]
    length = float(np.linalg.norm(apart))
    if length >= LEAST_APART:
        play_space = scaled(play_space, float(np.linalg.norm(apart_world)) / length, middle)
    across, across_world = (math.hypot(v[0], v[2]) for v in (apart, apart_world))
    if across >= LEAST_APART and across_world >= LEAST_APART * play_space.scale:
        now = play_space.world_from_play.matrix()[:3, :3] @ apart
        angle = _bearing(apart_world) - _bearing(now)
        play_space = turned(play_space, math.remainder(angle, math.tau), middle)
    return pinned(play_space, middle, (there[0] + there[1]) / 2)


def _bearing(direction: np.ndarray) -> float:
    """Radians about up."""
    return math.atan2(direction[0], direction[2])
