"""A flat wall whose temperature and depth are known everywhere: 50 + 50 x °C at x metres."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.splats.layers.layer_list import write_layer_list
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.scene.inspection.value_picture import ValuePicture, world_points
from shapeshift.scene.pose import View, look_at, perspective

DC = 0.28209479177387814  # of spherical harmonics of degree 0
RANGE = (0.0, 100.0)  # °C
SPACING_M = 0.01  # of splats: half a degree
HALF_M = (0.6, 0.4)  # of the wall, across and up; it stands at z = 0
STOPS = (
    Stop("RGB", 0.0, "rgb"),
    Stop("Thermal", 1.0, "thermal", "ironbow", RANGE, "°C"),
)


def celsius_at(x_m: np.ndarray | float) -> np.ndarray | float:
    """What the wall has at x metres: a straight line, which blending of splats keeps."""
    return 50 + 50 * x_m


def wall_splats(values: bool) -> PlainSplats:
    """Flat splats: their values in grey, or one colour."""
    x, y = (np.arange(-h, h + 0.001, SPACING_M) for h in HALF_M)
    means = np.stack([*(g.ravel() for g in np.meshgrid(x, y)), np.zeros(len(x) * len(y))], axis=1)
    count = len(means)
    share = celsius_at(means[:, 0]) / 100 if values else np.full(count, 0.3)
    sh = ((share[:, None, None] - 0.5) / DC).repeat(3, axis=2)
    scales = np.tile([0.75 * SPACING_M, 0.75 * SPACING_M, 0.001], (count, 1))
    wxyz = np.tile([1.0, 0, 0, 0], (count, 1))
    arrays = (means, scales, wxyz, np.full(count, 0.99), sh)
    return PlainSplats(*(a.astype(np.float32) for a in arrays))


def write_wall(folder: Path, stops: tuple[Stop, ...] = STOPS) -> Path:
    """The wall as a folder that every command opens."""
    write_layer_list([(stop, wall_splats(stop.is_measured)) for stop in stops], folder)
    return folder


def wall_view(
    eye: tuple[float, float, float] = (0.0, 0.0, 1.5), size: tuple[int, int] = (96, 72)
) -> View:
    """A look at the wall's middle."""
    return View(look_at(eye, (0.0, 0.0, 0.0)), perspective(0.7, size), 0.01, 100.0, size)


def traced(eye=(0, 0, 1.5), size=(96, 72)) -> ValuePicture:
    """The wall by ray tracing: each pixel's ray cut with the plane z = 0."""
    view = wall_view(eye, size)
    rows, columns = np.mgrid[: size[1], : size[0]] + 0.5
    unit = world_points(view, np.stack([columns, rows], axis=2), np.ones(size[::-1]))
    ray = unit - view.world_from_eye.position
    depth = -view.world_from_eye.position[2] / ray[..., 2]  # metres along the view
    points = view.world_from_eye.position + depth[..., None] * ray
    on = (np.abs(points[..., :2]) <= HALF_M).all(axis=2) & (depth > 0)
    values = np.where(on, celsius_at(points[..., 0]), np.nan)
    return ValuePicture(view, values, np.where(on, depth, np.nan), "°C", (0.0, 100.0))
