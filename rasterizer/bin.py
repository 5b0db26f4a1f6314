"""bin: projected splats -> for each 16x16 tile the list of its splats, near to far."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import LOW_BITS, Found, Projected, chunks_of, grid_of
from shapeshift.rasterizer.sort import prefix_sums, sort_pairs

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels"
SPARE = 16  # as in bin.cl
MOST_BINS = 1 << 14  # of one pass: its table must stay in the second cache


@dataclass(frozen=True)
class Tiles:
    """Every (splat, tile) instance, tile by tile, near to far; forward and backward share it."""

    grid: tuple[int, int]  # tiles across, tiles down
    starts: "Array"  # (tiles + 1 or more,) int32: where each tile's list starts in `instances`
    instances: "Array"  # (I or more,) int32 splat indices
    places: "Array"  # (N, 2) uint32: see kernels/common/tiles.cl
    order: "Array"  # (visible,) int32: the visible splats by depth, stable
    count: int  # slots: as many as instances, and more where large boxes have tiles left out
    first_slot: "Array | None" = None  # (N,) int32: a splat's slots are numbered from there

    def slots(self, device: Device) -> "Array":
        """first_slot; counted now if the form that made these lists did not need it."""
        if self.first_slot is not None:
            return self.first_slot
        count = self.places.shape[0]
        first_slot = device.empty(count, np.int32)
        kernel = device.program(KERNELS / "bin.cl")["number_slots"]
        device.launch(kernel, 1, 1, count, self.places, first_slot)
        return first_slot

    def room(self, device: Device, first_slot: "Array", columns: int) -> "Array":
        """(count, columns) float32 for what instances leave in their slots; the others are 0."""
        slots, count = device.empty((self.count, columns)), self.places.shape[0]
        kernel = device.program(KERNELS / "sum_slots.cl")["clear_boxes"]
        device.launch(kernel, count, 64, count, columns, self.places, first_slot, slots)
        return slots


def bin_tiles(
    device: Device,
    projected: Projected,
    size: tuple[int, int],
    form: str | None = None,
    order: "Array | None" = None,
) -> Tiles:
    """The instance lists of an image of `size` (width, height) pixels; order by depth, stable.

    form: "cpu" or "gpu", by default the device's kind.  Both give the same lists.
    order: (n,) int32 splats near to far, as sort_order gives it for another view or an earlier
    frame: it is not sorted again, and splats that this view does not show take no part.
    """
    grid = grid_of(size)
    if order is not None:
        return _bin_chunks(device, projected, grid, order)
    bin_form = {"cpu": _bin_chunks, "gpu": _bin_groups}[form or device.kind]
    return bin_form(device, projected, grid)


def sort_order(device: Device, found: Found) -> "Array":
    """(n,) int32: the splats that project_arena entered, by their keys, stable.

    Once a projection: the first pass of the sort turns found.table into places to write to.
    """
    status = device.view(found.status)
    visible = int(status[:, 0].sum(dtype=np.int64))
    kernels = device.program(KERNELS / "bin.cl")
    return _sort(device, kernels, found, visible, int(status[:, 2].min()), int(status[:, 3].max()))


def _bin_groups(device: Device, projected: Projected, grid: tuple[int, int]) -> Tiles:
    """The GPU form: everything in parallel, two radix sorts."""
    kernels = device.program(KERNELS / "bin_gpu.cl")
    count = projected.depth.shape[0]
    tiles = grid[0] * grid[1]
    places, first_slot = device.empty((count, 2), np.uint32), device.empty(count, np.int32)
    keys, splats = device.empty(count, np.uint32), device.empty(count, np.int32)
    device.launch(
        kernels["find_places"], count, 64,
        count, *grid, projected.record, projected.depth, places, keys, splats,
    )  # fmt: skip
    keys, order = sort_pairs(device, keys, splats, 32)

    offsets, slots, visible = (device.empty(n, np.int32) for n in (count + 1, count + 1, 1))
    device.launch(
        kernels["count_instances"], count + 1, 64,
        count, keys, order, projected.record, places, offsets, slots, visible,
    )  # fmt: skip
    prefix_sums(device, offsets)
    prefix_sums(device, slots)
    shown, total = int(device.view(visible)[0]), int(device.view(offsets)[-1])
    slot_count = int(device.view(slots)[-1])
    tile_of, instances = device.empty(total, np.uint32), device.empty(total, np.int32)
    device.launch(
        kernels["write_instances"], shown, 64,
        shown, grid[0], order, projected.record, places, offsets, slots, tile_of, instances,
        first_slot,
    )  # fmt: skip
    tile_of, instances = sort_pairs(device, tile_of, instances, (tiles - 1).bit_length())
    starts = device.empty(tiles + 1, np.int32)
    device.launch(kernels["find_starts"], total + 1, 64, total, tiles, tile_of, starts)
    return Tiles(grid, starts, instances, places, order[:shown], slot_count, first_slot)


def _bin_chunks(
    device: Device, projected: Projected, grid: tuple[int, int], order: "Array | None" = None
) -> Tiles:
    """The CPU form: a work-item owns a chunk of splats and a table of counts."""
    kernels = device.program(KERNELS / "bin.cl")
    found = projected.found
    if found is None or found.grid != grid:
        found = Found.empty(device, projected.depth.shape[0], grid)
        device.launch(
            kernels["find_places"], found.status.shape[0], 1,
            projected.depth.shape[0], found.chunk, *grid, projected.record, projected.depth,
            *found.arrays(),
        )  # fmt: skip
    total = int(device.view(found.status)[:, 1].sum(dtype=np.int64))
    order = sort_order(device, found) if order is None else order
    starts, instances = _scatter_tiles(device, kernels, order, projected.record, found, total)
    return Tiles(grid, starts, instances, found.places, order, total)


def _digits(least: int, most: int) -> list[tuple[int, int, int]]:
    """(origin, shift, bins) of each pass of the sort of keys from `least` to `most`."""
    passes = [(0, 0, 1 << LOW_BITS)]
    origin = least >> LOW_BITS << LOW_BITS
    high_bins = (most - origin >> LOW_BITS) + 1
    if high_bins > MOST_BINS:
        half = ((high_bins - 1).bit_length() + 1) // 2
        passes.append((origin, LOW_BITS, 1 << half))
        passes.append((origin, LOW_BITS + half, (high_bins >> half) + 1))
    elif high_bins > 1:
        passes.append((origin, LOW_BITS, high_bins))
    return passes


def _sort(device: Device, kernels: dict, found: Found, visible: int, least: int, most: int):
    """(visible,) splat indices by depth: a counting sort by the low digit, then the high ones."""
    if visible == 0:
        return device.empty(0, np.int32)
    pairs, table, chunk = found.pairs, found.table, found.chunk
    order = device.empty(visible, np.int32)
    passes = _digits(least, most)
    for number, (origin, shift, bins) in enumerate(passes):
        first, final = number == 0, number == len(passes) - 1
        if not first:  # the first digit was counted while the places were found
            chunks = chunks_of(device, visible)
            chunk = -(-visible // chunks)
            table = device.empty((chunks, bins), np.int32)
            device.launch(
                kernels["count_digits"], chunks, 1,
                visible, chunk, bins, np.uint32(origin), shift, pairs, table,
            )  # fmt: skip
        starts = device.empty(bins + 1, np.int32)
        device.launch(kernels["scan_table"], 1, 1, bins, table.shape[0], table, starts)
        sorted_pairs = None if final else device.empty((visible, 2), np.uint32)
        device.launch(
            kernels["scatter_digits"], table.shape[0], 1,
            visible, chunk, bins, np.uint32(origin), shift, int(first), int(final), found.status,
            pairs, table, sorted_pairs, order,
        )  # fmt: skip
        pairs = sorted_pairs
    return order


def _scatter_tiles(device, kernels, order, record, found: Found, total: int) -> tuple:
    """(tiles + 1,) starts and at most (total,) instances from the splats in depth order."""
    grid, tiles, visible = found.grid, found.grid[0] * found.grid[1], order.shape[0]
    chunks = chunks_of(device, visible)
    chunk = -(-visible // chunks)
    # The branch-free walk looks at a tile's right, lower and lower right neighbours, too.
    bins = tiles + grid[0] + 1
    table, starts = device.empty((chunks, bins), np.int32), device.empty(bins + 1, np.int32)
    instances = device.empty(total + SPARE * chunks, np.int32)
    near_to_far = device.empty((visible, 2), np.uint32)  # places
    shared = (visible, chunk, grid[0], bins)
    device.launch(
        kernels["count_tiles"], chunks, 1,
        *shared, order, record, found.places, near_to_far, table,
    )  # fmt: skip
    device.launch(kernels["scan_table"], 1, 1, bins, chunks, table, starts)
    device.launch(
        kernels["scatter_tiles"], chunks, 1,
        *shared, total, order, record, near_to_far, table, instances,
    )  # fmt: skip
    return starts, instances
