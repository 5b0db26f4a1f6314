"""raster: intersection lists -> image, and the gradients of an image -> those of the records."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import RECORD, TILE, Projected

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels"
MIN_TRANSMITTANCE = 1e-4  # a pixel with less left is done (3DGS); cannot be seen
# form: kernel file, work-items a tile forward, work-items a tile backward
FORMS = {
    "cpu": (KERNELS / "raster_cpu.cl", 1, 1),
    "gpu": (KERNELS / "raster_gpu.cl", 256, 32),
}


def defines_of(device: Device, form: str) -> dict[str, int]:
    """What both kernels of a form are built with: the CPU's blocks are as its vectors are wide."""
    return {"PIXELS": 16} if form == "cpu" and device.lanes >= 16 else {}


@dataclass(frozen=True)
class RasterFrame:
    """An image on the device and what its backward pass needs."""

    image: "Array"  # (3, H, W) float32 = sum of colours + transmittance * background
    transmittance: "Array"  # (H, W) float32
    tile_ends: "Array"  # (tiles,) int32: where the early stop ended each list
    # (I,) uint32 of the CPU form, which its backward pass goes through: in which blocks of its
    # tile's pixels each intersection was drawn.
    drawn_blocks: "Array | None" = None

    def for_backward(self, form: str) -> list:
        """What the backward kernel of a form takes at its end.

        Raises ValueError where the image is of another form.
        """
        if form != "cpu":
            return []
        if self.drawn_blocks is None:
            raise ValueError("the CPU form goes back through images of the CPU form alone")
        return [self.drawn_blocks]


def room_for_blocks(device: Device, tiles: Tiles, form: str) -> "Array | None":
    """What the CPU form's `rasterize` fills for its backward pass."""
    if form != "cpu":
        return None
    return device.empty(max(1, tiles.intersections.shape[0]), np.uint32)


def rasterize(
    device: Device,
    projected: Projected,
    tiles: Tiles,
    size: tuple[int, int],
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    form: str | None = None,
) -> RasterFrame:
    """The image of `size` (width, height) pixels over a background colour.

    form: "cpu" or "gpu", by default the device's kind; any form draws the lists of any other, and
    goes back through its own images.
    """
    width, height = size
    number = tiles.grid[0] * tiles.grid[1]
    image, transmittance = device.empty((3, height, width)), device.empty((height, width))
    ends = device.empty(number, np.int32)
    form = form or device.kind
    file, group, _ = FORMS[form]
    blocks = room_for_blocks(device, tiles, form)
    device.launch(
        device.program(file, **defines_of(device, form))["rasterize"], number * group, group,
        width, height, tiles.grid[0], tiles.starts, tiles.intersections, projected.record,
        *(float(c) for c in background), image, transmittance, ends,
        *([] if blocks is None else [blocks]),
    )  # fmt: skip
    return RasterFrame(image, transmittance, ends, blocks)


def rasterize_rgba(
    device: Device,
    projected: Projected,
    tiles: Tiles,
    size: tuple[int, int],
    form: str | None = None,
    min_transmittance: float = MIN_TRANSMITTANCE,
) -> np.ndarray:
    """(H, W, 4) float32 premultiplied over nothing, alpha = 1 - transmittance, row 0 on top.

    min_transmittance: where less than that is left, nothing behind is drawn (3DGS: 1e-4).  Read
    only; on a CPU it is the device's own memory, which is reused when the array goes.
    """
    return rasterize_rgba_views(device, [(projected, tiles)], size, form, min_transmittance)[0]


def rasterize_rgba_views(
    device: Device,
    views: list[tuple[Projected, Tiles]],
    size: tuple[int, int],
    form: str | None = None,
    min_transmittance: float = MIN_TRANSMITTANCE,
) -> list[np.ndarray]:
    """What rasterize_rgba gives, of several views of the same size."""
    return rasterize_with_heat(device, views, [], size, form, min_transmittance)[0]


