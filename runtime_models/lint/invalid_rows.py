"""Which rows of a file's splats need a second look, found fast: nearly always none does."""

import numpy as np

from shapeshift.runtime_models.splats.plain_splats import RawSplats

LARGEST_LOG = 80.0  # exp of it is a finite float32
SQUARES = (1e-30, 1e30)  # a quaternion's length squared: far from the ends of float32


def ranges(raw: RawSplats) -> tuple[tuple[float, float], tuple[float, float]]:
    """(least, largest) of usual scales and opacities, both themselves usual."""
    largest = float(np.finfo(np.float32).max)
    scales = (-largest, LARGEST_LOG) if raw.log_scales else (0.0, largest)
    return scales, ((-largest, largest) if raw.logits else (0.0, 1.0))


def any_invalid(raw: RawSplats, rows: slice) -> bool:
    """Whether any of these rows may be odd."""
    if raw.usual:
        return False
    largest = float(np.finfo(np.float32).max)
    everything = (-largest, largest)
    scales, opacities = ranges(raw)
    wxyz = raw.wxyz[rows]
    parts = (
        (raw.sh[rows], everything),
        (raw.means[rows], everything),
        (raw.scales[rows], scales),
        (raw.opacity[rows], opacities),
        (np.einsum("nc,nc->n", wxyz, wxyz), SQUARES),
    )
    # NaN is the least and the largest of its block, and no comparison with it holds.
    return not all(low <= part.min() and part.max() <= high for part, (low, high) in parts)


def invalid_in(raw: RawSplats, rows: slice) -> np.ndarray:
    """(n,) bool: the rows themselves."""
    scales, opacities = ranges(raw)
    largest = float(np.finfo(np.float32).max)  # float64 positions may lie beyond
    usual = within(raw.means[rows], (-largest, largest)).all(1) & np.isfinite(raw.sh[rows]).all(
        (1, 2)
    )
    usual &= within(raw.scales[rows], scales).all(1) & within(raw.opacity[rows], opacities)
    with np.errstate(over="ignore", invalid="ignore"):
        usual &= within(np.einsum("nc,nc->n", raw.wxyz[rows], raw.wxyz[rows]), SQUARES)
    return ~usual


def within(array: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    return (ends[0] <= array) & (array <= ends[1])
