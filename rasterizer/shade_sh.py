"""shade_sh: spherical harmonics of degree 0 to 3 -> the colour of every splat towards one eye."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "shade_sh.cl"
GROUP = 64


def upload_sh(device: Device, sh: np.ndarray) -> "Array":
    """The coefficients (n, M, 3) as shade_sh reads them: (M * 3, n) on the device."""
    return device.upload(np.asarray(sh, np.float32).reshape(len(sh), 3 * sh.shape[1]).T)


def shade_sh(
    device: Device, sh: "Array", eye: np.ndarray, start: int, mean_opacity: "Array", color: "Array"
) -> None:
    """Writes rows start... of color (N, 4): max(0, 0.5 + basis(mean - eye) . sh).

    sh: from upload_sh; eye (3,) in the object frame; mean_opacity (N, 4) holds the means.
    """
    kernel = device.program(KERNEL, COEFFICIENTS=sh.shape[0] // 3)["shade_sh"]
    count, (x, y, z) = sh.shape[1], (float(v) for v in eye)
    device.launch(kernel, count, GROUP, count, start, x, y, z, mean_opacity, sh, color)
