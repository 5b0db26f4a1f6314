"""The slow twin of the rasterizer's passes around rasterizer/reference.py; finite differences."""

from collections.abc import Callable

import numpy as np

from shapeshift.rasterizer.project import LEAST_ALPHA, LOW_PASS, Camera
from shapeshift.rasterizer.reference import blend, rotations, screen_covariance, weights

Splats = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


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
