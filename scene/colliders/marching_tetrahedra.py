"""The zero surface of a field on a grid, closed and without seams: marching tetrahedra.

Every cell is cut into six tetrahedra along its diagonal (Kuhn's cut, which fits that of the cells
beside).  Unlike marching cubes no case is ambiguous, so every edge has exactly two faces.
"""

from functools import cache
from itertools import permutations

import numpy as np

from shapeshift.scene.colliders.triangle_mesh import TriangleMesh

LEAST_PART = 0.02  # of an edge, between a vertex and either end: no two vertices coincide


def find_surface(field: np.ndarray) -> TriangleMesh:
    """The surface between what is below 0 and the rest of a field (X, Y, Z), in cells.

    The field must be positive all around its border, or the surface is open there.
    """
    inside = field < 0
    cells = crossing_cells(inside)  # (C, 3)
    shape = np.array(field.shape)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    first = cells @ strides  # (C,) the lowest corner of each
    steps = (np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)]) @ strides).tolist()
    flat, triangles = inside.reshape(-1), []
    for corners, table in six_tetrahedra():
        code = sum(flat[first + steps[corner]].astype(np.int8) << n
                   for n, corner in enumerate(corners))  # fmt: skip
        for case, faces in table.items():
            rows = first[code == case]
            for face in faces:  # three edges (low corner, high corner)
                keys = [(rows + steps[low]) * 8 + (high - low) for low, high in face]
                triangles.append(np.stack(keys, 1))
    every = np.concatenate(triangles) if triangles else np.zeros((0, 3), np.int64)
    edges, corner_of = np.unique(every, return_inverse=True)
    return TriangleMesh(places(field, edges, steps), corner_of.reshape(-1, 3).astype(np.int32))


def crossing_cells(inside: np.ndarray) -> np.ndarray:
    """(C, 3) lowest corners of the cells with corners both inside and outside."""
    some, every = inside.copy(), inside.copy()
    for axis in range(3):
        low, high = [slice(None)] * 3, [slice(None)] * 3
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        some = some[tuple(low)] | some[tuple(high)]
        every = every[tuple(low)] & every[tuple(high)]
    return np.argwhere(some & ~every)


def places(field: np.ndarray, edges: np.ndarray, steps: list[int]) -> np.ndarray:
    """(V, 3) float32 where the field is 0 on each edge, `low corner * 8 + which`."""
    low, which = edges >> 3, edges & 7
    values = field.reshape(-1)
    at_low, at_high = values[low], values[low + np.array(steps)[which]]
    part = np.clip(at_low / (at_low - at_high), LEAST_PART, 1 - LEAST_PART)
    toward = np.stack([which >> 2 & 1, which >> 1 & 1, which & 1], 1)
    corner = np.stack(np.unravel_index(low, field.shape), 1)
    return (corner + part[:, None] * toward).astype(np.float32)


@cache
def six_tetrahedra() -> list[tuple[tuple[int, ...], dict[int, list]]]:
    """The corners (bits xyz) of each, and for each set of corners inside the faces' edges."""
    found: list[tuple[tuple[int, ...], dict[int, list]]] = []
    for order in permutations((4, 2, 1)):
        corners = (0, order[0], order[0] + order[1], 7)
        found.append((corners, {case: cut(corners, case) for case in range(1, 15)}))
    return found


def cut(corners: tuple[int, ...], case: int) -> list[list[tuple[int, int]]]:
    """The faces that part the corners inside (bits of case) from the others, seen from outside."""
    inner = [c for n, c in enumerate(corners) if case >> n & 1]
    outer = [c for n, c in enumerate(corners) if not case >> n & 1]
    if len(inner) == 2:
        (a, b), (c, d) = inner, outer
        faces = [[(a, c), (a, d), (b, d)], [(a, c), (b, d), (b, c)]]
    else:
        faces = [[(a, c) for a in inner for c in outer]]
    place = {c: np.array([c >> 2 & 1, c >> 1 & 1, c & 1], float) for c in corners}
    outward = np.mean([place[c] for c in outer], 0) - np.mean([place[c] for c in inner], 0)
    turned = []
    for face in faces:
        p, q, r = ((place[a] + place[c]) / 2 for a, c in face)
        face = face if np.cross(q - p, r - p) @ outward > 0 else face[::-1]
        turned.append([(min(edge), max(edge)) for edge in face])
    return turned
