"""raster: instance lists -> image, and the gradients of an image -> those of the records."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rasterizer.bin import Tiles
from rasterizer.device import Device
from rasterizer.project import RECORD, Projected

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels"


@dataclass(frozen=True)
class Frame:
    """An image on the device and what its backward pass needs."""

    image: "Array"  # (3, H, W) float32 = sum of colours + transmittance * background
    transmittance: "Array"  # (H, W) float32
    tile_ends: "Array"  # (tiles,) int32: where the early stop ended each list


def rasterize(
    device: Device,
    projected: Projected,
    tiles: Tiles,
    size: tuple[int, int],
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Frame:
    """The image of `size` (width, height) pixels over a background colour."""
    width, height = size
    number = tiles.grid[0] * tiles.grid[1]
    image, transmittance = device.empty((3, height, width)), device.empty((height, width))
    ends = device.empty(number, np.int32)
    kernel = device.program(KERNELS / "raster_cpu.cl")["rasterize"]
    device.launch(
        kernel, number, 1,
        width, height, tiles.grid[0], tiles.starts, tiles.instances, projected.record,
        *(float(c) for c in background), image, transmittance, ends,
    )  # fmt: skip
    return Frame(image, transmittance, ends)


def rasterize_rgba(
    device: Device, projected: Projected, tiles: Tiles, size: tuple[int, int]
) -> np.ndarray:
    """(H, W, 4) float32 premultiplied over nothing, alpha = 1 - transmittance, row 0 on top.

    Read only; on a CPU it is the device's own memory, which is reused when the array goes.
    """
    width, height = size
    number = tiles.grid[0] * tiles.grid[1]
    image, ends = device.empty((height, width, 4)), device.empty(number, np.int32)
    kernel = device.program(KERNELS / "raster_cpu.cl", RGBA=1)["rasterize"]
    device.launch(
        kernel, number, 1,
        width, height, tiles.grid[0], tiles.starts, tiles.instances, projected.record,
        0.0, 0.0, 0.0, image, None, ends,
    )  # fmt: skip
    return device.view(image)


def rasterize_backward(
    device: Device,
    projected: Projected,
    tiles: Tiles,
    frame: Frame,
    grad_image: "Array",
    grad_transmittance: "Array | None" = None,
) -> "Array":
    """(N, 12) gradients of the records from those of the image (3, H, W) and transmittance (H, W).

    Slots 9 and 10 hold the sums of the absolute gradients of the mean, for growing.
    """
    count = projected.depth.shape[0]
    _, height, width = frame.image.shape
    first_slot, slots = device.empty(count, np.int32), device.empty((tiles.count, RECORD))
    bin_kernels = device.program(KERNELS / "bin.cl")
    kernels = device.program(KERNELS / "raster_cpu.cl")
    device.launch(bin_kernels["number_slots"], 1, 1, count, tiles.places, first_slot)
    with_transmittance = grad_transmittance is not None
    device.launch(
        kernels["rasterize_backward"], tiles.grid[0] * tiles.grid[1], 1,
        width, height, tiles.grid[0], tiles.starts, frame.tile_ends, tiles.instances, tiles.places,
        first_slot, projected.record, frame.image, frame.transmittance, grad_image,
        grad_transmittance if with_transmittance else frame.transmittance, with_transmittance,
        slots,
    )  # fmt: skip
    grad_record = device.empty((count, RECORD))
    device.launch(
        kernels["sum_slots"], count, 64, count, tiles.places, first_slot, slots, grad_record
    )
    return grad_record
