"""pack: splats as a model decodes them -> their part of the arena that project_arena draws."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "pack.cl"
GROUP = 64


def pack(
    device: Device,
    splats: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    start: int,
    mean_opacity: "Array",
    covariance: "Array",
) -> None:
    """Writes rows start... of mean_opacity (N, 4) and covariance (N, 8), object frame.

    splats: means (n, 3) and scales (n, 3) metres, wxyz (n, 4) of any length, opacity (n,).
    """
    parts = [device.upload(np.asarray(part, np.float32)) for part in splats]
    kernel = device.program(KERNEL)["pack"]
    count = len(splats[0])
    device.launch(kernel, count, GROUP, count, start, *parts, mean_opacity, covariance)
