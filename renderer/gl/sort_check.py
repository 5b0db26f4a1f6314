"""Whether this driver's GL sort is right, asked once at the start; numpy sorts where it is not."""

import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, groups_for, overwrite
from shapeshift.renderer.gl.target import warn_once

# sort: depth keys -> the order near to far, stable; GPU radix, or numpy on software GL.

KEY_BITS = (16, 32)


class Sorter:
    """Fills arena.order (indices of the splats that have a key) and the draw command.

    backend "gl": LSD radix, 8 bits a pass, reduce then scan; no subgroups, no read-back, any
    GL 4.3; its first pass leaves out what is culled, and those that follow, too, by indirect
    dispatch, as many as the range of the keys asks for.  "numpy": reads the keys back; on software
    GL they are in the same memory and numpy's radix sort of 16-bit halves is 20 times faster (6
    against 120 ms for 400,000 keys).
    """

    def __init__(self, gpu: Gpu, backend: str) -> None:
        if backend not in ("gl", "numpy"):
            raise ValueError(f"there is no sort {backend!r}; choose gl or numpy.")
        self.backend = backend
        self._gpu = gpu
        self._command = gpu.compute("sort/draw_command.comp")
        if backend == "gl":
            self._quantize = gpu.compute("sort/sort_quantize.comp")
            self._count = gpu.compute("sort/sort_count.comp")
            self._scan = gpu.compute("sort/sort_scan.comp")
            self._scatter = gpu.compute("sort/sort_scatter.comp")

    def sort(self, arena: Arena, key_bits: int = 32) -> None:
        """Sorts by arena.keys: 32 is exact, 16 divides the frame's depths into 65535 steps."""
        if key_bits not in KEY_BITS:
            raise ValueError(f"key_bits is {key_bits}; choose 16 or 32 (exact).")
        bind(counts=arena.counts, command=arena.command, dispatch=arena.dispatch)
        self._gpu.run(self._command, 1, key_bits=key_bits)
        if arena.count and self.backend == "gl":
            self._sort_on_gpu(arena, key_bits)
        elif arena.count:
            self._sort_with_numpy(arena, key_bits)

    def _sort_on_gpu(self, arena: Arena, key_bits: int) -> None:
        if key_bits == 16:
            bind(keys=arena.keys, counts=arena.counts)
            self._gpu.run(
                self._quantize, groups_for(arena.count, layout.WORKGROUP), count=arena.count
            )
        groups = groups_for(arena.count, layout.WORKGROUP * layout.SORT_BLOCKS)
        here, there = arena.keys, arena.keys_spare
        culled = layout.CULLED_KEY if key_bits == 32 else (1 << 16) - 1
        bind(histogram=arena.histogram, counts=arena.counts, dispatch=arena.dispatch)
        bind(order=arena.order, order_spare=arena.order_spare)
        among = {"count": arena.count, "culled": culled}
        for number, shift in enumerate(range(0, key_bits, 8)):
            bind(keys=here, keys_out=there)
            for program, more, each in (
                (self._count, among, groups), (self._scan, {}, layout.RADIX),
                (self._scatter, among, groups),
            ):  # fmt: skip
                uniforms = {"shift": shift, "group_count": groups, **more}
                if number == 0:
                    self._gpu.run(program, each, **uniforms)
                    continue
                at = 24 * (number - 1) + (12 if program is self._scan else 0)  # bytes
                self._gpu.run_indirect(program, arena.dispatch, at, **uniforms)
            here, there = there, here

    def _sort_with_numpy(self, arena: Arena, key_bits: int) -> None:
        keys = np.frombuffer(arena.keys.read(4 * arena.count), np.uint32)
        if key_bits == 16:
            keys = quantize(keys)
        order = stable_order(keys, key_bits)
        arena.order.write(order)

    def release(self) -> None:
        """Nothing of its own: programs belong to the Gpu."""

    def __enter__(self) -> "Sorter":
        return self

    def __exit__(self, *failure) -> None:
        self.release()


def stable_order(keys: np.ndarray, bits: int = 32) -> np.ndarray:
    """(N,) uint32 indices that sort uint32 keys, stable.

    One or two passes over 16-bit halves, for which numpy has a radix sort.
    """
    order = np.argsort(keys.astype(np.uint16, copy=False), kind="stable")
    if bits == 32:
        high = (keys >> np.uint32(16)).astype(np.uint16)
        order = order[np.argsort(high[order], kind="stable")]
    return order.astype(np.uint32)


def quantize(keys: np.ndarray) -> np.ndarray:
    """Depth keys (float bits) as uint16 0..65534 over their own range; CULLED_KEY becomes 65535.

    The twin of sort_quantize.comp.
    """
    nearest = keys.min(initial=layout.CULLED_KEY)
    farthest = keys.view(np.int32).max(initial=-1)  # CULLED_KEY is -1 here, depths are above
    ends = np.array([nearest, farthest], np.int64).astype(np.uint32).view(np.float32)
    steps = keys.view(np.float32) - ends[0]  # CULLED_KEY is a NaN, which fmin() tells from depths
    steps *= np.float32(65534) / np.maximum(ends[1] - ends[0], np.float32(1e-30))
    return np.fmin(steps, np.float32(65535), out=steps).astype(np.uint16)


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
    """(count,) uint32: depths, a third of them twice, some culled; every digit varies, of even
    counts those of the three passes that a narrow range takes.
    """
    rng = np.random.default_rng(count)
    depth = np.exp(rng.normal(size=count) * (3 if count % 2 else 0.1)).astype(np.float32)
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
