"""A mesh whose surface touches itself, made watertight: every edge gets exactly two faces.

Merging edges pinches thin parts: then four faces meet at an edge.  The surface is still closed, so
each face's edge finds one that runs the other way; the corners are named anew along these pairs.
"""

import numpy as np

from shapeshift.scene.colliders.triangle_mesh import TriangleMesh


def stitch(mesh: TriangleMesh) -> TriangleMesh:
    """The same surface, vertices split where sheets touch.  The mesh must be closed (is_closed)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    faces = without_flaps(mesh.faces)
    half, other = paired_halves(faces)
    # Of a half edge, corner `h` is its start and `following(h)` its end; the pair runs back.
    rows = np.concatenate([half, following(half)])
    columns = np.concatenate([following(other), other])
    size = 3 * len(faces)
    graph = coo_array((np.ones(len(rows), bool), (rows, columns)), (size, size))
    count, of_corner = connected_components(graph, directed=False)
    vertices = np.empty((count, 3), np.float32)
    vertices[of_corner] = mesh.vertices[faces.reshape(-1)]
    return split_doubles(vertices, of_corner.reshape(-1, 3).astype(np.int32), half, other)


def is_closed(faces: np.ndarray) -> bool:
    """Whether as many faces (F, 3) run along every edge one way as the other."""
    if not len(faces):
        return False
    start, end = faces.reshape(-1).astype(np.int64), faces[:, [1, 2, 0]].reshape(-1)
    most = int(faces.max()) + 1
    return np.array_equal(np.sort(start * most + end), np.sort(end * most + start))


def is_watertight(faces: np.ndarray) -> bool:
    """Whether every edge has two faces (F, 3), which run along it in opposite ways."""
    start, end = faces.reshape(-1).astype(np.int64), faces[:, [1, 2, 0]].reshape(-1)
    along = start * (int(faces.max(initial=0)) + 1) + end
    return is_closed(faces) and len(np.unique(along)) == len(along)


def following(corner: np.ndarray) -> np.ndarray:
    """The next corner of the same face; corners count 3 a face."""
    return corner - corner % 3 + (corner + 1) % 3


def without_flaps(faces: np.ndarray) -> np.ndarray:
    """(F, 3) without faces that have a vertex twice or lie on one that looks the other way."""
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    order = np.sort(faces, axis=1)
    a, b, c = faces.astype(np.int64).T
    turns = np.sign(b - a) * np.sign(c - b) * np.sign(a - c) < 0  # an even order of the vertices
    _, name, count = np.unique(order, axis=0, return_inverse=True, return_counts=True)
    name, kept = name.reshape(-1), np.ones(len(faces), bool)
    for which in np.flatnonzero(count > 1):
        rows = np.flatnonzero(name == which)
        one, back = rows[turns[rows]], rows[~turns[rows]]
        both = min(len(one), len(back))
        kept[one[:both]] = kept[back[:both]] = False
    return faces[kept]


def paired_halves(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(E,) half edges, by their first corner, from the lower vertex, and the ones that run back."""
    start, end = faces.reshape(-1).astype(np.int64), faces[:, [1, 2, 0]].reshape(-1)
    key = np.minimum(start, end) * (int(faces.max(initial=0)) + 1) + np.maximum(start, end)
    ahead, back = np.flatnonzero(start < end), np.flatnonzero(start > end)
    ahead = ahead[np.argsort(key[ahead], kind="stable")]
    return ahead, back[np.argsort(key[back], kind="stable")]


def split_doubles(
    vertices: np.ndarray, faces: np.ndarray, half: np.ndarray, other: np.ndarray
) -> TriangleMesh:
    """A vertex in the middle of every edge that another edge has both ends in common with."""
    names = faces.reshape(-1)
    ends = np.sort(np.stack([names[half], names[following(half)]], 1), axis=1)
    _, first = np.unique(ends, axis=0, return_index=True)
    doubles = np.setdiff1d(np.arange(len(half)), first)
    middle, more = np.full(3 * len(faces), -1), []
    for number, edge in enumerate(doubles):
        more.append((vertices[ends[edge, 0]] + vertices[ends[edge, 1]]) / 2)
        middle[[half[edge], other[edge]]] = len(vertices) + number
    kept: list = []
    added: list[np.ndarray] = []
    for face, on_edges in zip(faces, middle.reshape(-1, 3), strict=True):
        if (on_edges < 0).all():
            kept.append(face)
            continue
        ring = [n for pair in zip(face, on_edges, strict=True) for n in pair if n >= 0]
        centre = len(vertices) + len(doubles) + len(added)  # a fan from within: no flat triangle
        added.append(vertices[face].mean(0))
        kept += [(a, b, centre) for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]
    every = np.array([*vertices, *more, *added], np.float32).reshape(-1, 3)
    return TriangleMesh(every, np.array(kept, np.int32).reshape(-1, 3))
