"""Pixels of many views in small cubes of space: what all views together say of a surface."""

from dataclasses import dataclass

import numpy as np

from shapeshift.scene.change.seen_pair import Samples

LEAST_VIEWS = 3  # that a cell must be seen in: one view is no evidence


@dataclass(frozen=True, eq=False)
class SurfaceCells:
    """The surface of one visit, a row a cube that is seen in LEAST_VIEWS views or more."""

    points: np.ndarray  # (m, 3) metres, A's world: the mean of what was seen in it
    views: np.ndarray  # (m,) how many show it
    through: np.ndarray  # (m,) part of the views in which the other visit sees through it, 0..1
    away_m: np.ndarray  # (m,) to the other visit's nearest surface
    color: np.ndarray  # (m, 3) display sRGB, median
    color_change: np.ndarray  # (m, 3) Lab, other less own; NaN where the other has none
    value: np.ndarray  # (m,) median, NaN: not known
    value_change: np.ndarray  # (m,) median of other less own

    def __len__(self) -> int:
        return len(self.points)


def cells_of(own: Samples, other: Samples, cell_m: float) -> SurfaceCells:
    """One visit's cells with side cell_m."""
    from scipy.spatial import cKDTree

    keys = np.floor(own.points / cell_m).astype(np.int64)
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel()
    known = np.isfinite(own.through)
    pairs = np.unique(np.stack([group[known], own.view[known]], axis=1), axis=0)
    count = int(group.max()) + 1 if len(group) else 0
    views = np.bincount(pairs[:, 0], minlength=count)
    kept = np.flatnonzero(views >= LEAST_VIEWS)
    row_of = np.full(count, -1)
    row_of[kept] = np.arange(len(kept))
    row, order = row_of[group], None
    order = np.flatnonzero((row >= 0) & known)
    row = row[order]
    points = np.stack([means(row, own.points[order, i], len(kept)) for i in range(3)], axis=1)
    lab = lab_of(own.color_other[order]) - lab_of(own.color[order])
    heat = own.value_other[order] - own.value[order]
    away = np.full(len(kept), np.inf)
    if len(other.points) and len(kept):
        away = cKDTree(other.points).query(points)[0]
    return SurfaceCells(
        points,
        views[kept],
        means(row, own.through[order], len(kept)),
        away,
        np.stack([medians(row, own.color[order, i], len(kept)) for i in range(3)], axis=1),
        np.stack([medians(row, lab[:, i], len(kept)) for i in range(3)], axis=1),
        medians(row, own.value[order], len(kept)),
        medians(row, heat, len(kept)),
    )


def means(row: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count,) of values (n,) that belong to rows (n,)."""
    total = np.bincount(row, values, minlength=count)
    return total / np.maximum(np.bincount(row, minlength=count), 1)


def medians(row: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count,) of those values (n,) that are finite; NaN where a row has none."""
    good = np.isfinite(values)
    row, values = row[good], values[good]
    order = np.lexsort((values, row))
    row, values = row[order], values[order]
    sizes = np.bincount(row, minlength=count)
    first = np.cumsum(sizes) - sizes
    out = np.full(count, np.nan)
    some = sizes > 0
    low, high = first + (sizes - 1) // 2, first + sizes // 2
    out[some] = (values[low[some]] + values[high[some]]) / 2
    return out


def lab_of(srgb: np.ndarray) -> np.ndarray:
    """(..., 3) CIE L*a*b* under D65 of display sRGB (..., 3); distances of 2 are just visible."""
    c = np.clip(srgb, 0, 1)
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    xyz_from_rgb = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
         [0.0193339, 0.1191920, 0.9503041]]
    )  # fmt: skip
    xyz = linear @ xyz_from_rgb.T / (0.95047, 1.0, 1.08883)
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)
