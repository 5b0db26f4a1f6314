"""heat: what thermal stops have in the colours of splats, apart from what the other stops have."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "heat.cl"
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
    """Heat of `rows` (a plain slice) of the arena from color (N, 4), a thermal stop's as decoded.

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
