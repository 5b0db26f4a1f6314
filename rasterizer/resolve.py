"""resolve: a drawn image -> bytes for a window: background, palette, 8 bits, bottom row first."""

from pathlib import Path

import numpy as np

from shapeshift.rasterizer.device import Device

KERNEL = Path(__file__).parent / "kernels" / "resolve.cl"
NO_PALETTE = np.zeros((1, 3), np.float32)  # its place in the kernel's arguments


def resolve(
    device: Device,
    image: np.ndarray,
    background: tuple[float, float, float],
    palette: np.ndarray | None = None,
    heat: np.ndarray | None = None,
) -> np.ndarray:
    """(H, W, 4) uint8, opaque, row 0 at the bottom as GL wants it, of image (H, W, 4) float32.

    image, and its heat (H, W, 2): as rasterize_rgba gives them.  palette (256, 3): makes
    colours of the heat, where there is any, else of the image.  Read only; on a CPU it is the
    device's own memory, which is reused when the array goes.
    """
    height, width = image.shape[:2]
    pixels = device.empty((height, width, 4), np.uint8)
    mixed = palette is not None
    colors = np.asarray(palette if mixed else NO_PALETTE, np.float32)
    beside = None if heat is None or not mixed else device.shared(heat)
    table = np.zeros((2, len(colors), 4), np.float32)  # colours, differences
    table[0, :, :3], table[1, :-1, :3] = colors, np.diff(colors, axis=0)
    device.launch(
        device.program(KERNEL)["resolve"], height, 1,
        width, height, *(float(c) for c in background), int(mixed),
        device.shared(image), device.constants(table), pixels, beside,
    )  # fmt: skip
    return device.view(pixels)
