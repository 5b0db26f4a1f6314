"""One splat for a group of splats, of the same moments: places, covariance, harmonics, alpha."""

from collections.abc import Callable

import numpy as np

from shapeshift.runtime_models.files.blocks import each_block
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.rotation import covariance, quaternions_of

PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # axes of xx xy xz yy yz zz
FULL = (0, 1, 2, 1, 3, 4, 2, 4, 5)  # a symmetric 3 x 3 matrix of those six
MERGED_AT_ONCE = 1024  # groups: 2,000 to 10,000 splats, of degree 3 at most 4 MB in float64
OVERLAP = 0.5  # exponent: area grows by so much of what is above an opacity of 1
LEAST_LENGTH = 1e-30  # metres: a splat of no extent stays one
MOST_LENGTH = float(np.finfo(np.float32).max)  # metres


def mean_area(covariances: np.ndarray) -> np.ndarray:
    """(N,) m^2: root of the mean of a^2 b^2, b^2 c^2 and c^2 a^2 of the axes of (6, N) m^2.

    In float64, or as given.  That is the area of an ellipsoid's shadow on its three planes, as
    the root of the mean square over directions, up to pi; the sum of the principal minors of a
    matrix gives it without its axes.
    """
    xx, xy, xz, yy, yz, zz = covariances
    minors = xx * yy - xy * xy + (yy * zz - yz * yz) + (xx * zz - xz * xz)  # rounding: below 0
    return np.sqrt(np.maximum(minors, 0) / 3)


def shown_area(scales: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """(N,) float64 m^2: opacity (N,) times the mean area of ellipsoids of scales (N, 3) metres."""
    squares = scales.astype(np.float64) ** 2
    a, b, c = squares.T
    return np.maximum(opacity, 0) * np.sqrt((a * b + b * c + c * a) / 3)


def merge_groups(
    layers: SplatLayers, group: np.ndarray, progress: Callable[[float], None] | None = None
) -> tuple[SplatLayers, np.ndarray]:
    """The splats with each group as one, and (N,) int32 into which row of them each went.

    group (N,) is any number that its members share.

    Weights are opacity times mean area: mean, covariance and harmonics are the weighted means, the
    covariance with the spread of the places (moment matching of Gaussian mixtures, Runnalls 2007).
    The opacity keeps the sum of the weights.  Where it would pass 1, some of the members lie over
    each other and hide each other, some lie beside: the area grows by the root of the excess.
    Measured at a tenth (docs/bench/thin.csv): 0.3 to 2.6 dB better than not at all, 0.0 to 1.5
    better than by all of it.

    Everything else (stop, label, other columns) is of the member of the largest weight, in whose
    place in the order the result stands; who is alone keeps every bit.  progress(part done 0..1).
    """
    weight = shown_area(layers.scales, layers.opacity)
    by = np.lexsort((-weight, group))  # stable: of equals the first row leads
    starts = np.flatnonzero(np.r_[True, np.diff(group[by]) != 0])
    counts = np.diff(np.r_[starts, len(by)])
    leaders = by[starts]
    in_order = np.argsort(leaders)
    into = np.empty(len(by), np.int32)
    into[by] = np.repeat(np.argsort(in_order), counts)
    several = np.flatnonzero(counts[in_order] > 1)  # rows of the result
    starts, counts = starts[in_order[several]], counts[in_order[several]]
    out = layers.with_rows(leaders[in_order])

    def merge_rows(block: slice, _: None) -> None:
        rows, n = several[block], counts[block]
        first = np.cumsum(n) - n
        places = np.arange(n.sum()) - np.repeat(first - starts[block], n)
        members = by[places]
        merged = merge_moments(layers, members, weight[members], first, n)
        for name, values in merged.items():
            getattr(out, name)[rows] = values

    each_block(len(several), merge_rows, progress, block=MERGED_AT_ONCE)
    return out, into


def merge_moments(
    layers: SplatLayers, members: np.ndarray, weight: np.ndarray, first: np.ndarray, n: np.ndarray
) -> dict[str, np.ndarray]:
    """Arrays of SplatLayers, a row a group: its n (G,) members lie from first (G,) on.

    members (M,) are rows of the layers, weight (M,) theirs in m^2.
    """
    total = np.add.reduceat(weight, first)
    seen = np.repeat(total > 0, n)
    share = np.where(seen, weight, 1.0) / np.repeat(np.where(total > 0, total, n), n)

    def mean(values: np.ndarray) -> np.ndarray:
        flat = values.reshape(len(values), -1) * share[:, None]
        return np.add.reduceat(flat, first, axis=0)

    places = layers.means[members].astype(np.float64)
    start = places[first]  # from there: no digits are lost far from zero
    away = places - np.repeat(start, n, axis=0)
    middle = mean(away)
    away -= np.repeat(middle, n, axis=0)
    own = covariance(layers.scales[members].astype(np.float64), layers.wxyz[members])
    moments = mean(own + np.stack([away[:, a] * away[:, b] for a, b in PAIRS], axis=1))  # (G, 6)
    scales, wxyz = axes_of(moments)
    opacity = total / np.maximum(mean_area(moments.T), LEAST_LENGTH**2)
    grown = np.maximum(opacity, 1.0) ** (OVERLAP / 2)  # of a length: half of that of an area
    sh = mean(layers.sh[members]).reshape(len(n), -1, 3)
    return {
        "means": start + middle,
        "scales": np.minimum(scales * grown[:, None], MOST_LENGTH),
        "wxyz": wxyz,
        "opacity": np.minimum(opacity, 1.0),
        "sh": sh,
    }


def axes_of(covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One sigma (G, 3) metres and unit quaternions (G, 4) of covariances (G, 6) m^2."""
    size = np.maximum(covariances[:, [0, 3, 5]].max(axis=1), LEAST_LENGTH**2)
    values, axes = np.linalg.eigh((covariances / size[:, None])[:, FULL].reshape(-1, 3, 3))
    axes[np.linalg.det(axes) < 0, :, 0] *= -1
    return np.sqrt(np.maximum(values, 0) * size[:, None]), quaternions_of(axes)
