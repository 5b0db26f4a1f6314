"""stereo_pair: both eyes in one draw, for software GL: one triangle around a splat's two ellipses,
two targets.

Software GL pays for triangles and for the 4 x 4 pixels that they touch, and little for a second
target.  So the right picture is moved along x by the disparity of the median splat, where the two
ellipses of most splats nearly coincide, and moved back afterwards.  What is left of the disparity
makes the triangles larger: above MAX_RESIDUAL_DISPARITY two draws are as fast
(tools/renderer/passes_gl.py).
"""

import moderngl
import numpy as np

from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, release_framebuffer
from shapeshift.renderer.layout import COUNTS, CULLED_KEY

MAX_RESIDUAL_DISPARITY = 5.5  # pixels between the two ellipses of a splat, in the mean
FARTHEST = 1e6  # pixels: any larger disparity is refused as well
STEP = 64  # pixels by which targets grow
SAMPLES, RUN = 16, 256  # so many runs of so many records tell the disparity
LEAST_LOW_PASS = 0.05  # px^2: thinner ellipses have no inverse in half floats


class StereoPairSplatter:
    """Draws two views of one size that share projection and order."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._program = gpu.program("stereo_pair.vert", "stereo_pair.frag")
        self._move = gpu.program("full.vert", "stereo_pair_crop.frag")
        self._triangles = gpu.ctx.vertex_array(self._program, [])
        self._screen = gpu.ctx.vertex_array(self._move, [])
        self.targets: moderngl.Framebuffer | None = None

    def disparity(self, arena: Arena, width: int, keys_sorted: bool = False) -> int | None:
        """By how many pixels the right view, as just projected, has to move to lie on the left;
        None where splats lie too differently, so that two draws are no slower, and where the grid
        for pictures of `width` pixels would be wider than the driver draws.

        keys_sorted: the keys were sorted with the order, as on a GPU, and are no splat's own.
        """
        sampled = disparities(arena, keys_sorted)
        if not sampled.size:
            return None
        disparity = int(np.rint(np.clip(np.median(sampled), -FARTHEST, FARTHEST)))
        near = np.abs(sampled - disparity).mean() <= MAX_RESIDUAL_DISPARITY
        return disparity if near and grid_width(width, disparity) <= self._gpu.max_side else None

    def draw(
        self, arena: Arena, pictures: list[moderngl.Framebuffer], disparity: int, min_alpha: float,
        unit: float = 1.0,
    ) -> None:  # fmt: skip
        """Draws the arena as it was last projected and sorted into the targets of both views.

        unit: the display value that 1 in these stands for.
        """
        ctx = self._gpu.ctx
        width, height = pictures[0].size
        first = max(-disparity, 0), max(disparity, 0)  # columns of the grid: each picture's first
        size = (grid_width(width, disparity), height)
        both = self._target(size, pictures[0].color_attachments[0].dtype)
        with self._gpu.drawing_into(both):
            both.clear(0.0, 0.0, 0.0, 0.0)
            ctx.enable_only(moderngl.BLEND)
            ctx.blend_func = (moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA)
            bind(order=arena.order, records=arena.records, counts=arena.counts)
            program = self._program
            program["size"].value, program["disparity_offsets"].value = both.size, first
            program["min_alpha"].value, program["count"].value = min_alpha, arena.count
            program["per_unit"].value = 1 / unit
            self._triangles.render_indirect(arena.command, moderngl.TRIANGLES, count=1)
        for picture, source, column in zip(pictures, both.color_attachments, first, strict=True):
            with self._gpu.drawing_into(picture):
                ctx.enable_only(moderngl.NOTHING)
                source.use(0)
                self._move["image"].value, self._move["first"].value = 0, column
                self._screen.render(moderngl.TRIANGLES, vertices=3)
        ctx.memory_barrier()

    def _target(self, size: tuple[int, int], dtype: str) -> moderngl.Framebuffer:
        """Two attachments of this height and at least this width; an old one that is wide enough
        stays, since the disparity changes from frame to frame.
        """
        old = self.targets
        if old is not None and old.width >= size[0] and old.height == size[1]:
            if old.color_attachments[0].dtype == dtype:
                return old
        made = [self._gpu.ctx.texture(size, 4, dtype=dtype) for _ in range(2)]
        self._gpu.allocations += 2
        self._release_targets()
        self.targets = self._gpu.ctx.framebuffer(made)
        return self.targets

    def _release_targets(self) -> None:
        if self.targets is not None:
            release_framebuffer(self.targets)
            self.targets = None

    def release(self) -> None:
        self._release_targets()
        self._triangles.release()
        self._screen.release()


def grid_width(width: int, disparity: int) -> int:
    """Pixels across both pictures where they overlap but for `disparity`; in steps, with room."""
    return -(-(width + abs(disparity)) // STEP) * STEP


def disparities(arena: Arena, keys_sorted: bool = False) -> np.ndarray:
    """Pixels by which splats lie further left in the second view than in the first: a sample of
    those that are drawn in both.
    """
    count, found = arena.count, []
    drawn = drawn_splats(arena) if keys_sorted else None
    for start in np.unique(np.linspace(0, max(count - RUN, 0), SAMPLES).astype(int)).tolist():
        rows = min(RUN, count)
        left, right = (
            np.frombuffer(arena.records.read(32 * rows, offset=32 * (row + start)), np.uint32)
            for row in (0, count)
        )
        left, right = left.reshape(-1, 8), right.reshape(-1, 8)
        if drawn is None:
            keys = np.frombuffer(arena.keys.read(4 * rows, offset=4 * start), np.uint32)
            there = keys != CULLED_KEY
        else:
            there = drawn[start : start + rows]
        both = there & (left[:, 7] > 0) & (right[:, 7] > 0)  # drawn: bits of 0 are 0
        x = [np.ascontiguousarray(view[both, 0]).view(np.float32) for view in (left, right)]
        found.append(x[0] - x[1])
    return np.concatenate(found) if found else np.zeros(0, np.float32)


def drawn_splats(arena: Arena) -> np.ndarray:
    """(N,) bool: the splats that the order holds."""
    place = 4 * COUNTS["SORTED"]
    (count,) = np.frombuffer(arena.counts.read(4, offset=place), np.uint32).tolist()
    drawn = np.zeros(arena.count, bool)
    if count:  # GL maps no empty part of a buffer
        drawn[np.frombuffer(arena.order.read(4 * count), np.uint32)] = True
    return drawn
