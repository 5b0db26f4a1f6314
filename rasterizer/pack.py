"""pack: splats as a model decodes them -> their part of the arena that project_arena draws."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device

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
    """Writes the opacities (n,) of rows start... of mean_opacity (N, 4) alone."""
    _copy(device, "pack_opacity", opacity, start, mean_opacity)


def pack_color(device: Device, given: np.ndarray, start: int, color: "Array") -> None:
    """Writes colours (n, 3) into rows start... of color (N, 4)."""
    _copy(device, "pack_color", given, start, color)


def _copy(device: Device, kernel: str, given: np.ndarray, start: int, into: "Array") -> None:
    if len(given):
        host = device.shared(np.ascontiguousarray(given, np.float32))
        program = device.program(KERNEL)
        device.launch(program[kernel], len(given), GROUP, len(given), start, host, into)
        device.queue.finish()
