"""Lenses that nerfstudio has and COLMAP has not: Brown-Conrady's with a fourth radial number.

u, v: tangents, or of a fisheye lens the angle off the axis in the direction of these.

    d = 1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8        r^2 = u^2 + v^2
    x = d u + 2 p1 u v + p2 (r^2 + 2 u^2)
    y = d v + 2 p2 u v + p1 (r^2 + 2 v^2)

OpenCV's rational lens calls something else k4, a denominator's first number.
"""

import numpy as np

from shapeshift.scene.captures.colmap_tables import BROWN, BROWN_FISHEYE, ColmapCamera

NEWTON_STEPS = 12  # from the straight tangents on, which are near


def is_brown(lens: ColmapCamera) -> bool:
    return lens.model in (BROWN, BROWN_FISHEYE)


def brown_pixels(lens: ColmapCamera, tangents: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of the photo that lie at tangents (N, 2)."""
    k1, k2, k3, k4, p1, p2 = lens.params[4:]
    u, v = np.asarray(tangents, np.float64).T
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is no pixel
        if lens.model == BROWN_FISHEYE:
            tangent = np.hypot(u, v)
            bent = np.arctan(tangent) / np.where(tangent > 0, tangent, 1)
            u, v = u * bent, v * bent
        r2 = u * u + v * v
        d = 1 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))
        x = d * u + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)
        y = d * v + 2 * p2 * u * v + p1 * (r2 + 2 * v * v)
        return np.stack([x, y], axis=1) * lens.focal + lens.centre


def brown_tangents(lens: ColmapCamera, pixels: np.ndarray) -> np.ndarray:
    """(N, 2) tangents that lie at pixels (N, 2) of the photo, by Newton's method; NaN or wild
    where none do.
    """
    straight = (np.asarray(pixels, np.float64) - lens.centre) / lens.focal
    found, step = straight.copy(), 1e-6
    for _ in range(NEWTON_STEPS):
        at = (brown_pixels(lens, found) - lens.centre) / lens.focal
        slopes = [
            ((brown_pixels(lens, found + by) - lens.centre) / lens.focal - at) / step
            for by in ((step, 0.0), (0.0, step))
        ]
        (a, c), (b, d) = (slope.T for slope in slopes)
        x, y = (straight - at).T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            determinant = a * d - b * c
            found = found + np.stack([d * x - b * y, a * y - c * x], 1) / determinant[:, None]
    return found
