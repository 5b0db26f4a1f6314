"""Small cards with a few words in the room: what buttons do, and notices; no one presses them.

Drawn by Pillow with the letters of the debug legends: a card is a picture of its own size, made
once, and the panel that ImGui draws may be closed while cards hang.  vr/ knows no ImGui.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from shapeshift.renderer.debug.letters import drawable, letters
from shapeshift.scene.pose import Pose

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
