"""grade: the appearance of an object, on its decoded colours."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "colors" / "grade.cl"
GROUP = 64


def grade_color(
    device: Device, rows: slice, color: "Array", gain: np.ndarray, power: float
) -> None:
    """Makes `rows` (a plain slice) of color (N, 4) their (gain c) ^ power; gain (3,)."""
    count = rows.stop - rows.start
    if count:
        device.launch(
            device.program(KERNEL)["grade"], count, GROUP,
            count, rows.start, *(float(g) for g in gain), float(power), color,
        )  # fmt: skip
