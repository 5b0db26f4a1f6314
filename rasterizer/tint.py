"""tint: colours -> mixed towards a palette, each splat by the weight of its anchor."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "tint.cl"
GROUP = 64


def tint(
    device: Device, palette: np.ndarray, weights: np.ndarray, rows: slice, color: "Array"
) -> None:
    """Changes `rows` (a plain slice) of color (N, 4), display sRGB.

    palette (256, 3): by luminance; weights (A,) 0..1, one for as many splats side by side each.
    """
    count = rows.stop - rows.start
    if not count:
        return
    parts = [device.constants(np.ascontiguousarray(a, np.float32)) for a in (palette, weights)]
    kernel = device.program(KERNEL)["tint"]
    device.launch(kernel, count, GROUP, count, rows.start, count // len(weights), *parts, color)
    device.queue.finish()
