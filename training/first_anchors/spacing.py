"""How close points stand, and as many of them on a grid as are wanted."""

import numpy as np

SAMPLE = 1000  # points whose nearest neighbour is looked for


def median_neighbour(points: np.ndarray, rng: np.random.Generator) -> float:
    """Median distance in metres from a point to its nearest neighbour, over a sample."""
    picked = rng.choice(len(points), min(SAMPLE, len(points)), replace=False)
    square = (points**2).sum(1)
    nearest = []
    for chunk in np.array_split(picked, max(1, len(picked) // 100)):
        distance2 = square[chunk, None] + square[None] - 2 * points[chunk] @ points.T
        distance2[np.arange(len(chunk)), chunk] = np.inf
        nearest.append(distance2.min(axis=1))
    return float(np.sqrt(np.median(np.maximum(np.concatenate(nearest), 0))))


def voxel_centres(points: np.ndarray, voxel: float) -> np.ndarray:
    """(A, 3) float32 the grid nodes of spacing `voxel` that have a point, each once, sorted."""
    return (np.unique(np.round(points / voxel), axis=0) * voxel).astype(np.float32)


def choose_voxel(points: np.ndarray, most: int, rng: np.random.Generator) -> float:
    """Median neighbour distance, or as much more as it takes to come down to `most` anchors."""
    low = max(median_neighbour(points, rng), 1e-9)
    if len(voxel_centres(points, low)) <= most:
        return low
    high = low
    while len(voxel_centres(points, high)) > most:
        low, high = high, high * 2
    for _ in range(8):  # to 0.4 %
        middle = (low * high) ** 0.5
        low, high = (middle, high) if len(voxel_centres(points, middle)) > most else (low, middle)
    return high
