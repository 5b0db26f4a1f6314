"""overdraw: how many splats each pixel blends; a debug picture, not a frame's pass."""

from pathlib import Path

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import Projected

KERNEL = Path(__file__).parent / "kernels" / "overdraw.cl"
GROUP = 64  # work-items


def count_overdraw(device: Device, projected: Projected, size: tuple[int, int]) -> np.ndarray:
    """(H, W) int32, row 0 on top, of splats that project or project_arena left; no early stop."""
    width, height = size
    number = device.zeros((height, width), np.int32)
    count = projected.record.shape[0]
    kernel = device.program(KERNEL)["overdraw"]
    device.launch(kernel, count, GROUP, count, width, height, projected.record, number)
    return device.download(number)
