"""bin: projected splats -> for each 16x16 tile the list of its splats, near to far."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import LOW_BITS, Projected, TileScratch, chunks_of, grid_of

if TYPE_CHECKING:
    from pyopencl.array import Array


# sort: the stable radix sort and the prefix sums of the GPU form, for arrays of any length.

KERNELS = Path(__file__).parent / "kernels"
GROUP = 256  # work-items, as in sort_gpu.cl
SPAN = 2048  # keys a work-group
DIGIT_BITS = 8


def prefix_sums(device: Device, data: "Array") -> None:
    """Replaces int32 `data` by its exclusive sums, in place."""
    kernels = device.program(KERNELS / "sort_gpu.cl")
    count = data.size
    groups = -(-count // SPAN)
    sums = device.empty(groups, np.int32)
    device.launch(kernels["scan_spans"], groups * GROUP, GROUP, count, data, sums)
    if groups > 1:
        prefix_sums(device, sums)
        device.launch(kernels["add_sums"], count, GROUP, count, data, sums)


def sort_pairs(device: Device, keys: "Array", values: "Array", bits: int, base: int = 0) -> tuple:
    """(keys, values) by the lowest `bits` of uint32 keys less `base`, stable; the inputs may be
    overwritten.
    """
    kernels = device.program(KERNELS / "sort_gpu.cl")
    count = keys.size
    groups = -(-count // SPAN)
    spare_keys, spare_values = device.empty(count, np.uint32), device.empty(count, np.int32)
    table, totals = device.empty((GROUP, groups), np.int32), device.empty(GROUP, np.int32)
    for shift in range(0, bits if count else 0, DIGIT_BITS):
        shared = (count, groups, np.uint32(base), shift, keys)
        device.launch(kernels["count_digits"], groups * GROUP, GROUP, *shared, table)
        device.launch(kernels["scan_digits"], GROUP * GROUP, GROUP, groups, table, totals)
        device.launch(
            kernels["scatter_digits"], groups * GROUP, GROUP,
            *shared, values, table, totals, spare_keys, spare_values,
        )  # fmt: skip
        keys, values, spare_keys, spare_values = spare_keys, spare_values, keys, values
    return keys, values


SPARE = 16  # as in bin.cl
MOST_BINS = 1 << 14  # of one pass: its table must stay in the second cache


@dataclass(frozen=True)
class Tiles:
    """Every intersection (splat, tile), tile by tile, near to far; backward reads it, too."""

    grid: tuple[int, int]  # tiles across, tiles down
    starts: "Array"  # (tiles + 1 or more,) int32: where each tile's list starts in `intersections`
    intersections: "Array"  # (I or more,) int32 splat indices
    tile_bounds: "Array"  # (N, 2) uint32: see kernels/common/tiles.cl
    order: "Array"  # (visible,) int32: the visible splats by depth, stable
    count: int  # slots: as many as intersections, and more where large boxes have tiles left out
    first_slot: "Array | None" = None  # (N,) int32: a splat's slots are numbered from there

    def slots(self, device: Device) -> "Array":
        """first_slot; counted now if the form that made these lists did not need it."""
        if self.first_slot is not None:
            return self.first_slot
        count = self.tile_bounds.shape[0]
        first_slot = device.empty(count, np.int32)
        kernel = device.program(KERNELS / "bin.cl")["number_slots"]
        device.launch(kernel, 1, 1, count, self.tile_bounds, first_slot)
        return first_slot

    def room(self, device: Device, first_slot: "Array", columns: int) -> "Array":
        """(count, columns) float32 for what intersections write to their slots; others are 0."""
        slots, count = device.empty((self.count, columns)), self.tile_bounds.shape[0]
        kernel = device.program(KERNELS / "sum_slots.cl")["clear_boxes"]
        device.launch(kernel, count, 64, count, columns, self.tile_bounds, first_slot, slots)
        return slots


def bin_tiles(
    device: Device,
    projected: Projected,
    size: tuple[int, int],
    form: str | None = None,
    order: "Array | None" = None,
    hidden: np.ndarray | None = None,
) -> Tiles:
    """The intersection lists of an image of `size` (width, height) pixels; order by depth, stable.

    form: "cpu" or "gpu", by default the device's kind.  Both give the same lists.
    order: (n,) int32 splats near to far, as sort_order gives it for another view or an earlier
    frame: it is not sorted again, and splats that this view does not show take no part.
    hidden: (tiles down, tiles across) bool of tiles whose lists stay empty: nothing is drawn there.
    Only with an order, and not for backward passes.
    """
    grid = grid_of(size)
    form = form or device.kind
    if order is not None:
        bin_ordered = {"cpu": _bin_chunks, "gpu": _bin_ordered_groups}[form]
        return bin_ordered(device, projected, grid, order, hidden)
    if hidden is not None:
        raise ValueError("tiles are hidden from lists of a given order alone.")
    return {"cpu": _bin_chunks, "gpu": _bin_groups}[form](device, projected, grid)


def sort_order(device: Device, scratch: TileScratch, form: str | None = None) -> "Array":
    """(n,) int32: the splats that project_arena entered, by their keys, stable.

    Once a projection: the first pass of the CPU form's sort turns scratch.table into positions.
    form: as bin_tiles takes it.
    """
    status = device.view(scratch.status)
    visible = int(status[:, 0].sum(dtype=np.int64))
    ends = int(status[:, 2].min()), int(status[:, 3].max())
    if (form or device.kind) == "gpu":
        return _sort_groups(device, scratch, visible, *ends)
    return _sort(device, device.program(KERNELS / "bin.cl"), scratch, visible, *ends)


def _bin_groups(device: Device, projected: Projected, grid: tuple[int, int]) -> Tiles:
    """The GPU form: everything in parallel, two radix sorts."""
    kernels = device.program(KERNELS / "bin_gpu.cl")
    count = projected.depth.shape[0]
    tile_bounds, first_slot = device.empty((count, 2), np.uint32), device.empty(count, np.int32)
    keys, splats = device.empty(count, np.uint32), device.empty(count, np.int32)
    device.launch(
        kernels["find_tile_bounds"], count, 64,
        count, *grid, projected.record, projected.depth, tile_bounds, keys, splats,
    )  # fmt: skip
    keys, order = sort_pairs(device, keys, splats, 32)

    offsets, slots, visible = (device.empty(n, np.int32) for n in (count + 1, count + 1, 1))
    device.launch(
        kernels["count_intersections"], count + 1, 64,
        count, keys, order, projected.record, tile_bounds, offsets, slots, visible,
    )  # fmt: skip
    prefix_sums(device, offsets)
    prefix_sums(device, slots)
    shown, total = int(device.view(visible)[0]), int(device.view(offsets)[-1])
    slot_count = int(device.view(slots)[-1])
    given = (order, projected.record, tile_bounds)
    starts, intersections = _list_groups(
        device, grid, shown, total, given, offsets, (slots, first_slot)
    )
    return Tiles(grid, starts, intersections, tile_bounds, order[:shown], slot_count, first_slot)


def _sort_groups(
    device: Device, scratch: TileScratch, visible: int, least: int, most: int
) -> "Array":
    """The GPU form of sort_order: a radix sort of all places by their keys, which are from least to
    most; the empty ones last.
    """
    if visible == 0:
        return device.empty(0, np.int32)
    assert scratch.pairs is not None, "an order from before needs no sort"
    kernels, count = device.program(KERNELS / "bin_gpu.cl"), scratch.pairs.shape[0]
    keys, splats = device.empty(count, np.uint32), device.empty(count, np.int32)
    device.launch(
        kernels["unpack_pairs"], count, 64,
        count, scratch.chunk, np.uint32(most + 1), scratch.status, scratch.pairs, keys, splats,
    )  # fmt: skip
    bits = (most + 1 - least).bit_length()
    return sort_pairs(device, keys, splats, bits, least)[1][:visible]


def _bin_ordered_groups(
    device: Device, projected: Projected, grid: tuple[int, int], order: "Array",
    hidden: np.ndarray | None = None,
) -> Tiles:  # fmt: skip
    """The GPU form for an order that is there: one radix sort, by tiles."""
    kernels, scratch = device.program(KERNELS / "bin_gpu.cl"), _scratch_on(device, projected, grid)
    shown = order.shape[0]
    offsets = device.empty(shown + 1, np.int32)
    at = (projected.record, scratch.tile_bounds)
    device.launch(kernels["count_ordered"], shown + 1, 64, shown, order, *at, offsets)
    prefix_sums(device, offsets)
    total = int(device.view(offsets)[-1])
    given = (order, *at)
    starts, intersections = _list_groups(device, grid, shown, total, given, offsets, hidden=hidden)
    slots = int(device.view(scratch.status)[:, 1].sum(dtype=np.int64))
    return Tiles(grid, starts, intersections, scratch.tile_bounds, order, slots)


def _list_groups(
    device: Device, grid: tuple[int, int], shown: int, total: int, given: tuple, offsets: "Array",
    slots: tuple = (None, None), hidden: np.ndarray | None = None,
) -> tuple:  # fmt: skip
    """(tiles + 1,) starts and (total,) intersections, by one radix sort by tiles.

    given: order, record, tile bounds; slots: where each splat's begin in that order, and by splat.
    """
    kernels, tiles = device.program(KERNELS / "bin_gpu.cl"), grid[0] * grid[1]
    tile_of, intersections = device.empty(total, np.uint32), device.empty(total, np.int32)
    covered = None if hidden is None else device.constants(hidden.astype(np.uint8).reshape(-1))
    device.launch(
        kernels["write_intersections"], shown, 64,
        shown, grid[0], tiles, covered, *given, offsets, slots[0], tile_of, intersections, slots[1],
    )  # fmt: skip
    last = tiles - 1 if hidden is None else tiles
    tile_of, intersections = sort_pairs(device, tile_of, intersections, last.bit_length())
    starts = device.empty(tiles + 1, np.int32)
    device.launch(kernels["find_starts"], total + 1, 64, total, tiles, tile_of, starts)
    return starts, intersections


def _scratch_on(device: Device, projected: Projected, grid: tuple[int, int]) -> TileScratch:
    """The tile bounds and keys on a grid: those that project_arena left, or made now."""
    scratch = projected.scratch
    if scratch is None or scratch.grid != grid:
        scratch = TileScratch.empty(device, projected.depth.shape[0], grid)
        device.launch(
            device.program(KERNELS / "bin.cl")["find_tile_bounds"], scratch.status.shape[0], 1,
            projected.depth.shape[0], scratch.chunk, *grid, projected.record, projected.depth,
            *scratch.arrays(),
        )  # fmt: skip
    return scratch


def _bin_chunks(
    device: Device, projected: Projected, grid: tuple[int, int], order: "Array | None" = None,
    hidden: np.ndarray | None = None,
) -> Tiles:  # fmt: skip
    """The CPU form: a work-item owns a chunk of splats and a table of counts."""
    scratch = _scratch_on(device, projected, grid)
    total = int(device.view(scratch.status)[:, 1].sum(dtype=np.int64))
    order = sort_order(device, scratch) if order is None else order
    made = (order, projected.record, scratch, total, hidden)
    starts, intersections = _scatter_tiles(device, *made)
    return Tiles(grid, starts, intersections, scratch.tile_bounds, order, total)


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


def _sort(device: Device, kernels: dict, scratch: TileScratch, visible: int, least: int, most: int):
    """(visible,) splat indices by depth: a counting sort by the low digit, then the high ones."""
    if visible == 0:
        return device.empty(0, np.int32)
    pairs, table, chunk = scratch.pairs, scratch.table, scratch.chunk
    assert table is not None, "an order from before needs no sort"
    order = device.empty(visible, np.int32)
    passes = _digits(least, most)
    for number, (origin, shift, bins) in enumerate(passes):
        first, final = number == 0, number == len(passes) - 1
        if not first:  # the first digit was counted with the tile bounds
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
            visible, chunk, bins, np.uint32(origin), shift, int(first), int(final), scratch.status,
            pairs, table, sorted_pairs, order,
        )  # fmt: skip
        pairs = sorted_pairs
    return order


def _scatter_tiles(
    device: Device, order: "Array", record: "Array", scratch: TileScratch, total: int,
    hidden: np.ndarray | None = None,
) -> tuple:  # fmt: skip
    """(tiles + 1,) starts and at most (total,) intersections from the splats in depth order."""
    kernels = device.program(KERNELS / "bin.cl", **({} if hidden is None else {"HIDDEN": 1}))
    grid, tiles, visible = scratch.grid, scratch.grid[0] * scratch.grid[1], order.shape[0]
    chunks = chunks_of(device, visible)
    chunk = -(-visible // chunks)
    # Counting writes up to four rows of tiles and a mask's width beyond a splat's first tile.
    bins = tiles + 3 * grid[0] + 9
    table, starts = device.empty((chunks, bins), np.int32), device.empty(bins + 1, np.int32)
    intersections = device.empty(total + SPARE * chunks, np.int32)
    near_to_far = device.empty((visible, 2), np.uint32)  # tile bounds
    shared = (visible, chunk, grid[0], bins)
    shown = []
    if hidden is not None:
        among = np.zeros(bins, np.uint8)
        among[:tiles] = ~hidden.reshape(-1)
        shown = [device.constants(among)]
    device.launch(
        kernels["count_tiles"], chunks, 1,
        *shared, order, record, scratch.tile_bounds, near_to_far, table, *shown,
    )  # fmt: skip
    device.launch(kernels["scan_table"], 1, 1, bins, chunks, table, starts)
    device.launch(
        kernels["scatter_tiles"], chunks, 1,
        *shared, total, order, record, near_to_far, table, intersections, *shown,
    )  # fmt: skip
    return starts, intersections


# quantize_keys: exact sort keys -> 65535 steps of the range that a frame uses.

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
