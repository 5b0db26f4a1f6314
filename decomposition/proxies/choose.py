"""Candidates for an object's proxy, and which of them its silhouettes prefer (OWD, section 3.5)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.decomposition.completion.plane import Plane
from shapeshift.decomposition.partition import LabelledView
from shapeshift.decomposition.proxies.silhouettes import SilhouetteScore, score_silhouettes
from shapeshift.decomposition.proxies.standing import pressed
from shapeshift.scene.colliders.collider import Collider, Making, collider_of_mesh
from shapeshift.scene.colliders.convex_parts import cut_into_parts, hull_volume
from shapeshift.scene.colliders.primitives import SHAPES, collider_of_shape
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh

PIECES = "hulls"  # CoACD's: the name of that candidate
LIMIT_S = 120.0  # for CoACD, on a machine that is busy with photos
AS_GOOD = 0.02  # of IoU below the best, at which a candidate of fewer corners is taken
LEAST_RECALL = 0.85  # below, a proxy does not cover its object


@dataclass(frozen=True)
class Proxy:
    name: str
    collider: Collider
    score: SilhouetteScore

    @property
    def corners(self) -> int:
        """Of all pieces: what the physics pays for."""
        return sum(len(part) for part in self.collider.parts)


def candidates_of(
    mesh: TriangleMesh, plane: Plane | None, making: Making, given: Path | None = None
) -> dict[str, Collider]:
    """Colliders by name: CoACD's pieces, one hull, the primitives, and a mesh file of the user's.

    mesh: the object's, as standing_mesh() makes it; plane: on which it stands, in the same frame.
    Raises BadFile for a mesh file that cannot be used.
    """
    parts, _ = cut_into_parts(mesh, making.most_parts, making.report, LIMIT_S)
    if plane is not None:
        parts = tuple(part for part in pressed(parts, plane) if hull_volume(part) > 0)
    found = {PIECES: Collider(parts, mesh)}
    up = (0.0, 1.0, 0.0) if plane is None else plane.normal
    found |= {shape: collider_of_shape(mesh, shape, up) for shape in SHAPES}
    if given is not None:
        found[given.name] = collider_of_mesh(given, making)
    return found


def choose_proxy(
    candidates: dict[str, Collider],
    world_from_part: np.ndarray,
    label: int,
    views: Sequence[LabelledView],
) -> tuple[Proxy, list[Proxy]]:
    """The candidate with the fewest corners of those as good as the best; all, best first.

    A proxy has to cover the object, LEAST_RECALL of it.  The first one where no view shows it.
    """
    scored = [
        Proxy(name, collider, score_silhouettes(collider, world_from_part, label, views))
        for name, collider in candidates.items()
    ]
    if not any(proxy.score.views for proxy in scored):
        return scored[0], scored
    covering = [p for p in scored if p.score.recall >= LEAST_RECALL] or scored
    iou = max(proxy.score.iou for proxy in covering)
    as_good = [p for p in covering if p.score.iou >= iou - AS_GOOD]
    best = min(as_good, key=lambda proxy: proxy.corners)
    return best, sorted(scored, key=lambda proxy: -proxy.score.iou)
