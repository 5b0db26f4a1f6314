"""splat: draws the sorted ellipses back to front into a float target, one a view."""

import moderngl
import numpy as np

from renderer.buffers import Arena, bind
from renderer.gpu import Gpu

DTYPES = {"rgba8": "f1", "rgba16f": "f2", "rgba32f": "f4"}


class Splatter:
    """Owns the images of the views; colour in them is premultiplied over nothing."""

    def __init__(self, gpu: Gpu, target: str = "rgba16f") -> None:
        if target not in DTYPES:
            raise ValueError(f"there is no target {target!r}; choose {', '.join(DTYPES)}.")
        self.target = target  # may change from frame to frame
        self._gpu = gpu
        self._program = gpu.program("splat.vert", "splat.frag")
        self._targets: dict[int, moderngl.Framebuffer] = {}
        # No attributes and no indices: the shader pulls what it draws from the arena.
        self._triangles = gpu.ctx.vertex_array(self._program, [])

    def draw(
        self, arena: Arena, i: int, size: tuple[int, int], min_alpha: float, row: int = 0
    ) -> None:
        """Draws the arena as it was last projected and sorted, into the image of view i.

        row: which of the views that were projected together.
        """
        target = self.target_of(i, size)
        with self._gpu.drawing_into(target):
            target.clear(0.0, 0.0, 0.0, 0.0)
            if arena.count:
                self._draw_triangles(arena, size, min_alpha, row * arena.count)

    def _draw_triangles(
        self, arena: Arena, size: tuple[int, int], min_alpha: float, first: int
    ) -> None:
        ctx = self._gpu.ctx
        ctx.enable_only(moderngl.BLEND)
        ctx.blend_func = (moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA)
        bind(order=arena.order, records=arena.records, counts=arena.counts)
        self._program["size"].value = size
        self._program["min_alpha"].value = min_alpha
        self._program["first"].value = first
        self._triangles.render_indirect(arena.command, moderngl.TRIANGLES, count=1)
        ctx.memory_barrier()  # the next view's project overwrites what this draw still reads

    def texture(self, i: int) -> moderngl.Texture:
        """The image of view i on the GPU, row 0 at the bottom."""
        return self._targets[i].color_attachments[0]

    def image(self, i: int) -> np.ndarray:
        """(H, W, 4) float32 of view i, row 0 on top: the one place where GL's rows are turned."""
        texture = self.texture(i)
        width, height = texture.size
        read = np.uint8 if texture.dtype == "f1" else texture.dtype
        pixels = np.frombuffer(texture.read(), read).reshape(height, width, 4)
        rows = np.ascontiguousarray(pixels[::-1], np.float32)
        return rows / np.float32(255) if read is np.uint8 else rows

    def target_of(self, i: int, size: tuple[int, int]) -> moderngl.Framebuffer:
        """The image of view i to draw into, of this size and of the kind in use."""
        old, dtype = self._targets.get(i), DTYPES[self.target]
        if old is not None and old.size == tuple(size) and old.color_attachments[0].dtype == dtype:
            return old
        made = self._gpu.target(size, dtype)  # before the old one goes: it may be refused
        if old is not None:
            _release_target(old)
        self._targets[i] = made
        return made

    def release(self) -> None:
        for target in self._targets.values():
            _release_target(target)
        self._targets.clear()
        self._triangles.release()

    def __enter__(self) -> "Splatter":
        return self

    def __exit__(self, *failure) -> None:
        self.release()


def _release_target(target: moderngl.Framebuffer) -> None:
    target.color_attachments[0].release()
    target.release()
