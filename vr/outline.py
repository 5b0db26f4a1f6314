"""The outline of what a hand would take or its ray would act on, as lines in the room.

An object's convex hull seen from the head: edges between faces that are turned to it and away.
"""

import math
from dataclasses import dataclass

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.scene.world.world import FLOOR_NAME, World
from shapeshift.vr.glove import Capsule
from shapeshift.vr.play_space import PlaySpace

AWAY_M = 0.004  # of the room, from the hull: lines beside what they are around
THICK_M = 0.0028  # radius
BY_HAND, BY_RAY = (0.96, 0.66, 0.30, 0.95), (0.92, 0.93, 0.96, 0.8)  # display sRGB, opacity


@dataclass(frozen=True)
class Hull:
    """A convex hull in its object's frame."""

    points: np.ndarray  # (V, 3) metres
    outward: np.ndarray  # (V, 3) of length 1, from the middle
    edges: np.ndarray  # (E, 2) rows of points
    faces: np.ndarray  # (E, 2) rows of planes, on both sides of each edge
    planes: np.ndarray  # (F, 4) normal, offset: normal @ point + offset <= 0 inside


class Outlines:
    """Hulls by the collider that they are of; each is made once."""

    def __init__(self) -> None:
        self._hulls: dict[int, tuple[object, Hull | None]] = {}

    def hull(self, collider) -> Hull | None:
        """None where there is nothing to go around: no collider, or one that is flat."""
        if collider is None:
            return None
        key = id(collider)
        if key not in self._hulls:
            self._hulls[key] = collider, hull_of(np.concatenate(collider.parts))
        return self._hulls[key][1]


def hull_of(points: np.ndarray) -> Hull | None:
    """The convex hull of points (N, 3); None where they have no volume."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(np.asarray(points, np.float64))
    except (QhullError, ValueError):
        return None
    corners, faces = found.simplices, np.arange(len(found.simplices))
    sides = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    order = np.lexsort(np.sort(sides, axis=1).T)
    sides, owners = np.sort(sides, axis=1)[order], np.tile(faces, 3)[order]
    pairs = sides.reshape(-1, 2, 2)  # each edge is of two faces, which lie beside each other now
    if not (pairs[:, 0] == pairs[:, 1]).all():
        return None
    used, edges = np.unique(pairs[:, 0], return_inverse=True)
    kept = found.points[used]
    away = kept - kept.mean(axis=0)
    outward = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12)
    return Hull(kept, outward, edges.reshape(-1, 2), owners.reshape(-1, 2), found.equations)


def outline(
    hull: Hull, world_from_object: Pose, play_space: PlaySpace, eye: np.ndarray, color: tuple
) -> list[Capsule]:
    """Lines around a hull as an eye (3,) of the room sees it; metres of the room."""
    to_world = world_from_object.matrix()
    room = play_space.world_from_play
    to_room = room.matrix()[:3, :3].T / play_space.scale
    seen_from = to_world[:3, :3].T @ (play_space.point(eye) - to_world[:3, 3])  # object frame
    turned_to = hull.planes[:, :3] @ seen_from + hull.planes[:, 3] > 0
    rim = turned_to[hull.faces[:, 0]] != turned_to[hull.faces[:, 1]]
    points = hull.points + hull.outward * (AWAY_M * play_space.scale)
    world = points @ to_world[:3, :3].T + to_world[:3, 3]
    places = (world - room.position) @ to_room.T
    return [Capsule(places[a], places[b], (THICK_M, THICK_M), color) for a, b in hull.edges[rim]]


# Whether the head is at what stands in the scene: the picture darkens, for nobody can be there.
#
# By the same bodies on which one stands and which hands touch: what does not move, and not the
# floor.

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
