"""Lenses by the formulas of their makers' documentation: points before a camera -> pixels."""

import numpy as np


def brown(xyz: np.ndarray, params: tuple) -> np.ndarray:
    """(N, 2) pixels of points: the formula of OpenCV's documentation, radial and tangential."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = params
    x, y = xyz[:, 0] / xyz[:, 2], xyz[:, 1] / xyz[:, 2]
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([fx * u + cx, fy * v + cy], axis=1)


def fisheye(xyz: np.ndarray, params: tuple) -> np.ndarray:
    fx, fy, cx, cy, *k = params
    r = np.hypot(xyz[:, 0], xyz[:, 1])
    theta = np.arctan2(r, xyz[:, 2])
    bent = theta * (1 + sum(c * theta ** (2 * i + 2) for i, c in enumerate(k)))
    return xyz[:, :2] / r[:, None] * bent[:, None] * (fx, fy) + (cx, cy)


def eighth_power(xyz: np.ndarray, params: tuple) -> np.ndarray:
    """Brown's polynomial with nerfstudio's k4: brown, and k4 r^8 more of the tangents."""
    fx, fy, *_, k4 = params
    xy = xyz[:, :2] / xyz[:, 2:]
    r8 = (xy**2).sum(axis=1, keepdims=True) ** 4
    return brown(xyz, params[:-1]) + k4 * r8 * xy * (fx, fy)


def rational(xyz: np.ndarray, params: tuple) -> np.ndarray:
    """OpenCV's eight-number lens without tangential ones: a quotient of two polynomials."""
    fx, fy, cx, cy, k1, k2, k3, k4, k5, k6 = params
    xy = xyz[:, :2] / xyz[:, 2:]
    r2 = (xy**2).sum(axis=1, keepdims=True)
    over = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    return xy * over * (fx, fy) + (cx, cy)


def leaning_fisheye(xyz: np.ndarray, params: tuple) -> np.ndarray:
    """nerfstudio's fisheye with p1 and p2: Brown's lens, of angles where that has tangents."""
    r = np.hypot(xyz[:, 0], xyz[:, 1])
    angles = xyz[:, :2] * (np.arctan2(r, xyz[:, 2]) / r)[:, None]
    return eighth_power(np.column_stack([angles, np.ones(len(angles))]), params)


KEYS = ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
FISH = ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4")
