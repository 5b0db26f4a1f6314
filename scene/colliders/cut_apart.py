"""Colliders of things that touch, cut along planes between them so that none is inside another.

Convex pieces reach over the hollows of their thing, into its neighbours.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.colliders.convex_parts import hull_volume

MOST_CUT = 0.25  # of a thing's volume that may be cut away for one neighbour
GAP = 1e-4  # metres that stay between two
LEAST_DEPTH = 2e-4  # metres: less is left to the physics
ROUNDS = 3  # one cut may uncover the next

Pieces = list[np.ndarray]  # convex, (V, 3) float64 metres, world


def cut_apart(things: Sequence[Pieces]) -> tuple[list[Pieces], list[tuple[int, int]]]:
    """The pieces of each thing outside of all others, and pairs that would lose more than MOST_CUT:
    they stay as they are.
    """
    found, refused = [list(pieces) for pieces in things], []
    for a, b in combinations(range(len(found)), 2):
        first, second = found[a], found[b]
        for _ in range(ROUNDS):
            first, second, cuts = cut_pair(first, second)
            if not cuts:
                break
        pair = zip((first, second), (found[a], found[b]), strict=True)
        if all(volume_of(now) >= (1 - MOST_CUT) * volume_of(was) for now, was in pair):
            found[a], found[b] = first, second
        else:
            refused.append((a, b))
    return found, refused


def volume_of(pieces: Pieces) -> float:
    """Cubic metres; what two pieces share counts twice."""
    return sum(hull_volume(piece) for piece in pieces)


def cut_pair(first: Pieces, second: Pieces) -> tuple[Pieces, Pieces, int]:
    """Both, each piece cut where it lies in one of the other thing, and how many cuts that took."""
    first, second, cuts = list(first), list(second), 0
    for i in range(len(first)):
        for j in range(len(second)):
            if not (len(first[i]) and len(second[j])):
                continue
            way, depth = least_way(first[i], second[j])
            if not depth > LEAST_DEPTH:
                continue
            middle = ((first[i] @ way).max() + (second[j] @ way).min()) / 2
            first[i] = beyond_cut(first[i], way, middle - GAP / 2)
            second[j] = beyond_cut(second[j], -way, -middle - GAP / 2)
            cuts += 1
    return [p for p in first if len(p)], [p for p in second if len(p)], cuts


def least_way(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, float]:
    """The face normal (3,) along which b leaves a first, and how far; <= 0: they are apart.

    Of all normals of both hulls (separating axes without those of pairs of edges).
    """
    from scipy.spatial import ConvexHull, QhullError

    low, high = np.maximum(a.min(0), b.min(0)), np.minimum(a.max(0), b.max(0))
    if not (low < high).all():
        return np.array([1.0, 0.0, 0.0]), 0.0
    try:
        ways = np.concatenate([ConvexHull(a).equations[:, :3], -ConvexHull(b).equations[:, :3]])
    except QhullError:  # flat: nothing is in it
        return np.array([1.0, 0.0, 0.0]), 0.0
    depths = (a @ ways.T).max(0) - (b @ ways.T).min(0)  # (N,)
    best = int(depths.argmin())
    return ways[best], float(depths[best])


def beyond_cut(points: np.ndarray, way: np.ndarray, offset: float) -> np.ndarray:
    """The corners of a convex piece where way . p <= offset; (0, 3) where nothing solid is left."""
    from scipy.spatial import ConvexHull, QhullError

    hull = ConvexHull(points)
    height = points @ way - offset
    edges = np.unique(
        np.sort(hull.simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0
    )
    across = edges[(height[edges[:, 0]] > 0) != (height[edges[:, 1]] > 0)]
    part = height[across[:, 0]] / (height[across[:, 0]] - height[across[:, 1]])
    new = points[across[:, 0]] + part[:, None] * (points[across[:, 1]] - points[across[:, 0]])
    left = np.concatenate([points[hull.vertices][height[hull.vertices] <= 0], new])
    try:
        return left[ConvexHull(left).vertices]
    except (QhullError, ValueError):
        return np.zeros((0, 3))


def apart(
    colliders: dict[int, Collider], places: dict[int, np.ndarray]
) -> tuple[dict[int, Collider], list[tuple[int, int]]]:
    """Colliders by label that stand at places (3,) metres, cut apart; pairs that could not be."""
    labels = list(colliders)
    things = [[piece + places[label] for piece in colliders[label].parts] for label in labels]
    cut, refused = cut_apart([[np.asarray(p, np.float64) for p in pieces] for pieces in things])
    found = {}
    for label, before, pieces in zip(labels, things, cut, strict=True):
        same = len(before) == len(pieces) and all(map(np.array_equal, before, pieces))
        parts = tuple((piece - places[label]).astype(np.float32) for piece in pieces)
        whole = colliders[label]
        found[label] = whole if same else Collider(parts, whole.mesh)
    return found, [(labels[a], labels[b]) for a, b in refused]
