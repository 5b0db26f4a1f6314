"""The plane that a thing stood on, found among the anchors around it (RANSAC)."""

from dataclasses import dataclass

import numpy as np

from shapeshift.decomposition.completion.anchor_looks import AnchorLooks

TRIES = 300
WITHIN = 0.7  # spacings of anchors: as near to the plane is on it while it is looked for
REACH = 2.5  # sizes of the thing around it in which the plane is looked for
LEAST_ANCHORS, LEAST_SHARE = 40, 0.2  # of the anchors around, that lie on it
FARTHEST = 5.0  # spacings between the plane and the thing's lowest anchors
LOWEST = 2.0  # percent of its anchors that may lie lower than what counts as its lowest
Refused = str  # one sentence without the thing's name


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


def fit_plane(points: np.ndarray, within: float, seed: int = 0) -> tuple[Plane, np.ndarray] | None:
    """The plane of most points (N, 3) metres, and which of them lie on it (N,); None of a few."""
    if len(points) < 3:
        return None
    random = np.random.default_rng(seed)
    first, second, third = points[random.integers(0, len(points), (3, TRIES))]
    normals = np.cross(second - first, third - first)
    length = np.linalg.norm(normals, axis=1)
    good = length > 1e-12
    if not good.any():
        return None
    normals = normals[good] / length[good, None]
    offsets = np.einsum("ti,ti->t", normals, first[good])
    counts = [
        (np.abs(points @ n - o) < within).sum() for n, o in zip(normals, offsets, strict=True)
    ]
    best = int(np.argmax(counts))
    plane = Plane(normals[best], float(offsets[best]))
    for _ in range(3):  # by least squares through what lies on it
        near = np.abs(plane.height(points)) < within
        if near.sum() < 3:
            return None
        middle = points[near].mean(0)
        normal = np.linalg.svd(points[near] - middle, full_matrices=False)[2][2]
        plane = Plane(normal, float(normal @ middle))
    return plane, np.abs(plane.height(points)) < within


def support_plane(looks: AnchorLooks, labels: np.ndarray, label: int) -> Plane | Refused:
    """The plane under a thing: of background (label 0) around it, the normal on its side.

    labels (A,).  A text says why there is none.
    """
    mine = looks.there & (labels == label)
    ground = looks.there & (labels == 0)
    if mine.sum() < 3:
        return "nothing of it can be seen"
    low, high = np.percentile(looks.places[mine], (1, 99), axis=0)
    size = np.linalg.norm(high - low)
    near = np.linalg.norm(looks.places[ground] - (low + high) / 2, axis=1) < REACH * size
    around = looks.places[ground][near]
    found = fit_plane(around, WITHIN * looks.spacing_m)
    if found is None or found[1].sum() < max(LEAST_ANCHORS, LEAST_SHARE * len(around)):
        return "nothing flat is around it"
    plane = found[0]
    height = plane.height(looks.places[mine])
    if np.median(height) < 0:
        plane = Plane(-plane.normal, -plane.offset)
        height = -height
    lowest = float(np.percentile(height, LOWEST))
    if lowest > FARTHEST * looks.spacing_m:
        return f"it stands on no plane: the next one lies {1e3 * lowest:.0f} mm under it"
    return plane
