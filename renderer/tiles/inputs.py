"""What blending of depth left on the OpenCL device, as pictures in memory; row 0 on top."""

from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles, bin_tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import TILE, Camera, Projected
from shapeshift.rasterizer.project_arena import Limits
from shapeshift.rasterizer.resolve import Behind
from shapeshift.rasterizer.surface import (
    DepthFrame,
    rasterize_depth,
    resized_records,
    surface_arena,
)
from shapeshift.renderer.foveation import hidden_tiles
from shapeshift.renderer.resolution import scaled
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.surface import Surface
from shapeshift.scene.appearance import Background, Color, Sky, up_of_eye
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from pyopencl.array import Array

    from shapeshift.rasterizer.pages import Arena


def blend_depth(
    device: Device, arena: "Arena", world_from_objects: np.ndarray,
    projected: Projected, tiles: Tiles, view: View,
) -> DepthFrame:  # fmt: skip
    """Depth, and normals in place of colours, which the records lose.

    arena: mean_opacity, covariance, object_index, pages.
    """
    camera = camera_of(view)
    opacity, covariance, object_index, pages = arena
    surfaces = surface_arena(
        device, opacity, covariance, object_index, world_from_objects, camera, projected, pages
    )
    return rasterize_depth(device, projected, tiles, surfaces, view.size)


def in_fewer_pixels(
    device: Device, projected: Projected, tiles: Tiles, view: View, part: float
) -> tuple[Projected, Tiles, View]:
    """What was projected and put into lists, in `part` of the view's width and height: the same
    splats in the same order.
    """
    small = scaled(view, part)
    if small is view:
        return projected, tiles, view
    projected = resized_records(device, projected, view.size, small.size)
    return projected, bin_view(device, projected, small, tiles.order), small


def depth_pictures(
    device: Device, arena: "Arena", world_from_objects: np.ndarray,
    projected: list[Projected], tiles: list[Tiles], views: list[View], part: float,
) -> list[np.ndarray]:  # fmt: skip
    """(H, W, 4) of each view, in `part` of its width and height."""
    pictures = []
    for drawn in zip(projected, tiles, views, strict=True):
        seen = in_fewer_pixels(device, *drawn, part)
        blended = blend_depth(device, arena, world_from_objects, *seen)
        pictures.append(depth_picture(device, blended))
    return pictures


def depth_picture(device: Device, blended: DepthFrame) -> np.ndarray:
    """(H, W, 4) float32: metres along the view times coverage, 0, 0, coverage."""
    metres = device.download(blended.metres)
    picture = np.zeros((*metres.shape, 4), np.float32)
    picture[..., 0] = metres
    picture[..., 3] = 1 - device.download(blended.frame.transmittance)
    return picture


def surface_picture(device: Device, blended: DepthFrame) -> Surface:
    """Depth, normals and coverage."""
    normal = device.download(blended.frame.image)
    transmittance = device.download(blended.frame.transmittance)
    metres = device.download(blended.metres)
    return Surface(metres, np.ascontiguousarray(np.moveaxis(normal, 0, 2)), 1 - transmittance)


# Views, limits and backgrounds as rasterizer/ takes them; rows of its arrays, both ways.


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
