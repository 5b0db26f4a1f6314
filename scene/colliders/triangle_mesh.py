"""A plain triangle mesh: what colliders are made of and what a debug view draws of them."""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.shapes import check


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
