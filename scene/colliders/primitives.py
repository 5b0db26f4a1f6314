"""A hull, box, cylinder, sphere or capsule around a mesh, as one convex piece: cheaper than pieces.

Boxes and cylinders stand upright: one of their axes is +Y, or the axis that is given.
"""

import numpy as np

from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.colliders.collider_pieces import hull_faces
from shapeshift.scene.colliders.convex_parts import corners, in_float32, thick
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh

SHAPES = ("hull", "box", "cylinder", "sphere", "capsule")
AROUND = 24  # corners of a cylinder's base
RINGS = 3  # of corners on each end of a capsule, and its tip
UP = (0.0, 1.0, 0.0)
THINNEST = 0.01  # of the longest side, that a piece is thick
OUTERMOST = 99.0  # percent of the mesh's corners that a round shape holds: single ones are noise


def collider_of_shape(mesh: TriangleMesh, shape: str, up: np.ndarray | tuple = UP) -> Collider:
    """The mesh's collider as one of SHAPES; up (3,): the axis that boxes and cylinders keep."""
    points = mesh.vertices.astype(np.float64)
    points = thick(points, THINNEST * float(np.ptp(points, axis=0).max()))
    make = {"box": box, "cylinder": cylinder, "sphere": sphere, "capsule": capsule}
    found = corners(points) if shape == "hull" else make[shape](points, frame_of(up))
    part = in_float32(found)
    return Collider((part,), TriangleMesh(part, hull_faces(part)))


def frame_of(up: np.ndarray | tuple) -> np.ndarray:
    """(3, 3) rows: two axes at right angles to `up`, and `up` as the middle one."""
    y = np.asarray(up, np.float64) / np.linalg.norm(up)
    x = np.cross(y, (0.0, 0.0, 1.0) if abs(y[2]) < 0.9 else (1.0, 0.0, 0.0))
    x /= np.linalg.norm(x)
    return np.stack([x, y, np.cross(x, y)])


def box(points: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """(8, 3): the smallest upright box around the points (N, 3)."""
    from trimesh.bounds import oriented_bounds_2D

    local = points @ frame.T
    flat_from_plane, size = oriented_bounds_2D(local[:, [0, 2]])
    back = np.linalg.inv(flat_from_plane)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2
    flat = signs @ back[:2, :2].T + back[:2, 2]
    heights = local[:, 1].min(), local[:, 1].max()
    return np.concatenate([upright(flat, height) for height in heights]) @ frame


def cylinder(points: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """(2 AROUND, 3): an upright cylinder around nearly all of the points (N, 3)."""
    local = points @ frame.T
    flat = local[:, [0, 2]]
    low, high = np.percentile(flat, (100 - OUTERMOST, OUTERMOST), axis=0)
    middle = (low + high) / 2
    radius = np.percentile(np.linalg.norm(flat - middle, axis=1), OUTERMOST)
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    ring = middle + radius * np.stack([np.cos(turn), np.sin(turn)], 1)
    return (
        np.concatenate([upright(ring, h) for h in (local[:, 1].min(), local[:, 1].max())]) @ frame
    )


def upright(flat: np.ndarray, height: float) -> np.ndarray:
    """(n, 3) of points (n, 2) beside the middle axis, at a height along it."""
    return np.stack([flat[:, 0], np.full(len(flat), height), flat[:, 1]], 1)


def sphere(points: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """(42, 3): a ball around nearly all of the points (N, 3)."""
    from trimesh.creation import icosphere

    low, high = np.percentile(points, (100 - OUTERMOST, OUTERMOST), axis=0)
    middle = (low + high) / 2
    radius = np.percentile(np.linalg.norm(points - middle, axis=1), OUTERMOST)
    return middle + radius * icosphere(subdivisions=1).vertices @ frame


def capsule(points: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """A rod with round ends along the points' longest axis; `frame` is not asked."""
    del frame
    middle = points.mean(0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2]  # rows, longest first
    local = (points - middle) @ axes.T
    across = np.percentile(local[:, 1:], (100 - OUTERMOST, OUTERMOST), axis=0).mean(0)
    radius = np.percentile(np.linalg.norm(local[:, 1:] - across, axis=1), OUTERMOST)
    ends = local[:, 0].min(), local[:, 0].max()
    turn = 2 * np.pi * np.arange(8) / 8
    rings = []
    for end, way in zip(ends, (-1.0, 1.0), strict=True):
        centre = end - way * min(radius, (ends[1] - ends[0]) / 2)
        for lift in np.linspace(0, np.pi / 2, RINGS + 1)[:-1]:
            around = radius * np.cos(lift) * np.stack([np.cos(turn), np.sin(turn)], 1)
            along = np.full(len(turn), centre + way * radius * np.sin(lift))
            rings.append(np.column_stack([along, around + across]))
        rings.append(np.array([[centre + way * radius, *across]]))
    return np.concatenate(rings) @ axes + middle
