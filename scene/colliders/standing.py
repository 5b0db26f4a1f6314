"""The plane that a thing stands on, and its body made to stand there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Of the longest side: corners so little above the lowest lie on the plane.  A spanner of 15 pieces
# whose bases differ by .9 mm creeps 4 mm a second; on one plane it sleeps.
SNAP = 0.0125
MOST_PRESSED = 0.4  # of its height: above, what a thing stood on is not of its own shape
LEANS = 10.0  # degrees: a thing that stood in photos does not tip before
ON_BASE = 1e-4  # of the longest side from the plane: rounding


@dataclass(frozen=True)
class Plane:
    normal: np.ndarray  # (3,) unit, away from what carries
    offset: float  # metres: normal . p of its points

    def height(self, points: np.ndarray) -> np.ndarray:
        """(N,) metres above the plane, of points (N, 3)."""
        return points @ self.normal - self.offset

    def axes(self) -> np.ndarray:
        """(2, 3) unit vectors along the plane, at right angles."""
        other = (1.0, 0.0, 0.0) if abs(self.normal[0]) < 0.9 else (0.0, 1.0, 0.0)
        first = np.cross(self.normal, other)
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(self.normal, first)])


def pressed(pieces: Sequence[np.ndarray], plane: Plane) -> list[np.ndarray]:
    """Corners (V, 3) float32 of pieces of one object that stands on the plane.

    What lies below, and what hardly lies above the lowest, is moved onto the plane: the object
    touches it with all of its base, and does not fall the last millimetres.  Photos do not show
    the base, but that it stood there: so much more is moved, up to MOST_PRESSED of its height,
    until it stands.
    """
    corners = np.concatenate(pieces).astype(np.float64)
    step = SNAP * float(np.ptp(corners, axis=0).max())
    heights = [plane.height(piece.astype(np.float64)) for piece in pieces]
    every = np.concatenate(heights)
    low = max(float(every.min()), 0.0)
    top = max(low + MOST_PRESSED * (float(every.max()) - low), low + step)
    base = low + step
    while True:
        out = []
        for piece, height in zip(pieces, heights, strict=True):
            down = np.where(height < base, height, 0.0)[:, None] * plane.normal
            out.append((piece - down).astype(np.float32))
        if base >= top or stands(out, plane):
            return out
        base = min(base + step, top)


def stands(pieces: Sequence[np.ndarray], plane: Plane) -> bool:
    """Whether what pieces (V, 3) have on the plane carries them when it leans by LEANS."""
    from scipy.spatial import ConvexHull, QhullError

    corners = np.concatenate(pieces).astype(np.float64)
    height = plane.height(corners)
    flat = corners[np.abs(height) < ON_BASE * np.ptp(corners, axis=0).max()] @ plane.axes().T
    try:
        edges = ConvexHull(flat).equations  # (E, 3) outward normals
    except (QhullError, ValueError):
        return False
    middle = middle_of(pieces)
    inside = -(edges[:, :2] @ (plane.axes() @ middle) + edges[:, 2]).max()
    return bool(inside >= np.tan(np.radians(LEANS)) * plane.height(middle[None])[0])


def middle_of(pieces: Sequence[np.ndarray]) -> np.ndarray:
    """(3,) metres: the centre of mass of the hulls of pieces (V, 3), what they share twice."""
    from scipy.spatial import ConvexHull, QhullError

    total, moment = 0.0, np.zeros(3)
    for piece in pieces:
        corners = piece.astype(np.float64)
        try:
            faces = corners[ConvexHull(corners).simplices]  # (F, 3, 3)
        except (QhullError, ValueError):
            continue
        inner = corners.mean(0)
        volume = np.abs(np.linalg.det(faces - inner))  # of tetrahedra, times 6
        total += volume.sum()
        moment += volume @ ((inner + faces.sum(axis=1)) / 4)
    return moment / total if total > 0 else np.concatenate(pieces).mean(0)
