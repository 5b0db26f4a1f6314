"""A static triangle mesh made a solid: an open sheet gets a back, so that each place has an inside.

A sheet without thickness pushes a corner that got through out on its far side.
"""

import numpy as np

THICKNESS = 0.02  # metres, behind the faces: a table top's


def thickened(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """(V', 3) float32, (F', 3) uint32, and whether that is a solid whose faces look outward.

    vertices (V, 3) metres, faces (F, 3), anticlockwise seen from outside.  A closed mesh stays as
    it is, turned outward; an open one gets a back THICKNESS behind it and a rim.  Where faces are
    wound both ways there is no behind: the mesh comes back as it was, and False.
    """
    points, row = np.unique(vertices, axis=0, return_inverse=True)  # seams in files are cuts
    f = row.reshape(-1)[faces].astype(np.int64)  # (F, 3)
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
    edges = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])  # (3F, 2), directed
    code = edges[:, 0] * len(points) + edges[:, 1]
    if len(np.unique(code)) < len(code):
        return vertices, faces.astype(np.uint32), False
    rim = edges[~np.isin(code, edges[:, 1] * len(points) + edges[:, 0])]  # (R, 2)
    corners = points[f].astype(np.float64)  # (F, 3, 3)
    if not len(rim):
        volume = np.linalg.det(corners - points.mean(axis=0)).sum()
        return points, (f if volume > 0 else f[:, ::-1]).astype(np.uint32), True
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # (F, 3)
    normals = np.zeros(points.shape)
    for corner in range(3):
        np.add.at(normals, f[:, corner], across)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    back = points - THICKNESS * normals / np.maximum(lengths, 1e-30)
    a, b = rim[:, 0], rim[:, 1]
    a_back, b_back = a + len(points), b + len(points)
    sides = np.concatenate([np.stack([b, a, a_back], 1), np.stack([b, a_back, b_back], 1)])
    solid = np.concatenate([f, f[:, ::-1] + len(points), sides])
    return np.concatenate([points, back]).astype(np.float32), solid.astype(np.uint32), True
