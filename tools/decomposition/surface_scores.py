"""Chamfer distance, F1 and Hausdorff distance between surfaces (OWD, Table 4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.colliders.collider_pieces import hull_faces
from shapeshift.scene.colliders.triangle_mesh import sample_faces
from shapeshift.training.synthetic.tracer import Place, Solid, trace

SAMPLES = 8000  # of a proxy's surface
NEAR_M = 0.004  # metres: a point so near to the other surface is found, in F1
RAYS = 40_000  # at a thing of which the rule is known
WITHIN = 1e-4  # metres inside another piece, from which a sample is no surface


@dataclass(frozen=True)
class SurfaceScore:
    chamfer_m: float  # mean of both ways' mean distances
    f1: float  # at NEAR_M
    hausdorff_m: float


def surface_of(collider: Collider) -> np.ndarray:
    """(M, 3) points on the outside of all convex pieces together, evenly."""
    from scipy.spatial import ConvexHull

    parts = [part.astype(np.float64) for part in collider.parts]
    corners = np.concatenate([part[hull_faces(part)] for part in parts])
    of = np.repeat(np.arange(len(parts)), [len(hull_faces(part)) for part in parts])
    points, face = sample_faces(corners, SAMPLES)
    outside = np.ones(len(points), bool)
    for number, part in enumerate(parts):
        planes = ConvexHull(part).equations
        depth = (points @ planes[:, :3].T + planes[:, 3]).max(1)
        outside &= (depth > -WITHIN) | (of[face] == number)
    return points[outside]


def score_surfaces(found: np.ndarray, true: np.ndarray, near_m: float = NEAR_M) -> SurfaceScore:
    """Points (M, 3) of a proxy's surface against those (N, 3) of the true one, metres."""
    from scipy.spatial import cKDTree

    to_true = cKDTree(true).query(found, workers=1)[0]
    to_found = cKDTree(found).query(true, workers=1)[0]
    precision, recall = float((to_true < near_m).mean()), float((to_found < near_m).mean())
    f1 = 2 * precision * recall / max(precision + recall, 1e-12)
    chamfer = (to_true.mean() + to_found.mean()) / 2
    return SurfaceScore(float(chamfer), f1, float(max(to_true.max(), to_found.max())))


def surface_of_solids(solids: Sequence[Solid]) -> np.ndarray:
    """(N, 3) metres: where rays from all around first meet a thing that stands alone."""
    here = Place.of(list(solids))
    low = np.min([solid.centre - solid.shape.reach for solid in solids], axis=0)
    high = np.max([solid.centre + solid.shape.reach for solid in solids], axis=0)
    random = np.random.default_rng(0)
    radius = np.linalg.norm(high - low)
    towards = random.standard_normal((RAYS, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    start = low + random.random((RAYS, 3)) * (high - low) - 1.5 * radius * towards
    distance, index = trace(here, start, towards)
    return (start + distance[:, None] * towards)[index >= 0]
