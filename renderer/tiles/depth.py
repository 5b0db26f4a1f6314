"""What blending of depth left on the OpenCL device, as pictures in memory; row 0 on top."""

from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import Projected
from shapeshift.rasterizer.surface import (
    DepthFrame,
    rasterize_depth,
    resized_records,
    surface_arena,
)
from shapeshift.renderer.resample import scaled
from shapeshift.renderer.surface import Surface
from shapeshift.renderer.tiles.inputs import bin_view, camera_of
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.rasterizer.paging.pages import Arena


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
