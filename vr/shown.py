"""Draws an eye's picture into another framebuffer: the runtime's image, the mirror's window."""

from pathlib import Path

import moderngl

from shapeshift.renderer.gl.shader import compile_program

SHADERS = Path(__file__).parent / "shaders"
GL_FRAMEBUFFER_SRGB = 0x8DB9
WHOLE = (0.0, 0.0, 1.0, 1.0)  # left, bottom, width, height


class Blit:
    """The one program for that; display values in, display values or light out."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = compile_program(ctx, "full.vert", "shown.frag", SHADERS)
        self._triangle = ctx.vertex_array(self._program, [])

    def draw(
        self,
        texture: moderngl.Texture,
        framebuffer: moderngl.Framebuffer,
        part: tuple[float, float, float, float] = WHOLE,
        linear: bool = False,
    ) -> None:
        """Fills the framebuffer's viewport with `part` of the texture; row 0 at the bottom."""
        as_it_is = part == WHOLE and texture.size == tuple(framebuffer.viewport[2:])
        before = texture.filter
        texture.filter = (moderngl.NEAREST,) * 2 if as_it_is else (moderngl.LINEAR,) * 2
        texture.repeat_x = texture.repeat_y = False
        texture.use(0)
        self._program["image"].value = 0
        self._program["part"].value = part
        self._program["linear"].value = linear
        framebuffer.use()
        self._ctx.enable_only(moderngl.NOTHING)
        self._ctx.disable_direct(GL_FRAMEBUFFER_SRGB)
        self._triangle.render(moderngl.TRIANGLES, vertices=3)
        texture.filter = before

    def release(self) -> None:
        self._triangle.release()
        self._program.release()


def middle(size: tuple[int, int], into: tuple[int, int]) -> tuple[float, float, float, float]:
    """The largest part in the middle of a picture (W, H) that has the shape of `into` (W, H)."""
    wide = into[0] * size[1] / (into[1] * size[0])  # of the picture's width, 1 high
    width, height = (wide, 1.0) if wide <= 1 else (1.0, 1 / wide)
    return ((1 - width) / 2, (1 - height) / 2, width, height)
