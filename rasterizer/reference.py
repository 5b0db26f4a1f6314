"""The one oracle of drawing: projection and blending in plain numpy float64; finite differences.

renderer/reference puts the scene, its gates and its palettes around it.
"""

from collections.abc import Callable, Iterator

import numpy as np

from shapeshift.rasterizer.project import LEAST_ALPHA, LOW_PASS, Camera

MAX_ALPHA = 0.99  # 3DGS: one splat never hides everything behind it
Splats = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


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


def project_reference(
    means, scales, wxyz, opacity, color, camera: Camera, low_pass: float = LOW_PASS
) -> tuple[np.ndarray, np.ndarray]:
    """Records (N, 12) and depths (N,) float64 of finite splats, laid out as `project` lays them."""
    camera_from_world = np.asarray(camera.camera_from_world, np.float64)
    p = means @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    in_front = p.copy()
    in_front[:, 2] = z = np.where(p[:, 2] > camera.near, p[:, 2], 1.0)  # the others are culled
    axes = camera_from_world[:3, :3] @ (rotations(wxyz) * scales[:, None, :])
    bare = screen_covariance(in_front, axes, (camera.fx, camera.fy), camera.limits())
    covariance = bare + low_pass * np.eye(2)  # (N, 2, 2) px^2
    conic = np.linalg.inv(covariance)
    power_threshold = 2 * np.log(np.maximum(opacity, LEAST_ALPHA) / LEAST_ALPHA)
    extent = np.sqrt(power_threshold[:, None] * np.diagonal(covariance, axis1=1, axis2=2))
    x, y = camera.fx * p[:, 0] / z + camera.cx, camera.fy * p[:, 1] / z + camera.cy
    width, height = camera.size
    seen = (p[:, 2] > camera.near) & (opacity > LEAST_ALPHA)
    seen &= (x + extent[:, 0] > 0) & (x - extent[:, 0] < width)
    seen &= (y + extent[:, 1] > 0) & (y - extent[:, 1] < height)
    conics = conic[:, (0, 0, 1), (0, 1, 1)]  # (N, 3): A, B, C of A dx^2 + 2 B dx dy + C dy^2
    record = np.column_stack([x, y, conics, opacity, color, extent, power_threshold])
    record[~seen] = 0
    record[~seen, 9:11] = -1
    return record, np.where(seen, p[:, 2], 1e30)


def rasterize_reference(
    record: np.ndarray, depth: np.ndarray, size: tuple[int, int], background=(0.0, 0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray]:
    """Image (3, H, W) and transmittance (H, W), splat by splat, near to far, without early stop."""
    order = np.argsort(depth, kind="stable")
    drawn = record[order[record[order, 9] > 0]]  # of the others the extents are -1
    image, transmittance = blend(
        drawn[:, :2], drawn[:, 2:5], drawn[:, 11], drawn[:, 9:11], drawn[:, 5], drawn[:, 6:9], size
    )
    over = image + transmittance[..., None] * np.asarray(background)
    return over.transpose(2, 0, 1), transmittance


def evidence_reference(
    record: np.ndarray, depth: np.ndarray, labels: np.ndarray, count: int
) -> np.ndarray:
    """(N, count) pixels: each splat's alpha T summed over the pixels of each label (OWD 3.3).

    labels (H, W); what is not below `count` is summed nowhere.  Without early stop.
    """
    order = np.argsort(depth, kind="stable")
    drawn = order[record[order, 9] > 0]
    shown = record[drawn]
    shape = (shown[:, :2], shown[:, 2:5], shown[:, 11], shown[:, 9:11], shown[:, 5])
    out = np.zeros((len(record), 256))
    for i, there, weight in weights(*shape, np.ones(labels.shape)):
        out[drawn[i]] = np.bincount(labels[there].ravel(), weight.ravel(), minlength=256)
    return out[:, :count]


def render_reference(splats: Splats, camera: Camera, background=(0.0, 0.0, 0.0)) -> tuple:
    """Image and transmittance of (means, scales, wxyz, opacity, color), all float64."""
    record, depth = project_reference(*splats, camera)
    return rasterize_reference(record, depth, camera.size, background)


def finite_differences(loss: Callable, values: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Central differences of loss(values) for every entry: the oracle of the gradients."""
    grads = np.empty(values.size)
    flat = np.asarray(values, np.float64).ravel()
    for k in range(flat.size):
        ahead, behind = flat.copy(), flat.copy()
        ahead[k] += step
        behind[k] -= step
        shaped = (v.reshape(values.shape) for v in (ahead, behind))
        grads[k] = np.subtract(*(loss(v) for v in shaped)) / (2 * step)
    return grads.reshape(values.shape)
