"""Small cards with a few words in the room: what buttons do, and notices; no one presses them.

Drawn by Pillow with the letters of the debug legends: a card is a picture of its own size, made
once, and the panel that ImGui draws may be closed while cards hang.  vr/ knows no ImGui.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import lru_cache

import moderngl
import numpy as np

from shapeshift.renderer.debug.letters import drawable, letters
from shapeshift.renderer.gl.shader import compile_program
from shapeshift.scene.pose import Pose
from shapeshift.vr.shown import SHADERS

# Display sRGB, lighter than on a desk: a headset's lenses take contrast away
TEXT, MUTED, SURFACE = (240, 240, 242), (172, 175, 182), (26, 27, 31)
EM, LINE_PX, PAD_PX, CORNER_PX = 40, 58, 26, 26  # of its picture
METRES_PER_PIXEL = 0.00026  # letters of 10 mm: ten pixels high in an eye of 1,000 at 0.45 m
HALF_CLEAR = 0.86  # opacity of the ground


@dataclass(frozen=True)
class Card:
    """Lines of text, each "what: does" or a sentence, and where they hang."""

    lines: tuple[str, ...]
    play_from_card: Pose
    opacity: float = 1.0
    larger: float = 1.0  # than METRES_PER_PIXEL makes it: for what hangs far away

    def picture(self) -> np.ndarray:
        """(H, W, 4) uint8 premultiplied, row 0 on top."""
        return card_picture(self.lines)

    @property
    def key(self) -> Hashable:
        """Cards of equal keys have the same picture."""
        return self.lines

    @property
    def size_m(self) -> tuple[float, float]:
        height, width = self.picture().shape[:2]
        per_pixel = METRES_PER_PIXEL * self.larger
        return width * per_pixel, height * per_pixel


@lru_cache(maxsize=32)
def card_picture(lines: tuple[str, ...]) -> np.ndarray:
    """(H, W, 4) uint8 display sRGB premultiplied by alpha, row 0 on top."""
    from PIL import Image, ImageDraw

    font, bold = letters(EM), letters(EM, True)
    parts = [line.partition(": ") for line in lines]
    names = [drawable(name + sign.strip(), EM) for name, sign, _ in parts]
    texts = [drawable(text, EM) for _, _, text in parts]
    gap = 14
    left = max((bold.getlength(n) for n, t in zip(names, texts, strict=True) if t), default=0)
    wide = max(
        left + gap + font.getlength(t) if t else font.getlength(n)
        for n, t in zip(names, texts, strict=True)
    )
    size = (int(wide) + 2 * PAD_PX, LINE_PX * len(lines) + 2 * PAD_PX - 14)
    image = Image.new("RGB", size, SURFACE)
    mask = Image.new("L", size, 0)
    box = (0, 0, size[0] - 1, size[1] - 1)
    ImageDraw.Draw(mask).rounded_rectangle(box, CORNER_PX, fill=round(255 * HALF_CLEAR))
    draw, ink = ImageDraw.Draw(image), ImageDraw.Draw(mask)
    for row, (name, text) in enumerate(zip(names, texts, strict=True)):
        middle = PAD_PX - 7 + LINE_PX * (row + 0.5)
        pieces: list[tuple] = [(PAD_PX, name, TEXT, bold if text else font)]
        pieces += [(PAD_PX + left + gap, text, MUTED, font)] if text else []
        for x, word, colour, face in pieces:
            draw.text((x, middle), word, fill=colour, font=face, anchor="lm")
            ink.text((x, middle), word, fill=255, font=face, anchor="lm")
    alpha = np.asarray(mask)[..., None]
    rgb = np.asarray(image, np.uint16) * alpha // 255
    return np.concatenate([rgb.astype(np.uint8), alpha], axis=2)


# Flat pictures in the room: the panel's texture, and cards, kept while they are right.


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