def rasterize_with_heat(
    device: Device,
    views: list[tuple[Projected, Tiles]],
    heats: "list[Array]",
    size: tuple[int, int],
    form: str | None = None,
    min_transmittance: float = MIN_TRANSMITTANCE,
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """What rasterize_rgba gives of several views, and (H, W, 2) value and weight of their heat,
    blended as the colours are.

    heats: (N, 4) of each view, value times weight first and weight last; none: it is left out.
    """
    width, height = size
    images = [device.empty((height, width, 4)) for _ in views]
    hot = [device.empty((height, width, 2)) for _ in heats]
    inputs: list[tuple] = [
        (tiles.starts, tiles.intersections, projected.record, image)
        for (projected, tiles), image in zip(views, images, strict=True)
    ]
    if heats:
        inputs = [(*given, *pair) for given, *pair in zip(inputs, heats, hot, strict=True)]
    draw_views = {"cpu": _draw_cpu, "gpu": _draw_gpu}[form or device.kind]
    if views:
        draw_views(device, inputs, size, views[0][1].grid, float(min_transmittance))
    return [device.view(image) for image in images], [device.view(image) for image in hot]


def rasterize_noting(
    device: Device, views: list[tuple[Projected, Tiles]], size: tuple[int, int],
    min_transmittance: float, images: "list[Array]", ends: "list[Array]",
    only: list[np.ndarray] | None = None,
) -> None:  # fmt: skip
    """The CPU form of rasterize_rgba_views into images (H, W, 4).

    ends: of each view (tiles, 2) int32, the last splat that a tile took in and that of the next
    batch; -1 where more might have followed.

    only: (tiles,) bool of each view; of other tiles images and ends stay as they are.
    """
    drawn = zip(views, images, strict=True)
    inputs = [(t.starts, t.intersections, p.record, image) for (p, t), image in drawn]
    masks: list[Array | None] = [None] * len(views)
    if only is not None:
        masks = [device.upload(each.astype(np.uint8)) for each in only]
    noting = list(zip(ends, masks, strict=True))
    _draw_cpu(device, inputs, size, views[0][1].grid, float(min_transmittance), noting)


def compile_with_heat(
    device: Device, form: str | None = None, min_transmittance: float = MIN_TRANSMITTANCE
) -> None:
    """Compiles what rasterize_with_heat launches for heat, with one empty tile.

    On a GPU the kernel is built for one value of min_transmittance.
    """
    starts = device.constants(np.zeros(2, np.int32))
    record, image = device.empty((1, RECORD)), device.empty((TILE, TILE, 4))
    inputs = [(starts, starts, record, image, record, device.empty((TILE, TILE, 2)))]
    draw_views = {"cpu": _draw_cpu, "gpu": _draw_gpu}[form or device.kind]
    draw_views(device, inputs, (TILE, TILE), (1, 1), float(min_transmittance))
    device.queue.finish()


def _draw_cpu(
    device: Device, inputs: list, size: tuple[int, int], grid: tuple[int, int], least: float,
    noting: "Sequence[tuple[Array | None, Array | None]]" = (),
) -> None:  # fmt: skip
    """Two views a launch, a work-item a tile of both.  noting: ends and only of each view."""
    defines = {"HEAT": 1} if len(inputs[0]) > 4 else {}
    kernel = device.program(KERNELS / "draw_cpu.cl", **defines)["draw"]
    noting = noting or [(None, None)] * len(inputs)
    inputs = [(*i[:4], *also, *i[4:]) for i, also in zip(inputs, noting, strict=True)]
    width = len(inputs[0])
    for first in range(0, len(inputs), 2):
        left, right = [*inputs[first : first + 2], [None] * width][:2]
        device.launch(kernel, grid[0] * grid[1], 1, *size, grid[0], least, *left, *right)


def _draw_gpu(
    device: Device, inputs: list, size: tuple[int, int], grid: tuple[int, int], least: float
) -> None:
    file, group, _ = FORMS["gpu"]
    defines = {"RGBA": 1, "STOP": least} | ({"HEAT": 1} if len(inputs[0]) > 4 else {})
    kernel = device.program(file, **defines)["rasterize"]  # built once for each value
    ends = device.empty(grid[0] * grid[1], np.int32)
    for starts, intersections, record, image, *heat in inputs:
        device.launch(
            kernel, grid[0] * grid[1] * group, group,
            *size, grid[0], starts, intersections, record, 0.0, 0.0, 0.0, image, None, ends, *heat,
        )  # fmt: skip


def rasterize_backward(
    device: Device,
    projected: Projected,
    tiles: Tiles,
    frame: RasterFrame,
    grad_image: "Array",
    grad_transmittance: "Array | None" = None,
    form: str | None = None,
    absolute: bool = True,
    error: "Array | None" = None,
    weight: bool = False,
) -> "Array":
    """(N, 12) gradients of the records from those of the image (3, H, W) and transmittance (H, W).

    Slots 9 to 11 are for growing.  9 and 10 hold the sums of the absolute gradients of the mean;
    absolute=False leaves them 0 and saves about a tenth of the time.  With an `error` (H, W) of the
    pixels slot 9 holds the splat's share of it instead, the sum of alpha T error.  weight=True puts
    the sum of alpha T into slot 11, in pixels.
    """
    count = projected.depth.shape[0]
    _, height, width = frame.image.shape
    first_slot = tiles.slots(device)
    slots = tiles.room(device, first_slot, RECORD)
    form = form or device.kind
    file, _, group = FORMS[form]
    defines = defines_of(device, form)
    defines |= {"ABSOLUTE": 1} if absolute and error is None else {}
    defines |= {"SHARE": 1} if error is not None else {}
    defines |= {"WEIGHT": 1} if weight else {}
    kernel = device.program(file, **defines)["rasterize_backward"]
    with_transmittance = grad_transmittance is not None
    device.launch(
        kernel, tiles.grid[0] * tiles.grid[1] * group, group,
        width, height, tiles.grid[0], tiles.starts, frame.tile_ends, tiles.intersections,
        tiles.tile_bounds, first_slot, projected.record, frame.image, frame.transmittance,
        grad_image, grad_transmittance if with_transmittance else frame.transmittance,
        with_transmittance, slots, *([] if error is None else [error]),
        *frame.for_backward(form),
    )  # fmt: skip
    grad_record = device.empty((count, RECORD))
    kernel = device.program(KERNELS / "sum_slots.cl")["sum_slots"]
    device.launch(kernel, count, 64, count, tiles.tile_bounds, first_slot, slots, grad_record)
    return grad_record
