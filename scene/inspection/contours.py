"""Isotherms as lines in the world: where a view's values cross a level, on the surface it sees."""

import numpy as np

from shapeshift.scene.inspection.marks import Isotherm
from shapeshift.scene.inspection.value_picture import ValuePicture

TORN = 0.05  # of the depth: neighbours farther apart lie on two surfaces, with no line between
MOST_LINES = 800  # of a picture; more are made coarser


def contour_lines(picture: ValuePicture, isotherm: Isotherm, every: int = 3) -> np.ndarray:
    """(S, 2, 3) metres of the world; every: pixels between the samples that they are made of.

    Marching squares, straight between samples; a cell that four sides of are crossed has none.
    """
    while True:
        levels = [v for v in (isotherm.low, isotherm.high) if np.isfinite(v)]
        parts = [_crossings(picture, level, every) for level in levels]
        lines = np.concatenate([np.zeros((0, 2, 3)), *parts])
        if len(lines) <= MOST_LINES:
            return lines
        every *= 2


def _crossings(picture: ValuePicture, level: float, every: int) -> np.ndarray:
    """(S, 2, 3) of one level."""
    step = slice(every // 2, None, every)
    values, depth = picture.values[step, step], picture.depth_m[step, step]
    points = picture.points[step, step]
    if min(values.shape) < 2:
        return np.zeros((0, 2, 3))
    around = [np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, 1:], np.s_[1:, :-1]]
    v = np.stack([values[at] for at in around], axis=-1)  # (h, w, 4) a cell's corners, around
    z = np.stack([depth[at] for at in around], axis=-1)
    p = np.stack([points[at] for at in around], axis=-2)  # (h, w, 4, 3)
    with np.errstate(invalid="ignore"):
        whole = np.ptp(z, axis=-1) <= TORN * z.min(axis=-1)  # NaN is not
        above = v > level
    crossed = above != np.roll(above, -1, axis=-1)  # of the side from each corner to the next
    cells = np.isfinite(v).all(axis=-1) & whole & (crossed.sum(axis=-1) == 2)
    v, p, crossed = v[cells], p[cells], crossed[cells]  # (c, 4), (c, 4, 3), (c, 4)
    beyond, to = np.roll(v, -1, axis=-1), np.roll(p, -1, axis=-2)
    with np.errstate(divide="ignore", invalid="ignore"):
        part = (level - v) / (beyond - v)
        meets = p + part[..., None] * (to - p)  # where it is not crossed, nonsense
    return meets[crossed].reshape(-1, 2, 3)
