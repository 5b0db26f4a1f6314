"""The slow twin: projection and blending in plain numpy float64, and finite differences."""

from collections.abc import Callable

import numpy as np

from shapeshift.rasterizer.project import LEAST_ALPHA, LOW_PASS, Camera

MAX_ALPHA = 0.99
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


def project_reference(
    means, scales, wxyz, opacity, color, camera: Camera, low_pass: float = LOW_PASS
) -> tuple[np.ndarray, np.ndarray]:
    """Records (N, 12) and depths (N,) float64 of finite splats, laid out as `project` lays them."""
    camera_from_world = np.asarray(camera.camera_from_world, np.float64)
    p = means @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    z = np.where(p[:, 2] > camera.near, p[:, 2], 1.0)  # the others are culled below
    left, right, top, bottom = camera.limits()
    tan_x, tan_y = np.clip(p[:, 0] / z, left, right), np.clip(p[:, 1] / z, top, bottom)
    jacobian = np.zeros((len(z), 2, 3))
    jacobian[:, 0, 0], jacobian[:, 0, 2] = camera.fx / z, -camera.fx * tan_x / z
    jacobian[:, 1, 1], jacobian[:, 1, 2] = camera.fy / z, -camera.fy * tan_y / z
    root = jacobian @ camera_from_world[:3, :3] @ (rotations(wxyz) * scales[:, None, :])
    covariance = root @ root.transpose(0, 2, 1) + low_pass * np.eye(2)  # (N, 2, 2) px^2
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
    width, height = size
    x, y = np.arange(width) + 0.5, np.arange(height)[:, None] + 0.5
    image, transmittance = np.zeros((3, height, width)), np.ones((height, width))
    for i in np.argsort(depth, kind="stable"):
        mean_x, mean_y, a, b, c, opacity, *rgb, extent_x, extent_y, power_threshold = record[i]
        if not extent_x > 0:
            continue
        columns = slice(*np.clip(np.floor([mean_x - extent_x, mean_x + extent_x + 2]), 0, width)
                        .astype(int))  # fmt: skip
        rows = slice(*np.clip(np.floor([mean_y - extent_y, mean_y + extent_y + 2]), 0, height)
                     .astype(int))  # fmt: skip
        dx, dy = x[columns] - mean_x, y[rows] - mean_y
        r = a * dx * dx + 2 * b * dx * dy + c * dy * dy
        alpha = np.where(r <= power_threshold, np.minimum(MAX_ALPHA, opacity * np.exp(-r / 2)), 0)
        weight = alpha * transmittance[rows, columns]
        image[:, rows, columns] += np.multiply.outer(rgb, weight)
        transmittance[rows, columns] -= weight
    return image + transmittance * np.asarray(background)[:, None, None], transmittance


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
