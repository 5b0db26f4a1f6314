"""Flat pictures in the room: the panel's texture, and cards, kept while they are right."""

from collections.abc import Callable, Hashable

import moderngl
import numpy as np

from shapeshift.renderer.gl.shader import compile_program
from shapeshift.vr.shown import SHADERS


class Flats:
    """The program for them, whose uniforms of the depth others set, and a texture a slot."""

    def __init__(self, ctx: moderngl.Context, taps: int) -> None:
        self._ctx = ctx
        self.program = compile_program(ctx, "panel.vert", "panel.frag", SHADERS, TAPS=taps)
        self._corners = ctx.vertex_array(self.program, [])
        self._kept: dict[str, tuple[Hashable, moderngl.Texture]] = {}

    def draw(
        self,
        slot: str,
        key: Hashable,
        make: Callable[[], np.ndarray],
        clip_from_flat: np.ndarray,
        size_m: tuple[float, float],
        opacity: float = 1.0,
    ) -> None:
        """Draws a picture, (H, W, 4) uint8 premultiplied, row 0 on top; made where the key of its
        slot is another one than before.
        """
        before = self._kept.get(slot)
        if before is None or before[0] != key:
            self._kept[slot] = key, self._upload(make(), before[1] if before else None)
        self._render(self._kept[slot][1], clip_from_flat, size_m, opacity, 0.0, True)

    def show(
        self, texture: moderngl.Texture, clip_from_flat: np.ndarray, size_m: tuple[float, float],
        corner_m: float, cut: bool = False,
    ) -> None:  # fmt: skip
        """Draws a texture of somebody else's, opaque, row 0 below, with round corners; cut: black,
        with alpha where it is.
        """
        self._render(texture, clip_from_flat, size_m, 1.0, corner_m, False, cut)

    def _render(
        self, texture: moderngl.Texture, clip_from_flat: np.ndarray, size_m: tuple[float, float],
        opacity: float, corner_m: float, top_first: bool, cut: bool = False,
    ) -> None:  # fmt: skip
        program = self.program
        texture.use(0)
        program["picture"].value = 0
        program["opacity"].value = opacity
        program["corner"].value, program["cut"].value = corner_m, cut
        program["top_first"].value = top_first
        program["clip_from_panel"].write(clip_from_flat.T.astype(np.float32).tobytes())
        program["half_size"].value = tuple(side / 2 for side in size_m)
        self._corners.render(moderngl.TRIANGLE_STRIP, vertices=4)

    def _upload(self, picture: np.ndarray, texture: moderngl.Texture | None) -> moderngl.Texture:
        """A texture with its smaller levels, the one of before where it has that size."""
        size = (picture.shape[1], picture.shape[0])
        if texture is None or texture.size != size:
            if texture is not None:
                texture.release()
            texture = self._ctx.texture(size, 4)
            texture.repeat_x = texture.repeat_y = False
        texture.write(np.ascontiguousarray(picture))
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture

    def release(self) -> None:
        for _, texture in self._kept.values():
            texture.release()
        self._kept.clear()
        self._corners.release()
        self.program.release()
