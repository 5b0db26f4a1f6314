"""The pictures of the eyes over the room itself, where the runtime shows it (passthrough)."""

import moderngl
import numpy as np

from shapeshift.renderer.gl.shader import compile_program
from shapeshift.vr.floor import CoverageTexture
from shapeshift.vr.shown import SHADERS


class SeeThrough:
    """Gives an eye's picture over black its alpha; the context may be anybody's."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = compile_program(ctx, "full.vert", "see_through.frag", SHADERS)
        self._triangle = ctx.vertex_array(self._program, [])
        self._coverage = CoverageTexture(ctx)
        self._copy: moderngl.Framebuffer | None = None

    def draw(
        self, framebuffer: moderngl.Framebuffer, coverage: moderngl.Texture | np.ndarray
    ) -> None:
        """In place.  coverage: as Floor.draw has it."""
        ctx, program = self._ctx, self._program
        before = ctx.fbo or ctx.detect_framebuffer(0)
        copy = self._copy_of(framebuffer.size)
        ctx.copy_framebuffer(copy, framebuffer)
        texture, top_first = self._coverage.of(coverage)
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        copy.color_attachments[0].use(0)
        texture.use(1)
        program["picture"].value, program["coverage"].value = 0, 1
        program["top_first"].value = top_first
        framebuffer.use()
        ctx.enable_only(moderngl.NOTHING)
        try:
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
        finally:
            before.use()

    def _copy_of(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        if self._copy is None or self._copy.size != tuple(size):
            self._release_copy()
            self._copy = self._ctx.framebuffer([self._ctx.texture(size, 4)])
        return self._copy

    def _release_copy(self) -> None:
        if self._copy is not None:
            self._copy.color_attachments[0].release()
            self._copy.release()
            self._copy = None

    def release(self) -> None:
        """Gives all of it back; the context stays."""
        self._release_copy()
        self._coverage.release()
        self._triangle.release()
        self._program.release()
