"""quantize_keys: exact sort keys -> 65535 steps of the range that a frame uses."""

from pathlib import Path

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import TileScratch

KERNEL = Path(__file__).parent / "kernels" / "quantize_keys.cl"


def quantize_keys(device: Device, scratch: TileScratch) -> None:
    """Replaces the keys that project_arena entered; sort_order then puts a step in order of index.

    Saves nothing here: two passes sort the exact keys of most frames, and this is one more.  It is
    for pictures that equal those of a GPU with 16-bit keys.
    """
    status = device.download(scratch.status)
    if not status[:, 0].any():
        return
    least, most = status[:, 2].min(), status[:, 3].max()
    device.launch(
        device.program(KERNEL)["quantize_keys"], len(status), 1,
        scratch.chunk, int(least), int(most), scratch.pairs, scratch.table,
        scratch.status,
    )  # fmt: skip
    device.queue.finish()
