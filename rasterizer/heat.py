"""heat: what value stops have in the colours of splats, apart from what the other stops have."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "colors" / "heat.cl"
GROUP = 64


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
        device.program(KERNEL)["add_heat"], count, GROUP,
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
            device.program(KERNEL)["blend_heat"], count, GROUP,
            count, rows.start, int(into_color), heat, color,
        )  # fmt: skip


def compile_heat(device: Device, splats: int) -> None:
    """Compiles the kernels above for so many splats, and writes nothing.

    A driver may compile when a kernel is launched first (PoCL does, one binary up to 65,535 items
    and another one beyond): 200 ms that are better spent while a scene opens than in a frame.
    """
    kernels = device.program(KERNEL)
    nothing = device.empty((1, 4))
    weights = device.constants(np.zeros(1, np.float32))
    device.launch(
        kernels["add_heat"], splats, GROUP, 0, 0, 1, 1, None, weights, nothing, nothing
    )  # fmt: skip
    device.launch(kernels["blend_heat"], splats, GROUP, 0, 0, 0, nothing, nothing)
    device.queue.finish()
