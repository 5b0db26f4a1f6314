"""splat: draws the sorted ellipses back to front into a picture, one a view."""

import moderngl
import numpy as np

from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, release_framebuffer
from shapeshift.renderer.gl.target import DTYPES, HiddenDepths
from shapeshift.scene.pose import View

FULL = {np.dtype(np.uint8): 255, np.dtype(np.uint16): 65535}  # what stands for 1


class Splatter:
    """Owns the images of the views; colour in them is premultiplied over nothing."""

    def __init__(self, gpu: Gpu, target: str = "rgba16", unit: float = 1.0) -> None:
        if target not in DTYPES:
            raise ValueError(f"there is no target {target!r}; choose {', '.join(DTYPES)}.")
        # Both may change from frame to frame.  unit: the display value that 1 in the picture means.
        self.target, self.unit = target, unit
        self._gpu = gpu
        self._programs: dict[bool, tuple[moderngl.Program, moderngl.VertexArray]] = {}
        self.program_for(heat=False)
        self._targets: dict[int, moderngl.Framebuffer] = {}
        self._units: dict[int, float] = {}  # of the images
        self._hidden = HiddenDepths(gpu)

    def program_for(self, heat: bool) -> tuple[moderngl.Program, moderngl.VertexArray]:
        """What draws pictures with heat, or without; compiled at the first call."""
        if heat not in self._programs:
            program = self._gpu.program("splat.vert", "splat.frag", HEAT=int(heat))
            # No attributes and no indices: the shader pulls what it draws from the arena.
            self._programs[heat] = program, self._gpu.ctx.vertex_array(program, [])
        return self._programs[heat]

    def draw(
        self,
        arena: Arena,
        i: int,
        size: tuple[int, int],
        min_alpha: float,
        row: int = 0,
        heat: moderngl.Buffer | None = None,
        view: View | None = None,
        covered: tuple[int, int] | None = None,
    ) -> None:
        """Draws the arena as it was last projected and sorted, into the image of view i.

        row: which of the views that were projected together.  heat: what is drawn into a second
        image in addition.  view: whose hidden mesh stays empty.  covered: pixels of the
        projection that the image shows, where these are not its own.
        """
        target = self.target_of(i, size, heat is not None)
        hides = view is not None and view.hidden is not None
        if view is not None and hides:
            target = self._hidden.around(i, target, view)
        with self._gpu.drawing_into(target):
            if not hides:
                target.clear(0.0, 0.0, 0.0, 0.0)
            if arena.count:
                self._draw_triangles(
                    arena, covered or size, min_alpha, row * arena.count, heat, hides
                )

    def _draw_triangles(
        self, arena: Arena, size: tuple[int, int], min_alpha: float, first: int,
        heat: moderngl.Buffer | None, hides: bool,
    ) -> None:  # fmt: skip
        ctx = self._gpu.ctx
        program, triangles = self.program_for(heat is not None)
        if heat is not None:
            bind(heat=heat)
        ctx.enable_only(moderngl.BLEND | (moderngl.DEPTH_TEST if hides else 0))
        ctx.blend_func = (moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA)
        bind(order=arena.order, records=arena.records, counts=arena.counts)
        program["size"].value = size
        program["min_alpha"].value = min_alpha
        program["first"].value = first
        program["per_unit"].value = 1 / self.unit
        triangles.render_indirect(arena.command, moderngl.TRIANGLES, count=1)
        ctx.memory_barrier()  # the next view's project overwrites what this draw still reads

    def texture(self, i: int, of: int = 0) -> moderngl.Texture:
        """The image of view i on the GPU, row 0 at the bottom; its colours count in unit_of(i).

        of 1: its heat, value and weight, of which the value counts so.
        """
        return self._targets[i].color_attachments[of]

    def unit_of(self, i: int) -> float:
        """The display value that 1 in the image of view i stands for."""
        return self._units[i]

    def image(self, i: int, of: int = 0) -> np.ndarray:
        """(H, W, 4) float32 of view i, row 0 on top: the one place where GL's rows are turned."""
        texture = self.texture(i, of)
        width, height = texture.size
        kind = np.dtype({"f1": np.uint8, "nu2": np.uint16}.get(texture.dtype, texture.dtype))
        pixels = np.frombuffer(texture.read(), kind).reshape(height, width, 4)
        rows = np.ascontiguousarray(pixels[::-1], np.float32)
        if kind in FULL:
            rows /= np.float32(FULL[kind])
        if self._units[i] != 1:
            rows[..., : 1 if of else 3] *= np.float32(self._units[i])
        return rows

    def target_of(self, i: int, size: tuple[int, int], heat: bool = False) -> moderngl.Framebuffer:
        """The image of view i to draw into, of this size and of the kind in use; heat: two."""
        old, dtype = self._targets.get(i), DTYPES[self.target]
        images = 1 + heat
        self._units[i] = self.unit
        if old is not None and old.size == tuple(size) and len(old.color_attachments) == images:
            if old.color_attachments[0].dtype == dtype:
                return old
        made = self._gpu.target(size, dtype, images)  # before the old one goes: it may be refused
        if old is not None:
            release_framebuffer(old)
        self._targets[i] = made
        return made

    def release(self) -> None:
        self._hidden.release()
        for target in self._targets.values():
            release_framebuffer(target)
        self._targets.clear()
        for _, triangles in self._programs.values():
            triangles.release()

    def __enter__(self) -> "Splatter":
        return self

    def __exit__(self, *failure) -> None:
        self.release()
