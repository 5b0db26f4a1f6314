"""resolve: a drawn image -> bytes for GL or a window: background, palette, 8 bits, overlay."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device

if TYPE_CHECKING:
    import pyopencl as cl

KERNEL = Path(__file__).parent / "kernels" / "resolve.cl"


@dataclass(frozen=True)
class Behind:
    """A sky, as it is seen: colours from horizon to zenith, or to the ground, with the sine of the
    elevation.
    """

    colors: Sequence[Sequence[float]]  # zenith, horizon, ground: display sRGB
    up: np.ndarray  # (3,) the world's +Y along the axes of the eye
    tangents: tuple[float, float, float, float]  # left, right, down, up


@dataclass(frozen=True)
class WindowOverlay:
    """What is laid over a window's picture."""

    layer: np.ndarray  # (H, W, 4) uint8, premultiplied; blue first and row 0 on top
    boxes: np.ndarray  # (B, 4) int32: left, top, right, low of where it is; no pixel is in two


NO_PALETTE = np.zeros((1, 3), np.float32)  # its place in the kernel's arguments


def resolve(
    device: Device,
    image: np.ndarray,
    background: tuple[float, float, float] | Behind,
    palette: np.ndarray | None = None,
    heat: np.ndarray | None = None,
    *,
    as_window: bool = False,
    overlay: WindowOverlay | None = None,
) -> np.ndarray:
    """(H, W, 4) uint8, opaque, of image (H, W, 4) float32: red first and row 0 at the bottom, as GL
    wants it, or as a window has it in memory: blue first and row 0 on top.

    image, and its heat (H, W, 2): as rasterize_rgba gives them.  palette (256, 3): makes
    colours of the heat, where there is any, else of the image.  Read only; on a CPU it is the
    device's own memory, which is reused when the array goes.  overlay: of a window's picture.
    """
    height, width = image.shape[:2]
    pixels = device.empty((height, width, 4), np.uint8)
    mixed = palette is not None
    colors = np.asarray(palette if mixed else NO_PALETTE, np.float32)
    beside = None if heat is None or not mixed else device.shared(heat)
    table = np.zeros((2, len(colors), 4), np.float32)  # colours, differences
    table[0, :, :3], table[1, :-1, :3] = colors, np.diff(colors, axis=0)
    plain, sky = sky_rows(device, background, (width, height))
    kernels = device.program(KERNEL)
    device.launch(
        kernels["resolve"], height, 1,
        width, height, *(float(c) for c in plain), int(mixed),
        device.shared(image), device.constants(table), pixels, beside, sky, int(as_window),
    )  # fmt: skip
    if overlay is not None and len(overlay.boxes):
        assert as_window and overlay.layer.shape == pixels.shape, "the overlay is a window's"
        boxes = device.constants(np.asarray(overlay.boxes, np.int32))
        layer = device.shared(overlay.layer)
        over = (width, len(overlay.boxes), boxes, layer, pixels)
        device.launch(kernels["lay_over"], height, 1, *over)
    return device.view(pixels)


def sky_rows(
    device: Device, background: tuple[float, float, float] | Behind, size: tuple[int, int]
) -> "tuple[Sequence[float], cl.Buffer | None]":
    """The colour behind everything, and of a sky what the kernel needs besides: (5, 4) floats.

    Of a pixel (x, y) from the upper left its direction along the axes of the eye is
    rows[3] + (x rows[4].x, y rows[4].y, 0), and that times rows[2] the sine of its elevation.
    """
    if not isinstance(background, Behind):
        return background, None
    left, right, low, high = background.tangents
    zenith, horizon, ground = (np.array(color) for color in background.colors)
    across, along = (right - left) / size[0], (low - high) / size[1]
    table = np.zeros((5, 4), np.float32)
    table[0, :3], table[1, :3], table[2, :3] = zenith - horizon, ground - horizon, background.up
    table[3, :3] = (left + across / 2, high + along / 2, -1)  # the middle of the first pixel
    table[4, :2] = across, along
    return tuple(horizon), device.constants(table)
