"""Draws an eye's picture into another framebuffer: the runtime's image, the mirror's window."""

from dataclasses import dataclass
from pathlib import Path

import moderngl

from shapeshift.renderer.gl.shader import compile_program
from shapeshift.scene.pose import View

SHADERS = Path(__file__).parent / "shaders"
GL_FRAMEBUFFER_SRGB = 0x8DB9
Part = tuple[float, float, float, float]  # left, bottom, width, height, of a picture's 0..1
WHOLE = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True)
class Inset:
    """A picture that lies sharp over a part of another one."""

    texture: moderngl.Texture  # display-encoded, row 0 at the bottom
    part: Part  # of the other


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
        part: Part = WHOLE,
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


def draw_eye(
    blit: Blit, framebuffer: moderngl.Framebuffer, size: tuple[int, int],
    texture: moderngl.Texture, inset: Inset | None = None,
) -> None:  # fmt: skip
    """The middle of an eye's picture into all `size` pixels of a framebuffer, its inset over it."""
    seen = middle(texture.size, size)
    framebuffer.viewport = (0, 0, *size)
    blit.draw(texture, framebuffer, seen)
    if inset is not None:
        framebuffer.viewport = pixels_of(inset.part, seen, size)
        blit.draw(inset.texture, framebuffer)
        framebuffer.viewport = (0, 0, *size)


def pixels_of(part: Part, seen: Part, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Left, bottom, width, height in a picture of `size` that shows `seen` of another, of a `part`
    of that; it may reach beyond the picture.
    """
    ends = []
    for axis in (0, 1):
        per = size[axis] / seen[axis + 2]
        low = round((part[axis] - seen[axis]) * per)
        high = round((part[axis] + part[axis + 2] - seen[axis]) * per)
        ends.append((low, max(high - low, 1)))
    return ends[0][0], ends[1][0], ends[0][1], ends[1][1]


def part_of_whole(view: View) -> Part | None:
    """Where a view lies in the one that it is a part of; None where it is of none."""
    if view.whole is None:
        return None
    left, right, down, up = view.whole
    x, y = 1 / (right - left), 1 / (up - down)
    a, b, c, d = view.tangents
    return (a - left) * x, (c - down) * y, (b - a) * x, (d - c) * y


def middle(size: tuple[int, int], into: tuple[int, int]) -> Part:
    """The largest part in the middle of a picture (W, H) that has the shape of `into` (W, H)."""
    wide = into[0] * size[1] / (into[1] * size[0])  # of the picture's width, 1 high
    width, height = (wide, 1.0) if wide <= 1 else (1.0, 1 / wide)
    return ((1 - width) / 2, (1 - height) / 2, width, height)
