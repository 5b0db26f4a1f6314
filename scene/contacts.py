"""What touched what, how hard and where: the engine's events of a step, summed for each pair."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Contact:
    """Two things that touched during a step; every pair is told once."""

    a: int  # id, less than b
    b: int
    impulse_n_s: float  # N s: along the normals, the sum over the step
    point: np.ndarray  # (3,) metres, world: the deepest point of the hardest substep


def gather(world: object, events: object, owner: Callable[[object], int], hardest: dict) -> None:
    """Adds one substep's impulses: pair of ids -> (their sum, the largest, where that one was)."""
    seconds = world.integration_parameters.dt
    for event in events.drain_contact_force_events():
        impulse = event.total_force_magnitude * seconds
        pair = owner(event.collider1), owner(event.collider2)
        key = pair if pair[0] < pair[1] else pair[::-1]
        total, largest, point = hardest.get(key, (0.0, -1.0, None))
        if impulse > largest:
            largest, point = impulse, touch_point(world, event, point)
        hardest[key] = total + impulse, largest, point


def touch_point(world: object, event: object, before: np.ndarray | None) -> np.ndarray:
    """(3,) metres, world: the deepest point that two colliders share."""
    position = world.colliders[event.collider1].position
    pair = world.narrow_phase.contact_pair(event.collider1, event.collider2)
    deepest = pair.find_deepest_contact() if pair else None
    if deepest is None and before is not None:
        return before
    at = position.transform_point(deepest.local_p1) if deepest else position.translation
    return np.array([at.x, at.y, at.z])
