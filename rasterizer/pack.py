"""pack: splats as a model decodes them -> their part of the arena that project_arena draws."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "pack.cl"
RUN = 512  # splats a work-item
GROUP = 64


def pack(
    device: Device,
    splats: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    start: int,
    mean_opacity: "Array",
    covariance: "Array",
) -> None:
    """Writes rows start... of mean_opacity (N, 4) and covariance (N, 8), object frame.

    splats: means (n, 3) and scales (n, 3) metres, wxyz (n, 4) of any length, opacity (n,).  Their
    memory is read where it lies: it has to stay until the queue is finished.
    """
    count = len(splats[0])
    if count:
        parts = [device.shared(np.ascontiguousarray(part, np.float32)) for part in splats]
        device.launch(
            device.program(KERNEL)["pack"], -(-count // RUN), 1,
            count, start, RUN, *parts, mean_opacity, covariance,
        )  # fmt: skip
        device.queue.finish()


def pack_opacity(device: Device, opacity: np.ndarray, start: int, mean_opacity: "Array") -> None:
    """Writes the opacities (n,) of rows start... alone."""
    count = len(opacity)
    if count:
        given = device.shared(np.ascontiguousarray(opacity, np.float32))
        kernel = device.program(KERNEL)["pack_opacity"]
        device.launch(kernel, count, GROUP, count, start, given, mean_opacity)
        device.queue.finish()
