"""shade_sh: spherical harmonics of degree 0 to 3 -> the colour of every splat towards one eye."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.paging.pages import PAGE

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "colors" / "shade_sh.cl"
LANES = 8  # splats a block
RUN = 32  # blocks a work-item
UPLOADED = 1 << 16  # splats at a time, a multiple of LANES


def upload_sh(device: Device, sh: np.ndarray) -> "Array":
    """The coefficients (n, M, 3) as shade_sh reads them: (blocks, 3 M, 8) on the device."""
    count, coefficients = sh.shape[:2]
    width = 3 * coefficients
    array = device.empty((-(-count // LANES), width, LANES))
    for first in range(0, count, UPLOADED):  # in parts: a scene is large, and it is here twice
        rows = np.reshape(sh[first : first + UPLOADED], (-1, width))
        blocks = -(-len(rows) // LANES)
        if len(rows) % LANES:
            rows = np.pad(rows, ((0, blocks * LANES - len(rows)), (0, 0)))
        part = rows.reshape(blocks, LANES, width).transpose(0, 2, 1)
        start = first // LANES
        array[start : start + blocks].set(np.ascontiguousarray(part, np.float32))
    return array


def shade_sh(
    device: Device,
    sh: "Array",
    eye: np.ndarray,
    rows: slice,
    mean_opacity: "Array",
    color: "Array",
    seen: np.ndarray | None = None,
) -> None:
    """Writes `rows` (a plain slice) of color (N, 4): max(0, 0.5 + basis(mean - eye) . sh).

    sh: from upload_sh, of as many splats; eye (3,) in the object frame; mean_opacity (N, 4) holds
    the means.  seen (n,) bool: where False the colour may stay what it was.
    """
    blocks, width = sh.shape[:2]
    count = rows.stop - rows.start
    wanted = None
    if seen is not None and blocks:
        whole = np.zeros(blocks * LANES, bool)
        whole[:count] = seen
        wanted = device.constants((whole.view(np.uint64) != 0).view(np.uint8))  # LANES bytes each
    kernel = device.program(KERNEL, COEFFICIENTS=width // 3)["shade_sh"]
    x, y, z = (float(v) for v in eye)
    device.launch(
        kernel, -(-blocks // RUN), 1,
        count, rows.start, RUN, x, y, z, mean_opacity, sh, wanted, None, None, color,
    )  # fmt: skip


def shade_pages(
    device: Device, sh: "Array", eye: np.ndarray, start: int, pages: tuple[np.ndarray, np.ndarray],
    mean_opacity: "Array", color: "Array",
) -> None:  # fmt: skip
    """The same of pages: of an arena (n,) whose splats `sh` has, into pages that are drawn (n,).

    Both begin at row `start`, of mean_opacity (N, 4) and of color (M, 4).
    """
    stored, drawn = pages
    if len(stored):
        kernel = device.program(KERNEL, COEFFICIENTS=sh.shape[1] // 3, PAGED=1, PAGE=PAGE)
        lists = [device.constants(np.asarray(each, np.int32)) for each in (stored, drawn)]
        x, y, z = (float(v) for v in eye)
        count = PAGE * len(stored)
        device.launch(
            kernel["shade_sh"], -(-count // (LANES * RUN)), 1,
            count, start, RUN, x, y, z, mean_opacity, sh, None, *lists, color,
        )  # fmt: skip
