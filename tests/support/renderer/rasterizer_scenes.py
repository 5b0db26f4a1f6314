"""Splats, cameras and one shared device for the tests of rasterizer/."""

from functools import cache

import numpy as np

from shapeshift.rasterizer.device import Device, open_device
from shapeshift.rasterizer.project import Camera

GROUPS = ("means", "scales", "wxyz", "opacity", "color")


@cache
def device() -> Device:
    return open_device()


def random_splats(count: int, seed: int = 0, scale: float = 0.06, spread: float = 0.5) -> list:
    """means, scales, wxyz (any length), opacity, color: float32, around the origin."""
    rng = np.random.default_rng(seed)
    return [
        a.astype(np.float32)
        for a in (
            rng.normal(size=(count, 3)) * spread,
            np.exp(rng.normal(size=(count, 3)) * 0.5) * scale,
            rng.normal(size=(count, 4)) * 2,
            rng.uniform(0.03, 0.98, count),
            rng.uniform(size=(count, 3)),
        )
    ]


def off_centre_camera(size: tuple[int, int], near: float = 0.05) -> Camera:
    """3 m in front of the origin, turned, with the centre far from the middle of the image."""
    turn = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3] = turn
    camera_from_world[2, 3] = 3
    width, height = size
    focal = 1.2 * max(size)
    return Camera(
        camera_from_world, focal, 1.1 * focal, 0.38 * width, 0.61 * height + 0.25, size, near
    )


def upload(splats: list) -> list:
    return [device().upload(a) for a in splats]


def as_double(splats: list) -> list:
    return [a.astype(np.float64) for a in splats]


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(10 * np.log10(1 / max(np.mean((a - b) ** 2), 1e-30)))


def arena(splats: list) -> list:
    """The same splats as project_arena takes them, on the device, all of object 0."""
    from shapeshift.rasterizer.reference import rotations

    means, scales, wxyz, opacity, color = splats
    root = rotations(wxyz.astype(np.float64)) * scales[:, None, :]
    full = root @ root.transpose(0, 2, 1)
    covariance = np.zeros((len(means), 8), np.float32)
    covariance[:, :6] = full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    packed = np.column_stack([means, opacity]), covariance, np.column_stack([color, opacity])
    return [device().upload(a.astype(np.float32)) for a in packed] + [
        device().upload(np.zeros(len(means), np.int32))
    ]
