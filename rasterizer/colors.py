"""shade_sh, heat, grade: what gives splats of the arena their colours.

shade_sh: spherical harmonics of degree 0 to 3 -> the colour of every splat towards one eye.
heat: what value stops have in the colours of splats, apart from what the other stops have.
grade: the appearance of an object, on its decoded colours.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.pages import PAGE

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels" / "colors"
LANES = 8  # splats a block
RUN = 32  # blocks a work-item
GROUP = 64  # of the others
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
    kernel = device.program(KERNELS / "shade_sh.cl", COEFFICIENTS=width // 3)["shade_sh"]
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
        kernel = device.program(
            KERNELS / "shade_sh.cl", COEFFICIENTS=sh.shape[1] // 3, PAGED=1, PAGE=PAGE
        )
        lists = [device.constants(np.asarray(each, np.int32)) for each in (stored, drawn)]
        x, y, z = (float(v) for v in eye)
        count = PAGE * len(stored)
        device.launch(
            kernel["shade_sh"], -(-count // (LANES * RUN)), 1,
            count, start, RUN, x, y, z, mean_opacity, sh, None, *lists, color,
        )  # fmt: skip


def add_heat(
    device: Device,
    weights: np.ndarray,
    rows: slice,
    color: "Array",
    heat: "Array",
    palette: np.ndarray | None = None,
    first: bool = True,
) -> None:
    """Heat of `rows` (a plain slice) of the arena from color (N, 4), a value stop's as decoded.

    heat (N, 4): weight * luminance, 0, 0, weight; with a palette (256, 3) weight * its colour,
    weight.  weights (n,) 0..1, one for as many splats side by side each.  first: what is there is
    of no use, else it is added to.
    """
    count = rows.stop - rows.start
    if not count:
        return
    colors = None if palette is None else device.constants(np.asarray(palette, np.float32))
    parts = (colors, device.constants(np.ascontiguousarray(weights, np.float32)))
    device.launch(
        device.program(KERNELS / "heat.cl")["add_heat"], count, GROUP,
        count, rows.start, -(-count // len(weights)), int(first), *parts, color, heat,
    )  # fmt: skip
    device.queue.finish()


def blend_heat(
    device: Device, rows: slice, color: "Array", heat: "Array", into_color: bool = False
) -> None:
    """Leaves of colours (N, 4), just decoded, what heat does not take.

    into_color: adds the heat's own colours, which were made with palettes, and takes the heat away.
    """
    count = rows.stop - rows.start
    if count:
        device.launch(
            device.program(KERNELS / "heat.cl")["blend_heat"], count, GROUP,
            count, rows.start, int(into_color), heat, color,
        )  # fmt: skip


def compile_heat(device: Device, splats: int) -> None:
    """Compiles the kernels above for so many splats, and writes nothing.

    A driver may compile when a kernel is launched first (PoCL does, one binary up to 65,535 items
    and another one beyond): 200 ms that are better spent while a scene opens than in a frame.
    """
    kernels = device.program(KERNELS / "heat.cl")
    nothing = device.empty((1, 4))
    weights = device.constants(np.zeros(1, np.float32))
    device.launch(
        kernels["add_heat"], splats, GROUP, 0, 0, 1, 1, None, weights, nothing, nothing
    )  # fmt: skip
    device.launch(kernels["blend_heat"], splats, GROUP, 0, 0, 0, nothing, nothing)
    device.queue.finish()


def grade_color(
    device: Device, rows: slice, color: "Array", gain: np.ndarray, power: float
) -> None:
    """Makes `rows` (a plain slice) of color (N, 4) their (gain c) ^ power; gain (3,)."""
    count = rows.stop - rows.start
    if count:
        device.launch(
            device.program(KERNELS / "grade.cl")["grade"], count, GROUP,
            count, rows.start, *(float(g) for g in gain), float(power), color,
        )  # fmt: skip
