"""surface: how deep splats lie under their pixels: depth pictures, normals, and gradients of both.

Depth is where a ray is halfway through a splat's ellipsoid, not the depth of its centre: a wall of
flat splats is a wall from the side, too.  kernels/common/surface.cl has the formula.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.pages import PageMap, defines_of_pages
from shapeshift.rasterizer.project import GROUP, RECORD, WIDTH, Camera, Projected
from shapeshift.rasterizer.raster import FORMS, RasterFrame, defines_of, room_for_blocks

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels"
SURFACE = 8  # floats a splat, as kernels/common/surface.cl names them
WITH_DEPTH = {"SURFACE": 1}  # what the kernels of raster.py are built with for it


@dataclass(frozen=True)
class DepthFrame:
    """A RasterFrame with the depth that was blended into it."""

    frame: RasterFrame
    surface: "Array"  # (N, 8) float32
    metres: "Array"  # (H, W) float32, the sum of alpha T z: depth times coverage; or the quantile


def surface(
    device: Device, means, scales, wxyz, camera: Camera, projected: Projected,
    form: str | None = None,
) -> "Array":  # fmt: skip
    """(N, 8) float32 of the splats that `project` left on the screen; device arrays."""
    count = means.shape[0]
    out, wide = device.empty((count, SURFACE)), WIDTH[form or device.kind]
    kernel = device.program(KERNELS / "surface.cl", WIDTH=wide)["surface"]
    device.launch(
        kernel, -(-count // wide), GROUP,
        count, float(camera.near), device.constants(camera.packed()), means, scales, wxyz,
        projected.record, out,
    )  # fmt: skip
    return out


def surface_backward(
    device: Device, means, scales, wxyz, camera: Camera, projected: Projected, surfaces,
    grad_surface, grads: tuple, form: str | None = None,
) -> None:  # fmt: skip
    """Adds to grads (means, scales, wxyz), as project_backward gave them, what depth says."""
    count, wide = means.shape[0], WIDTH[form or device.kind]
    kernel = device.program(KERNELS / "surface.cl", WIDTH=wide)["surface_backward"]
    device.launch(
        kernel, -(-count // wide), GROUP,
        count, float(camera.near), device.constants(camera.packed()), means, scales, wxyz,
        projected.record, surfaces, grad_surface, *grads,
    )  # fmt: skip


def resized_records(
    device: Device, projected: Projected, size: tuple[int, int], new: tuple[int, int]
) -> Projected:
    """What was projected into a picture of `size` (width, height) pixels, in one of `new`."""
    count = projected.record.shape[0]
    record = device.empty((count, RECORD))
    kernel = device.program(KERNELS / "resize_records.cl")["resize_records"]
    across, along = new[0] / size[0], new[1] / size[1]
    device.launch(kernel, count, GROUP, count, across, along, projected.record, record)
    return replace(projected, record=record, scratch=None)


def surface_arena(
    device: Device, mean_opacity, covariance, object_index, world_from_object, camera: Camera,
    projected: Projected, pages: PageMap | None = None,
) -> "Array":  # fmt: skip
    """(N, 8) float32 of an arena as project_arena takes it; the records' colours become normals.

    Normals have eye axes (x right, y up, z towards the eye) and length 1.
    """
    poses = np.reshape(np.asarray(world_from_object, np.float64), (-1, 4, 4))
    rows = np.asarray(camera.camera_from_world, np.float64) @ poses  # (O, 4, 4)
    count = object_index.shape[0]
    out = device.empty((count, SURFACE))
    kernel = device.program(KERNELS / "surface_arena.cl", **defines_of_pages(pages))[
        "surface_arena"
    ]
    device.launch(
        kernel, count, GROUP,
        count, float(camera.near), device.constants(camera.packed()),
        device.upload(np.ascontiguousarray(rows[:, :3], np.float32).ravel()), mean_opacity,
        covariance, object_index, pages and pages.sources, projected.record, out,
    )  # fmt: skip
    return out


def rasterize_depth(
    device: Device,
    projected: Projected,
    tiles: Tiles,
    surfaces: "Array",
    size: tuple[int, int],
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    form: str | None = None,
    light_left: float | None = None,
) -> DepthFrame:
    """What `rasterize` draws, and depth.

    light_left: in place of its sum the depth behind which no more than that share of the light is
    left, 0 where there is none: thin fog before a wall does not move it.  It has no gradient.
    """
    width, height = size
    number = tiles.grid[0] * tiles.grid[1]
    image, transmittance = device.empty((3, height, width)), device.empty((height, width))
    ends, metres = device.empty(number, np.int32), device.empty((height, width))
    form = form or device.kind
    file, group, _ = FORMS[form]
    blocks = room_for_blocks(device, tiles, form)
    defines = (
        WITH_DEPTH
        | ({} if light_left is None else {"LIGHT_LEFT": float(light_left)})
        | defines_of(device, form)
    )
    kernel = device.program(file, **defines)["rasterize"]
    device.launch(
        kernel, number * group, group,
        width, height, tiles.grid[0], tiles.starts, tiles.intersections, projected.record,
        *(float(c) for c in background), image, transmittance, ends, surfaces, metres,
        *([] if blocks is None else [blocks]),
    )  # fmt: skip
    return DepthFrame(RasterFrame(image, transmittance, ends, blocks), surfaces, metres)


def rasterize_depth_backward(
    device: Device,
    projected: Projected,
    tiles: Tiles,
    drawn: DepthFrame,
    grad_image: "Array",
    grad_transmittance: "Array",
    grad_metres: "Array",
    form: str | None = None,
    absolute: bool = True,
    error: "Array | None" = None,
    weight: bool = False,
) -> tuple["Array", "Array"]:
    """Gradients of the records (N, 12), as rasterize_backward gives them, and of the surfaces."""
    count, frame = projected.depth.shape[0], drawn.frame
    _, height, width = frame.image.shape
    first_slot = tiles.slots(device)
    slots, depth_slots = (tiles.room(device, first_slot, n) for n in (RECORD, SURFACE))
    form = form or device.kind
    file, _, group = FORMS[form]
    defines = WITH_DEPTH | defines_of(device, form)
    defines |= {"ABSOLUTE": 1} if absolute and error is None else {}
    defines |= {"SHARE": 1} if error is not None else {}
    defines |= {"WEIGHT": 1} if weight else {}
    device.launch(
        device.program(file, **defines)["rasterize_backward"],
        tiles.grid[0] * tiles.grid[1] * group, group,
        width, height, tiles.grid[0], tiles.starts, frame.tile_ends, tiles.intersections,
        tiles.tile_bounds, first_slot, projected.record, frame.image, frame.transmittance,
        grad_image, grad_transmittance, True, slots, *([] if error is None else [error]),
        drawn.surface, drawn.metres, grad_metres, depth_slots, *frame.for_backward(form),
    )  # fmt: skip
    grad_record, grad_surface = device.empty((count, RECORD)), device.empty((count, SURFACE))
    for name, given, made in (
        ("sum_slots", slots, grad_record), ("sum_surface", depth_slots, grad_surface),
    ):  # fmt: skip
        kernel = device.program(KERNELS / f"{name}.cl")[name]
        device.launch(kernel, count, GROUP, count, tiles.tile_bounds, first_slot, given, made)
    return grad_record, grad_surface
