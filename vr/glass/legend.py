"""What stands at a glass: the name of the stop on its rim, and beside it what its colours mean."""

from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from shapeshift.renderer.colors.palette import palette_between
from shapeshift.renderer.debug.letters import drawable, letters
from shapeshift.renderer.debug.ticks import nice_ticks, tick_text
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.pose import Pose
from shapeshift.vr.card import (
    CORNER_PX,
    EM,
    HALF_CLEAR,
    LINE_PX,
    PAD_PX,
    SURFACE,
    TEXT,
    Card,
)
from shapeshift.vr.frame import SIDES
from shapeshift.vr.glass.held import RIM_M, HeldGlass

BAR_PX, TALL_PX, TICK_PX = 44, 480, 14  # width of the colours, height of all, length of a tick
COUNT = 5  # ticks, about
GAP_M = 0.010


@dataclass(frozen=True)
class GlassScale:
    """What a palette's colours stand for."""

    palette: str
    low: float
    high: float
    unit: str
    ends: tuple[float, float] = (0.0, 1.0)  # shares of the range at the palette's ends

    @staticmethod
    def of(stop: Stop | None, palette: str, ends: tuple[float, float]) -> "GlassScale | None":
        """That of a value stop; None where there is none, or nobody knows its values."""
        if stop is None or not palette or stop.value_range is None:
            return None
        return GlassScale(palette, *stop.value_range, stop.unit, ends)


@dataclass(frozen=True)
class ScaleCard(Card):
    """A card with colours and values instead of words."""

    scale: GlassScale | None = None

    def picture(self) -> np.ndarray:
        assert self.scale is not None
        return scale_picture(self.scale)

    @property
    def key(self) -> Hashable:
        return self.scale


def cards_of(glass: HeldGlass, side: str, stop: str, scale: GlassScale | None) -> tuple[Card, ...]:
    """The stop's name over the rim, and its scale outwards of the glass."""
    name = Card((stop,), glass.play_from_glass)
    height = name.size_m[1]
    place = glass.point(0.0, glass.radius_m + RIM_M + height / 2)
    cards: list[Card] = [Card((stop,), Pose(place, glass.play_from_glass.wxyz))]
    if scale is not None:
        legend = ScaleCard((scale.unit,), glass.play_from_glass, scale=scale)
        outwards = -1.0 if side == SIDES[0] else 1.0
        aside = outwards * (glass.radius_m + RIM_M + GAP_M + legend.size_m[0] / 2)
        pose = Pose(glass.point(aside, 0.0), glass.play_from_glass.wxyz)
        cards.append(ScaleCard((scale.unit,), pose, scale=scale))
    return tuple(cards)


@lru_cache(maxsize=8)
def scale_picture(scale: GlassScale) -> np.ndarray:
    """(H, W, 4) uint8 display sRGB premultiplied by alpha, row 0 on top."""
    from PIL import Image, ImageDraw

    font, bold = letters(EM), letters(EM, True)
    values = nice_ticks(scale.low, scale.high, COUNT)
    texts = [drawable(text, EM) for text in tick_text(values)]
    unit = drawable(scale.unit, EM)
    right = PAD_PX + BAR_PX + 2 * TICK_PX
    wide = max([right + font.getlength(text) for text in texts] + [PAD_PX + bold.getlength(unit)])
    size = (int(wide) + PAD_PX, TALL_PX)
    image, mask = Image.new("RGB", size, SURFACE), Image.new("L", size, 0)
    box = (0, 0, size[0] - 1, size[1] - 1)
    ImageDraw.Draw(mask).rounded_rectangle(box, CORNER_PX, fill=round(255 * HALF_CLEAR))
    draw, ink = ImageDraw.Draw(image), ImageDraw.Draw(mask)
    first, last = PAD_PX + (LINE_PX if unit else LINE_PX // 2), TALL_PX - PAD_PX - EM // 2
    pieces: list[tuple] = [((PAD_PX, PAD_PX + EM // 2), unit, bold)] if unit else []
    for value, text in zip(values, texts, strict=True):
        y = last - (last - first) * (value - scale.low) / ((scale.high - scale.low) or 1.0)
        for canvas, fill in ((draw, TEXT), (ink, 255)):
            canvas.line((PAD_PX + BAR_PX, y, PAD_PX + BAR_PX + TICK_PX, y), fill=fill, width=3)
        pieces.append(((right, y), text, font))
    for at, text, face in pieces:
        draw.text(at, text, fill=TEXT, font=face, anchor="lm")
        ink.text(at, text, fill=255, font=face, anchor="lm")
    pixels, alpha = np.array(image), np.array(mask)
    colors = palette_between(scale.palette, scale.ends)
    rows = np.rint(np.linspace(len(colors) - 1, 0, last - first)).astype(int)
    bar = (slice(first, last), slice(PAD_PX, PAD_PX + BAR_PX))
    pixels[bar] = np.rint(255 * np.clip(colors[rows], 0, 1)).astype(np.uint8)[:, None]
    alpha[bar] = 255
    rgb = pixels.astype(np.uint16) * alpha[..., None] // 255
    return np.concatenate([rgb.astype(np.uint8), alpha[..., None]], axis=2)
