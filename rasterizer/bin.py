"""bin: projected splats -> for each 16x16 tile the list of its splats, near to far."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rasterizer.device import Device
from rasterizer.project import LEAST_CHUNK, Projected
from rasterizer.sort import prefix_sums, sort_pairs

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels"
TILE = 16  # pixels
LOW_BITS = 12  # of a depth key: the first pass of the sort, counted while the tiles are found
MOST_BINS = 1 << 14  # of one pass: its table must stay in the second cache


@dataclass(frozen=True)
class Tiles:
    """Every (splat, tile) instance, tile by tile, near to far; forward and backward share it."""

    grid: tuple[int, int]  # tiles across, tiles down
    starts: "Array"  # (tiles + 2,) int32: where each tile's list starts in `instances`
    instances: "Array"  # (I + 1,) int32 splat indices
    places: "Array"  # (N, 2) uint32: see kernels/common/tiles.cl
    order: "Array"  # (visible,) int32: the visible splats by depth, stable
    count: int  # I
    first_slot: "Array | None" = None  # (N,) int32: a splat's instances are numbered from there

    def slots(self, device: Device) -> "Array":
        """first_slot; counted now if the form that made these lists did not need it."""
        if self.first_slot is not None:
            return self.first_slot
        count = self.places.shape[0]
        first_slot = device.empty(count, np.int32)
        kernel = device.program(KERNELS / "bin.cl")["number_slots"]
        device.launch(kernel, 1, 1, count, self.places, first_slot)
        return first_slot


def bin_tiles(
    device: Device, projected: Projected, size: tuple[int, int], form: str | None = None
) -> Tiles:
    """The instance lists of an image of `size` (width, height) pixels; order by depth, stable.

    form: "cpu" or "gpu", by default the device's kind.  Both give the same lists.
    """
    grid = (-(-size[0] // TILE), -(-size[1] // TILE))
    bin_form = {"cpu": _bin_chunks, "gpu": _bin_groups}[form or device.kind]
    return bin_form(device, projected, grid)


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

    offsets, visible = device.empty(count + 1, np.int32), device.empty(1, np.int32)
    device.launch(
        kernels["count_instances"], count + 1, 64, count, keys, order, places, offsets, visible
    )
    prefix_sums(device, offsets)
    shown, total = int(device.view(visible)[0]), int(device.view(offsets)[-1])
    tile_of, instances = device.empty(total, np.uint32), device.empty(total, np.int32)
    device.launch(
        kernels["write_instances"], shown, 64,
        shown, grid[0], order, places, offsets, tile_of, instances, first_slot,
    )  # fmt: skip
    tile_of, instances = sort_pairs(device, tile_of, instances, (tiles - 1).bit_length())
    starts = device.empty(tiles + 1, np.int32)
    device.launch(kernels["find_starts"], total + 1, 64, total, tiles, tile_of, starts)
    return Tiles(grid, starts, instances, places, order[:shown], total, first_slot)


def _bin_chunks(device: Device, projected: Projected, grid: tuple[int, int]) -> Tiles:
    """The CPU form: a work-item owns a chunk of splats and a table of counts."""
    kernels = device.program(KERNELS / "bin.cl")
    count = projected.depth.shape[0]
    chunks = max(1, min(2 * device.units, count // LEAST_CHUNK))
    chunk = -(-count // chunks)

    places = device.empty((count, 2), np.uint32)
    keys, splats = device.empty(count, np.uint32), device.empty(count, np.int32)
    table = device.empty((chunks, 1 << LOW_BITS), np.int32)
    status = device.empty((chunks, 4), np.uint32)
    device.launch(
        kernels["find_places"], chunks, 1,
        count, chunk, grid[0], grid[1], projected.record, projected.depth, places, keys, splats,
        table, status,
    )  # fmt: skip
    per_chunk = device.view(status)
    visible, total = (int(n) for n in per_chunk[:, :2].sum(axis=0, dtype=np.int64))
    least, most = int(per_chunk[:, 2].min()), int(per_chunk[:, 3].max())
    order = _sort(device, kernels, (keys, splats, table, status), visible, chunk, (least, most))
    starts, instances = _scatter_tiles(device, kernels, order, places, grid, visible, total)
    return Tiles(grid, starts, instances, places, order, total)


def _sort(device: Device, kernels: dict, packed: tuple, visible: int, chunk: int, span: tuple):
    """(visible,) splat indices by depth: a counting sort by the low digit, then the high ones."""
    keys, splats, table, status = packed
    least, most = span
    if visible == 0:
        return device.empty(0, np.int32)
    passes = [(0, 0, 1 << LOW_BITS)]  # origin, shift, bins
    origin = least >> LOW_BITS << LOW_BITS
    high_bins = (most - origin >> LOW_BITS) + 1
    if high_bins <= MOST_BINS:
        passes += [(origin, LOW_BITS, high_bins)] * (high_bins > 1)
    else:
        half = ((high_bins - 1).bit_length() + 1) // 2
        highest = LOW_BITS + half
        passes += [(origin, LOW_BITS, 1 << half), (origin, highest, (high_bins >> half) + 1)]
    for number, (origin, shift, bins) in enumerate(passes):
        first = number == 0
        if not first:
            chunks = max(1, min(2 * device.units, visible // LEAST_CHUNK))
            chunk = -(-visible // chunks)
            table = device.empty((chunks, bins), np.int32)
            device.launch(
                kernels["count_digits"], chunks, 1,
                visible, chunk, bins, np.uint32(origin), shift, keys, table,
            )  # fmt: skip
        starts = device.empty(bins + 1, np.int32)
        device.launch(kernels["scan_table"], 1, 1, bins, table.shape[0], table, starts)
        to_keys, to_splats = device.empty(visible, np.uint32), device.empty(visible, np.int32)
        device.launch(
            kernels["scatter_digits"], table.shape[0], 1,
            visible, chunk, bins, np.uint32(origin), shift, int(first), status, keys, splats, table,
            to_keys, to_splats,
        )  # fmt: skip
        keys, splats = to_keys, to_splats
    return splats


def _scatter_tiles(device, kernels, order, places, grid, visible: int, total: int) -> tuple:
    """(tiles + 1,) starts and (total,) instances from the splats in depth order."""
    tiles = grid[0] * grid[1]
    chunks = max(1, min(2 * device.units, visible // LEAST_CHUNK))
    chunk = -(-visible // chunks)
    # One tile and one instance to spare: where the branch-free walk sends what is not touched.
    table = device.empty((chunks, tiles + 1), np.int32)
    starts, instances = device.empty(tiles + 2, np.int32), device.empty(total + 1, np.int32)
    shared = (visible, chunk, grid[0], tiles, order, places, table)
    device.launch(kernels["count_tiles"], chunks, 1, *shared)
    device.launch(kernels["scan_table"], 1, 1, tiles + 1, chunks, table, starts)
    device.launch(kernels["scatter_tiles"], chunks, 1, *shared, instances)
    return starts, instances
