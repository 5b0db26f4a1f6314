"""The one oracle of drawing: projection and blending in plain numpy float64.

renderer/reference puts the scene, its gates and its palettes around it.
"""

from collections.abc import Iterator

import numpy as np

MAX_ALPHA = 0.99  # 3DGS: one splat never hides everything behind it


def rotations(wxyz: np.ndarray) -> np.ndarray:
    """(N, 3, 3) rotations of quaternions (N, 4) of any length."""
    w, x, y, z = (wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def screen_covariance(
    means: np.ndarray,
    axes: np.ndarray,
    focal: tuple[float, float],
    limits: tuple[float, float, float, float],
) -> np.ndarray:
    """(N, 2, 2) px^2 of ellipsoids by the linearised projection: J W Sigma W^T J^T (EWA; 3DGS).

    means (N, 3) metres in the camera, z forward; axes (N, 3, 3): columns one sigma long, in the
    camera; focal: fx, fy in pixels; limits: least and most x/z, least and most y/z that J sees.
    """
    (fx, fy), (left, right, top, bottom), z = focal, limits, means[:, 2]
    jacobian = np.zeros((len(z), 2, 3))  # pixels per metre
    jacobian[:, 0, 0], jacobian[:, 1, 1] = fx / z, fy / z
    jacobian[:, 0, 2] = -fx * np.clip(means[:, 0] / z, left, right) / z
    jacobian[:, 1, 2] = -fy * np.clip(means[:, 1] / z, top, bottom) / z
    half = jacobian @ axes
    return half @ half.transpose(0, 2, 1)


def weights(
    mean_px: np.ndarray,
    conics: np.ndarray,
    power_thresholds: np.ndarray,
    extents: np.ndarray,
    opacity: np.ndarray,
    transmittance: np.ndarray,
) -> Iterator[tuple[int, tuple[slice, slice], np.ndarray]]:
    """Splat after splat, near to far: which one, its rows and columns, its alpha T (h, w) there.

    transmittance (H, W), ones at first, is what is left behind each.  The rest is as in `blend`.
    """
    size = transmittance.shape[::-1]
    first = np.clip(np.floor(mean_px - extents - 0.5), 0, size).astype(int)
    after = np.clip(np.ceil(mean_px + extents + 0.5), 0, size).astype(int)
    for i in np.flatnonzero(np.all(after > first, axis=1)).tolist():
        (x0, y0), (x1, y1), (a, b, c) = first[i], after[i], conics[i]
        dx = np.arange(x0, x1) + 0.5 - mean_px[i, 0]
        dy = (np.arange(y0, y1) + 0.5 - mean_px[i, 1])[:, None]
        r = a * dx * dx + 2 * b * dx * dy + c * dy * dy
        alpha = np.minimum(MAX_ALPHA, opacity[i] * np.exp(-r / 2))
        there = slice(y0, y1), slice(x0, x1)
        weight = np.where(r <= power_thresholds[i], alpha, 0) * transmittance[there]
        transmittance[there] -= weight
        yield i, there, weight


def blend(
    mean_px: np.ndarray,
    conics: np.ndarray,
    power_thresholds: np.ndarray,
    extents: np.ndarray,
    opacity: np.ndarray,
    color: np.ndarray,
    size: tuple[int, int],
) -> tuple[np.ndarray, np.ndarray]:
    """Image (H, W, C) over nothing and transmittance (H, W) of colours (N, C), near to far.

    conics (N, 3): A, B, C of r = A dx^2 + 2 B dx dy + C dy^2; alpha = min(0.99, opacity
    exp(-r / 2)), none where r is above the power threshold (N,), which is within extents (N, 2) px
    of the mean (N, 2).  Splat by splat, without early stop (3DGS; paper eq. 2).
    """
    width, height = size
    image, transmittance = np.zeros((height, width, color.shape[1])), np.ones((height, width))
    parts = weights(mean_px, conics, power_thresholds, extents, opacity, transmittance)
    for i, there, weight in parts:
        image[there] += weight[..., None] * color[i]
    return image, transmittance
