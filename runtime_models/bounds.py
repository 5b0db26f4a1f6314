"""Robust bounds of splats: where they are, and how far they reach."""

import numpy as np

MIN_OPACITY = 0.1  # fainter splats are mostly floaters; they do not count for the bounds
PERCENTILES = (2, 98)
SMALLEST_RADIUS, SMALLEST_PART = 1e-30, 1e-9  # metres; of how far from zero the centre is
FALLBACK_RADIUS = 1.0  # metres, when nothing is there to be framed


def frame_points(means: np.ndarray, opacity: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (3,) and radius in metres of splats with means (N, 3) and opacity (N,).

    The 2nd to 98th percentile of what can be seen: a few far floaters move neither.  With nothing
    that opaque every finite mean counts; with no mean at all, a metre about the origin.
    """
    points = seen_points(means, opacity)  # (P, 3)
    if not len(points):
        return np.zeros(3), FALLBACK_RADIUS
    low, high = np.percentile(points, PERCENTILES, axis=0)
    centre = (low + high) / 2
    radius = float(np.percentile(np.linalg.norm(points - centre, axis=1), PERCENTILES[1]))
    # next to its numbers a smaller one is lost in rounding: the eye would lie in what it looks at
    least = max(SMALLEST_PART * float(np.abs(centre).max()), SMALLEST_RADIUS)
    return centre, radius if radius > least else max(FALLBACK_RADIUS, 1000 * least)


def seen_points(means: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """(P, 3) float64 means that count for the bounds."""
    finite = np.isfinite(means).all(axis=1)
    seen = finite & (opacity > MIN_OPACITY)  # NaN opacity is not seen
    return means[seen if seen.any() else finite].astype(np.float64)
