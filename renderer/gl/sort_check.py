"""Whether this driver's GL sort is right, asked once at the start; numpy sorts where it is not."""

import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena
from shapeshift.renderer.gl.gpu import Gpu, overwrite
from shapeshift.renderer.gl.sort import KEY_BITS, Sorter, quantize, stable_order
from shapeshift.renderer.gl.target import warn_once

BLOCK = layout.WORKGROUP
GROUP = layout.WORKGROUP * layout.SORT_BLOCKS
SIZES = (0, 1, BLOCK - 1, BLOCK, BLOCK + 1, GROUP - 1, GROUP, GROUP + 1, 2 * GROUP + 777)
FAILED = "numpy (the driver's sort failed its self-test)"
UNWRITTEN = 0xFFFFFFFF  # no index of a splat


def checked_sorter(gpu: Gpu, backend: str) -> tuple[Sorter, str]:
    """A Sorter and the name of what it sorts with: the backend asked for, or FAILED.

    "gl" sorts known keys first.  A driver that gets one of them wrong is named in the log.
    """
    sorter = Sorter(gpu, backend)
    if backend != "gl":
        return sorter, backend
    wrong = first_wrong(gpu, sorter)
    if not wrong:
        return sorter, backend
    sorter.release()
    warn_once(
        f"the GL sort of this driver ({gpu.ctx.info['GL_RENDERER']}) puts {wrong} in a wrong "
        "order; numpy sorts instead, which reads the keys back in every frame."
    )
    return Sorter(gpu, "numpy"), FAILED


def first_wrong(gpu: Gpu, sorter: Sorter) -> str:
    """The first of the known keys, in words, that a GL sort leaves in a wrong order; "" if none."""
    for count in SIZES:
        keys = _known_keys(count)
        with Arena(gpu, [count]) as arena:
            for bits in KEY_BITS:
                write_keys(arena, keys)
                overwrite(arena.order, np.full(max(count, 1), UNWRITTEN, np.uint32))
                sorter.sort(arena, bits)
                if not _in_order(arena, keys, bits):
                    return f"{count} keys of {bits} bits"
    return ""


def write_keys(arena: Arena, keys: np.ndarray) -> None:
    """What project would have left: uint32 keys, how many are drawn, their range."""
    drawn = keys[keys != layout.CULLED_KEY]
    counts = np.zeros(layout.COUNTS_SIZE, np.uint32)
    counts[layout.COUNTS["SORTED"]] = len(drawn)
    counts[layout.COUNTS["NEAREST"]] = drawn.min(initial=layout.CULLED_KEY)
    counts[layout.COUNTS["FARTHEST"]] = drawn.max(initial=0)
    if len(keys):
        overwrite(arena.keys, keys)
    overwrite(arena.counts, counts)


def _known_keys(count: int) -> np.ndarray:
    """(count,) uint32: depths in which every digit varies, a third of them twice, some culled."""
    rng = np.random.default_rng(count)
    depth = np.exp(rng.normal(size=count) * 3).astype(np.float32)
    again = rng.random(count) < 0.33
    depth[again] = depth[rng.integers(0, max(count, 1), again.sum())]
    culled = rng.random(count) < 0.2
    return np.where(culled, np.uint32(layout.CULLED_KEY), depth.view(np.uint32))


def _in_order(arena: Arena, keys: np.ndarray, bits: int) -> bool:
    """Whether arena.order is the stable order of the keys, or of the 16-bit steps they became."""
    there = keys != layout.CULLED_KEY
    count = np.count_nonzero(there)
    order = np.frombuffer(arena.order.read(), np.uint32)[:count]
    if bits == 32:
        return np.array_equal(order, stable_order(keys)[:count])
    if not np.array_equal(np.sort(order), np.flatnonzero(there)):
        return False
    steps = np.full(len(keys), 65535, np.int64)
    steps[order] = np.frombuffer(arena.keys.read(), np.uint32)[:count]
    # The driver's division may round a step otherwise than numpy's, no further.
    close = np.abs(steps - quantize(keys)).max(initial=0) <= 1
    return bool(close and np.array_equal(order, stable_order(steps, 16)[:count]))
