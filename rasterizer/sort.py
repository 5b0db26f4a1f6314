"""sort: the stable radix sort and the prefix sums of the GPU form, for arrays of any length."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels"
GROUP = 256  # work-items, as in sort_gpu.cl
SPAN = 2048  # keys a work-group
DIGIT_BITS = 4


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


def sort_pairs(device: Device, keys: "Array", values: "Array", bits: int) -> tuple:
    """(keys, values) by the lowest `bits` of uint32 keys, stable; the inputs may be overwritten."""
    kernels = device.program(KERNELS / "sort_gpu.cl")
    count = keys.size
    groups = -(-count // SPAN)
    spare_keys, spare_values = device.empty(count, np.uint32), device.empty(count, np.int32)
    table = device.empty((1 << DIGIT_BITS, groups), np.int32)
    for shift in range(0, bits if count else 0, DIGIT_BITS):
        shared = (count, groups, shift, keys)
        device.launch(kernels["count_digits"], groups * GROUP, GROUP, *shared, table)
        prefix_sums(device, table)
        device.launch(
            kernels["scatter_digits"], groups * GROUP, GROUP,
            *shared, values, table, spare_keys, spare_values,
        )  # fmt: skip
        keys, values, spare_keys, spare_values = spare_keys, spare_values, keys, values
    return keys, values
