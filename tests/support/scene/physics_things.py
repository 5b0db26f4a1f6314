"""Shapes and checks that the tests and the benchmark of the physics share."""

import numpy as np

from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.pose import Pose
from shapeshift.scene.world.physics import Physics

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
PLATE = (0.1, 0.001, 0.07)  # metres, half: a plate 2 mm thick


def at(x: float, y: float, z: float, wxyz: object = UPRIGHT) -> Pose:
    """A pose of plain numbers."""
    return Pose(np.array([x, y, z], np.float64), np.array(wxyz, np.float64))


BOX_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]], np.int32
)  # fmt: skip


def box(x: float, y: float, z: float) -> np.ndarray:
    """(8, 3) float32 corners of a box with these halves, metres."""
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    return (signs * (x, y, z)).astype(np.float32)


def cup(pieces: int = 8, size: float = 0.06) -> list[np.ndarray]:
    """A ring of convex staves around +Y and a bottom, `pieces` hulls in all; concave as a whole."""
    hulls = []
    count = pieces - 1
    for i in range(count):
        angles = 2 * np.pi * np.array([i, i + 1]) / count
        ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)  # (2, 2)
        corners = [
            [size * r * c, size * y, size * r * s]
            for c, s in ring
            for r in (0.75, 1)
            for y in (-1, 1)
        ]
        hulls.append(np.array(corners, np.float32))
    angles = 2 * np.pi * np.arange(count) / count
    rim = np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1) * 0.76
    bottom = np.concatenate([rim - [0, 1, 0], rim - [0, 0.75, 0]]) * size
    return [*hulls, bottom.astype(np.float32)]


def sheet(half: float = 1.0, cells: int = 20) -> TriangleMesh:
    """A flat open grid of triangles at y = 0 that face up: the thinnest table there is."""
    line = np.linspace(-half, half, cells + 1)
    x, z = np.meshgrid(line, line, indexing="ij")
    vertices = np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3).astype(np.float32)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    below, right, across = first + 1, first + cells + 1, first + cells + 2
    faces = [np.stack([first, below, right], 1), np.stack([below, across, right], 1)]
    return TriangleMesh(vertices, np.concatenate(faces).astype(np.int32))


def table(physics: Physics, kind: str) -> int:
    """A table 2 m wide whose top is at y = 0: "slab" 20 mm thick, or "sheet" without thickness."""
    if kind == "sheet":
        return physics.add_static(sheet(), at(0, 0, 0))
    return physics.add_static([box(1, 0.01, 1)], at(0, -0.01, 0))


def lowest(physics: Physics, number: int, hulls: list[np.ndarray]) -> float:
    """Metres above 0 of the lowest corner of a body, by the pose that is shown."""
    world_from_object = physics.pose(number).matrix()
    points = np.concatenate(hulls)
    return float((points @ world_from_object[:3, :3].T + world_from_object[:3, 3])[:, 1].min())


def run(physics: Physics, seconds: float) -> None:
    """Steps through so many seconds."""
    for _ in range(round(seconds * physics.hz)):
        physics.step()
