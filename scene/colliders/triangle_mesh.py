"""A plain triangle mesh: what colliders are made of and what a debug view draws of them."""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import check

MOST_FACES = 2_000_000  # of a file


@dataclass(frozen=True)
class TriangleMesh:
    vertices: np.ndarray  # (V, 3) float32 metres, object frame
    faces: np.ndarray  # (F, 3) int32 rows of vertices, anticlockwise seen from outside

    def __post_init__(self) -> None:
        """Refuses what is no mesh: ValueError with a sentence."""
        check(vertices=(self.vertices, "V 3"))
        if self.faces.ndim != 2 or self.faces.shape[1] != 3 or self.faces.dtype != np.int32:
            raise ValueError(
                f"a mesh has faces {self.faces.shape} {self.faces.dtype}; (F, 3) int32 is wanted."
            )
        if self.faces.size and not 0 <= self.faces.min() <= self.faces.max() < len(self.vertices):
            raise ValueError(
                f"a mesh has faces of vertices {self.faces.min()} to {self.faces.max()}; there are "
                f"{len(self.vertices)} vertices, counted from 0."
            )


def joined(vertices: np.ndarray, faces: np.ndarray, name: str) -> TriangleMesh:
    """The mesh with equal vertices joined and faces of no area left out.  Raises BadFile."""
    if len(faces) > MOST_FACES:
        raise BadFile(f"{name} has {len(faces):,} faces; {MOST_FACES:,} at most, simplify it.")
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise BadFile(f"{name} has faces of vertices that it does not have; it is damaged.")
    with np.errstate(over="ignore"):
        vertices = np.asarray(vertices, np.float32)
    if not np.isfinite(vertices[faces]).all():
        raise BadFile(f"{name} has vertices that are NaN or Inf; repair it.")
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    vertices, same = unique_rows(vertices[used] + np.float32(0))  # -0 is 0
    faces = same[np.cumsum(used, dtype=np.int32)[faces] - 1]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if not len(faces):
        raise BadFile(f"{name} has no triangles; a collider needs some.")
    if not 0 < np.ptp(vertices, axis=0).max() < 1e6:
        raise BadFile(
            f"{name} is {np.ptp(vertices, axis=0).max():.3g} m long; below 1000 km, please."
        )
    return TriangleMesh(vertices, faces)


def unique_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(U, 3) in the order of x, y, z, and the row there of each of (N, 3), int32.

    As np.unique(axis=0) does, in a fifth of its time.
    """
    order = np.lexsort(rows.T[::-1])
    rows = rows[order]
    first = np.ones(len(rows), bool)
    first[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    same = np.empty(len(rows), np.int32)
    same[order] = np.cumsum(first, dtype=np.int32) - 1
    return rows[first], same


def separate(mesh: TriangleMesh) -> list[TriangleMesh]:
    """The parts of a mesh that share no vertex, largest first by faces."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b = mesh.faces[:, [0, 1, 2]].reshape(-1), mesh.faces[:, [1, 2, 0]].reshape(-1)
    size = len(mesh.vertices)
    graph = coo_array((np.ones(len(a), bool), (a, b)), (size, size))
    of_vertex = connected_components(graph, directed=False)[1]
    of_face = of_vertex[mesh.faces[:, 0]]
    names, counts = np.unique(of_face, return_counts=True)
    found = []
    for name in names[np.argsort(-counts, kind="stable")]:
        used, rows = np.unique(mesh.faces[of_face == name], return_inverse=True)
        found.append(TriangleMesh(mesh.vertices[used], rows.reshape(-1, 3).astype(np.int32)))
    return found


def sample_faces(corners: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """About `count` points (n, 3) over triangles (F, 3, 3), always the same, and their faces."""
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    total = np.cumsum(areas)
    face = np.searchsorted(total, (np.arange(count) + 0.5) / count * total[-1])
    face = np.minimum(face, len(corners) - 1)
    part = np.random.default_rng(0).random((count, 2))  # the seed is part of the result
    root = np.sqrt(part[:, :1])
    weights = np.concatenate([1 - root, root * (1 - part[:, 1:]), root * part[:, 1:]], 1)
    every = np.concatenate([np.einsum("nk,nki->ni", weights, corners[face]), corners.mean(1)])
    return every, np.concatenate([face, np.arange(len(corners))])
