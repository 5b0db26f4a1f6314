"""How far apart points lie: the way from each to its nearest neighbours."""

import numpy as np

from shapeshift.runtime_models.splats.operations.morton import morton_order

NEAREST = 3  # neighbours that are averaged, as 3DGS does for its first splats
REACH = 6  # places along the curve, to either side, where neighbours are looked for
SHIFTS = (0.0, 1 / 3)  # of the scene: what one curve parts, the other does not


def knn_distance(points: np.ndarray) -> np.ndarray:
    """(N,) about the mean distance to the three nearest of the other points (N, 3).

    Never below a hundredth of the median nor above four times it, so that neither doubles vanish
    nor strays fill the scene; 0.01 where there is no distance at all.  Rows with NaN or Inf get
    the median.
    """
    out = np.full(len(points), 0.01)
    good = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(good) < 2:
        return out
    found = nearest_distances(points[good].astype(np.float64))
    apart = found[found > 0]
    if not len(apart):
        return out
    median = np.median(apart)
    out[:] = median
    out[good] = found.clip(median / 100, median * 4)
    return out


def nearest_distances(points: np.ndarray) -> np.ndarray:
    """(N,) mean distance to the nearest found among neighbours along two space-filling curves.

    At least the true one; for most points the same, for one in twenty a third more.
    """
    count = len(points)
    # Inf where a point has not so many neighbours
    best = np.full((count, NEAREST), np.inf)
    size = np.ptp(np.quantile(points, (0.05, 0.95), axis=0), axis=0)
    known: list[np.ndarray] = []  # the curves that were gone along, as places on them
    for shift in SHIFTS:
        order = curve(points, shift * size)
        sorted_points = points[order]
        for step in range(1, min(REACH, count - 1) + 1):
            one, other = order[:-step], order[step:]
            distance = np.linalg.norm(sorted_points[step:] - sorted_points[:-step], axis=1)
            for place in known:  # a pair that an earlier curve has found counts once
                distance[np.abs(place[one] - place[other]) <= REACH] = np.inf
            for rows in (one, other):
                keep_smallest(best, rows, distance)
        place = np.empty(count, np.int64)
        place[order] = np.arange(count)
        known.append(place)
    found = np.isfinite(best)
    return np.where(found, best, 0).sum(1) / np.maximum(found.sum(1), 1)


def curve(points: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """(N,) an order along the Z-curve whose cells are moved by `shift` (3,)."""
    if not shift.any():
        return morton_order(points)
    # Two far corners carry the shift into the range that the curve's cells divide.
    corners = [points.min(axis=0) - shift, points.max(axis=0) + 2 * shift]
    order = morton_order(np.concatenate([points, corners]))
    return order[order < len(points)]


def keep_smallest(best: np.ndarray, rows: np.ndarray, distance: np.ndarray) -> None:
    """Puts a distance (n,) into each of those rows of best (N, k), which stay sorted."""
    for column in range(best.shape[1]):
        held = best[rows, column]
        best[rows, column] = np.minimum(held, distance)
        distance = np.maximum(held, distance)
