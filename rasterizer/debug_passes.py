"""splat_edges, overdraw: debug pictures, no passes of a frame.

splat_edges: splats as ellipses, points or rings.
overdraw: how many splats each pixel blends.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import Projected

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels"
GROUP = 64  # work-items
KINDS = ("ellipses", "points", "rings")
EDGE_POWER = 4.0  # squared sigmas from the middle to the edge
POINT_PX, BAND_PX = 1.5, 1.25  # radius of a point, breadth of a ring
CONIC, COLOR = slice(2, 5), slice(6, 9)  # of a record (common/record.cl)
POWER_THRESHOLD = 11
NOBODY = 2**31 - 1


def draw_edges(
    device: Device, projected: Projected, order: "Array", size: tuple[int, int], kind: str
) -> np.ndarray:
    """(H, W, 4) float32 display sRGB and coverage, row 0 on top, of splats of project_arena.

    order: splats from near to far.  Ellipses are darker towards their edge.
    """
    width, height = size
    front = device.upload(np.full((height, width), NOBODY, np.int32))
    kernel = device.program(KERNELS / "splat_edges.cl", KIND=KINDS.index(kind))["splat_edges"]
    count = order.shape[0]
    device.launch(
        kernel, count, GROUP, count, width, height, EDGE_POWER, POINT_PX, BAND_PX,
        projected.record, order, front,
    )  # fmt: skip
    found = device.download(front)
    seen = found != NOBODY
    rows = device.download(projected.record)[device.download(order)[found[seen]]]  # (n, 12)
    image = np.zeros((height, width, 4), np.float32)
    colors = rows[:, COLOR]
    if kind == "ellipses":
        y, x = np.nonzero(seen)
        dx, dy = x + 0.5 - rows[:, 0], y + 0.5 - rows[:, 1]
        a, b, c = rows[:, CONIC].T
        power = a * dx * dx + 2 * b * dx * dy + c * dy * dy
        edge = np.minimum(EDGE_POWER, rows[:, POWER_THRESHOLD])
        colors = colors * (1 - 0.5 * np.clip(power / edge, 0, 1))[:, None]
    image[seen, :3], image[seen, 3] = colors, 1
    return image


def count_overdraw(device: Device, projected: Projected, size: tuple[int, int]) -> np.ndarray:
    """(H, W) int32, row 0 on top, of splats that project or project_arena left; no early stop."""
    width, height = size
    number = device.zeros((height, width), np.int32)
    count = projected.record.shape[0]
    kernel = device.program(KERNELS / "overdraw.cl")["overdraw"]
    device.launch(kernel, count, GROUP, count, width, height, projected.record, number)
    return device.download(number)
