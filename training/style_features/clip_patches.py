"""Patches of a picture, cropped and bent in perspective (R of equation 11), as one sparse matrix.

The matrix takes a picture's pixels to those of all patches; its transpose takes gradients back.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


@dataclass(frozen=True)
class PatchSettings:
    """How patches are cut."""

    count: int = 4  # 1 to 64; the first one is the whole part
    share: tuple[float, float] = (0.4, 0.9)  # of the part's sides
    bend: float = 0.15  # how far corners move, of a patch's sides

    def __post_init__(self) -> None:
        if not 1 <= self.count <= 64:
            raise ValueError(f"a picture is cut into {self.count} patches; 1 to 64 are wanted.")


def patch_matrix(
    size: tuple[int, int], part: tuple[slice, slice], side: int, settings: PatchSettings,
    rng: np.random.Generator,
) -> sparse.csr_matrix:  # fmt: skip
    """(count * side^2, H * W): bilinear patches of a part of a picture of size (W, H)."""
    rows, columns, weights = [], [], []
    for k in range(settings.count):
        corners = whole(part) if k == 0 else random_corners(part, settings, rng)
        places = sampled(homography(corners), side)  # (side^2, 2) x y of the picture
        for index, weight in bilinear(places, size):
            rows.append(k * side * side + np.arange(side * side))
            columns.append(index)
            weights.append(weight)
    shape = settings.count * side * side, size[0] * size[1]
    entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_matrix(entries, shape, dtype=np.float32)


def whole(part: tuple[slice, slice]) -> np.ndarray:
    """(4, 2) corners x y of a part of a picture, given as its rows and columns."""
    down, across = part
    extent = np.array([across.stop - across.start, down.stop - down.start])
    return CORNERS * extent + [across.start, down.start]


def random_corners(
    part: tuple[slice, slice], settings: PatchSettings, rng: np.random.Generator
) -> np.ndarray:
    """(4, 2) of a piece of the part, anywhere in it, its corners moved a little."""
    outer = whole(part)
    extent = outer[2] - outer[0]
    inner = extent * rng.uniform(*settings.share)
    first = outer[0] + rng.random(2) * (extent - inner)
    moved = CORNERS + rng.uniform(-settings.bend, settings.bend, (4, 2)) / 2
    return first + moved * inner


def homography(corners: np.ndarray) -> np.ndarray:
    """(3, 3) that takes the unit square's corners to the given ones."""
    equations = []
    for (u, v), (x, y) in zip(CORNERS, corners, strict=True):
        equations += [[u, v, 1, 0, 0, 0, -x * u, -x * v], [0, 0, 0, u, v, 1, -y * u, -y * v]]
    return np.append(np.linalg.solve(np.array(equations), corners.ravel()), 1).reshape(3, 3)


def sampled(matrix: np.ndarray, side: int) -> np.ndarray:
    """(side^2, 2) where the pixels of a patch lie, row by row."""
    down, across = (np.mgrid[:side, :side].reshape(2, -1) + 0.5) / side
    points = np.stack([across, down, np.ones(side * side)], axis=1) @ matrix.T
    return points[:, :2] / points[:, 2:]


def bilinear(places: np.ndarray, size: tuple[int, int]):
    """The four pixels about each place, as numbers of pixels and weights; held at the border."""
    limit = np.array(size) - 1.0
    at = np.clip(places - 0.5, 0, limit)
    low = np.minimum(at.astype(int), np.maximum(limit.astype(int) - 1, 0))
    right = at - low
    for x, y in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = np.minimum(low[:, 0] + x, size[0] - 1), np.minimum(low[:, 1] + y, size[1] - 1)
        weight = np.abs(1 - x - right[:, 0]) * np.abs(1 - y - right[:, 1])
        yield row * size[0] + column, weight
