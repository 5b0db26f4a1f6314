"""Lenses that other programs have and COLMAP has not.

Brown-Conrady's with a fourth radial number, nerfstudio's and Metashape's.  u, v: tangents, or of a
fisheye lens the angle t off the axis (equisolid: 2 sin(t / 2)) in the direction of these.

    d = 1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8        r^2 = u^2 + v^2
    a = 1 + p3 r^2 + p4 r^4                          1 without these two
    x = d u + a (2 p1 u v + p2 (r^2 + 2 u^2)) + skew y
    y = d v + a (2 p2 u v + p1 (r^2 + 2 v^2))

OpenCV's rational lens calls something else k4, a denominator's first number.

RADIAL_BACKWARDS, VisualSFM's: what its one number makes of a pixel is the straight one,
u = x (1 + k (x^2 + y^2)).
"""

import numpy as np

from shapeshift.scene.captures.colmap_tables import (
    BROWN,
    BROWN_EQUISOLID,
    BROWN_FISHEYE,
    RADIAL_BACKWARDS,
    ColmapCamera,
)

NEWTON_STEPS = 12  # from the straight tangents on, which are near


def is_brown(lens: ColmapCamera) -> bool:
    return lens.model in (BROWN, BROWN_FISHEYE, BROWN_EQUISOLID, RADIAL_BACKWARDS)


def brown_pixels(lens: ColmapCamera, tangents: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of the photo that lie at tangents (N, 2)."""
    if lens.model == RADIAL_BACKWARDS:
        return backwards_pixels(lens, tangents)
    k1, k2, k3, k4, p1, p2, *more = lens.params[4:]
    p3, p4, skew = more or (0.0, 0.0, 0.0)
    u, v = np.asarray(tangents, np.float64).T
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is no pixel
        if lens.model != BROWN:
            tangent = np.hypot(u, v)
            angle = np.arctan(tangent)
            reach = angle if lens.model == BROWN_FISHEYE else 2 * np.sin(angle / 2)
            bent = np.where(tangent > 0, reach / np.where(tangent > 0, tangent, 1), 1.0)
            u, v = u * bent, v * bent
        r2 = u * u + v * v
        d = 1 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))
        a = 1 + r2 * (p3 + r2 * p4)
        x = d * u + a * (2 * p1 * u * v + p2 * (r2 + 2 * u * u))
        y = d * v + a * (2 * p2 * u * v + p1 * (r2 + 2 * v * v))
        return np.stack([x + skew * y, y], axis=1) * lens.focal + lens.centre


def backwards_pixels(lens: ColmapCamera, tangents: np.ndarray) -> np.ndarray:
    """The same of VisualSFM's lens; NaN where no pixel is taken there."""
    tangents, k = np.asarray(tangents, np.float64), lens.params[4]
    wanted = np.hypot(*tangents.T)  # r (1 + k r^2) = wanted, for the r nearest to it
    with np.errstate(all="ignore"):
        r = wanted.copy()
        for _ in range(NEWTON_STEPS):
            r = r - (r + k * r**3 - wanted) / (1 + 3 * k * r * r)
        good = (np.abs(r + k * r**3 - wanted) <= 1e-9 * (1 + wanted)) & (1 + 3 * k * r * r > 0)
        scale = np.where(good & (r >= 0), r / np.where(wanted > 0, wanted, 1), np.nan)
    scale = np.where(wanted > 0, scale, 1.0)
    return tangents * scale[:, None] * lens.focal + lens.centre


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
