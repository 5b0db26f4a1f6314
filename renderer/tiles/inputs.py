"""Views, limits and backgrounds as rasterizer/ takes them; rows of its arrays, both ways."""

from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles, bin_tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import TILE, Camera, Projected
from shapeshift.rasterizer.project_arena import Limits
from shapeshift.rasterizer.resolve import Behind
from shapeshift.renderer.hidden import hidden_tiles
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import Background, Color, Sky, up_of_eye
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from pyopencl.array import Array


def behind(background: Background, view: View) -> Behind | Color:
    """One colour, or a sky as a view sees it."""
    if not isinstance(background, Sky):
        return background
    colors = (background.zenith, background.horizon, background.ground)
    return Behind(colors, up_of_eye(view), view.tangents)


def camera_of(view: View) -> Camera:
    """The view as rasterizer/ takes it."""
    return Camera(*view.pinhole(), view.size, view.near, view.widest_tangents())


def bin_view(device: Device, projected: Projected, view: View, order: "Array") -> Tiles:
    """The lists of a view in a given order; those of tiles that nobody sees are empty."""
    hidden = hidden_tiles(view, TILE)
    return bin_tiles(device, projected, view.size, order=order, hidden=hidden)


def limits_of(settings: RenderSettings) -> Limits:
    """The culls of the settings as projection takes them."""
    return Limits(
        settings.min_alpha,
        settings.max_pixels,
        settings.max_distance,
        settings.min_pixels,
        settings.fade,
        settings.low_pass,
    )


def read_rows(device: Device, rows: slice, *arrays: "Array") -> tuple[np.ndarray, ...]:
    """Copies of the same rows of some arrays (N, w)."""
    if rows.start == rows.stop:  # OpenCL has no buffers of nothing
        return tuple(np.zeros((0, array.shape[1]), np.float32) for array in arrays)
    return tuple(device.download(array[rows]).copy() for array in arrays)


def write_rows(rows: slice, *pairs: "tuple[Array, np.ndarray | None]") -> None:
    """Replaces these rows of arrays (N, w); None: they stay."""
    for array, given in pairs if rows.start < rows.stop else ():
        if given is not None:
            array[rows].set(np.ascontiguousarray(given, np.float32))
