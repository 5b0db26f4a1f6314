"""The panel's picture: dark and neutral, one warm accent, letters that are read at arm's length."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.renderer.colors.palette import legend_opacity, palette_colors, thermal_weights
from shapeshift.renderer.debug.letters import drawable, letters
from shapeshift.renderer.debug.ticks import nice_ticks, tick_text
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import StopBlend
from shapeshift.vr.panel.panel_layout import (
    CORNER,
    KNOB,
    MARGIN,
    TRACK,
    WIDTH,
    Box,
    Item,
    Layout,
    knob_place,
    lay_out,
    thermal_stop,
)
from shapeshift.vr.panel.panel_state import ON_STOP, Panel, Place, Slider, shown_stop, size_text

if TYPE_CHECKING:
    from PIL import Image, ImageDraw

Ink = tuple[int, int, int]

# As the desktop's overlay, lighter: a headset's lenses take contrast away
ACCENT, TEXT, MUTED = (246, 168, 76), (240, 240, 242), (172, 175, 182)
SURFACE, RAISED, LIFTED, LINE = (26, 27, 31), (50, 52, 58), (74, 77, 85), (92, 95, 102)
EDGE, WARNING = (70, 73, 80), (214, 74, 62)
# Heights of letters.  At 0.45 m and 1,000 pixels an eye about 360 pixels show the panel's width, so
# that 36 of its pixels are 13 of the headset.
TITLE, BIG, BODY, SMALL, LEAST = 36, 68, 38, 32, 28
FINE = 4  # corners are drawn so much larger, then made small: no stairs
STEPS = 500  # of the slider's range: finer moves of the knob are not seen
FAINT = 0.45  # of a legend's colours, while its stop is not shown


def panel_picture(panel: Panel) -> np.ndarray:
    """(H, W, 4) uint8 display sRGB premultiplied by alpha, row 0 on top."""
    from PIL import ImageDraw

    layout = lay_out(panel)
    image = _plate(layout, panel.facts.note).copy()
    draw, lit = ImageDraw.Draw(image), _lit(panel)
    for item in layout.items:
        if _is_lit(item, lit):
            _button(image, draw, lit, item)
    _head(draw, panel, layout)
    if panel.slider is not None:
        if layout.legend is not None:
            _legend(image, draw, panel.slider, thermal_stop(panel), layout.legend)
        _slider(image, draw, panel, layout)
    return np.asarray(image)


def picture_key(panel: Panel) -> tuple:
    """Equal for panels that look alike: what a picture can be kept for."""
    slider = panel.slider
    x = None if slider is None else (slider.name, slider.stops, round(slider.x * STEPS))
    on = slider is not None and any(abs(s.x - slider.x) <= ON_STOP for s in slider.stops)
    return lay_out(panel), _lit(panel), panel.facts.note, x, on, _knob_state(panel)


@dataclass(frozen=True)
class _Lit:
    """How the buttons stand."""

    quality: str
    scale: float
    held: frozenset[str]
    hovered: frozenset[str]
    asks: bool  # Exit asks "really?"
    floor: bool = False  # the floor's grid is shown

    @property
    def true(self) -> bool:
        return abs(self.scale - 1) < 1e-3


UNLIT = _Lit("", 0.0, frozenset(), frozenset(), False)


def _lit(panel: Panel) -> _Lit:
    held, hovered = (
        frozenset(names.values()) - {"track", "plate"} for names in (panel.held, panel.hovers)
    )
    facts = panel.facts
    return _Lit(facts.quality, facts.scale, held, hovered, panel.exit_s > 0, facts.floor)


def _knob_state(panel: Panel) -> str:
    if "track" in panel.held.values():
        return "held"
    return "hovered" if "track" in panel.hovers.values() else ""


def _is_lit(item: Item, lit: _Lit) -> bool:
    """Whether it looks otherwise than on the plate."""
    name = item.name
    return (
        name in ("size", f"quality:{lit.quality}")
        or name in lit.held | lit.hovered
        or (name == "exit" and lit.asks)
        or (name == "true" and lit.true)
        or (name == "floor" and lit.floor)
    )


@lru_cache(maxsize=16)
def _plate(layout: Layout, note: str) -> "Image.Image":
    """All that stays, RGBA premultiplied: the plate, labels, the note, buttons that nobody touches.

    It takes ten times as long as what is drawn over it: a panel in use must not cost a frame.
    """
    from PIL import Image, ImageDraw

    width, height = layout.size
    image = Image.new("RGB", layout.size, EDGE)
    _fill(image, (3, 3, width - 3, height - 3), SURFACE, CORNER - 3)
    draw = ImageDraw.Draw(image)
    for text, (left, middle) in layout.labels:
        _text(draw, (left, middle), text, BODY, MUTED, "lm")
    for item in layout.items:
        if item.name != "track":
            _button(image, draw, UNLIT, item)
    if layout.foot is not None:
        text, em = _fitted(note, SMALL, width - 2 * MARGIN, LEAST)
        _text(draw, (width / 2, layout.foot), text, em, MUTED, "mm")
    alpha = np.asarray(_rounded(layout.size, CORNER))[..., None]
    rgb = np.asarray(image, np.uint16) * alpha // 255
    return Image.fromarray(np.concatenate([rgb.astype(np.uint8), alpha], axis=2))


def _head(draw: "ImageDraw.ImageDraw", panel: Panel, layout: Layout) -> None:
    """Whose slider it is, and large which stop is shown."""
    left, top, right, _ = layout.head
    slider = panel.slider
    if slider is None:
        _text(draw, (left, top + 36), "Shapeshift", BIG - 12, ACCENT, "lm", True)
        _text(draw, (left, top + 92), "nothing here changes its shape", SMALL, MUTED, "lm")
        return
    arrows = 210 if len(panel.facts.sliders) > 1 else 0
    name, em = _fitted(slider.name, TITLE, right - left - arrows, LEAST)
    _text(draw, (left, top + 24), name, em, MUTED, "lm")
    text, em = _fitted(shown_stop(slider), BIG, right - left - arrows, BODY, True)
    _text(draw, (left, top + 92), text, em, ACCENT, "lm", True)


def _slider(
    image: "Image.Image", draw: "ImageDraw.ImageDraw", panel: Panel, layout: Layout
) -> None:
    """The line up to the knob in the accent, a dot and a name at each stop, the knob."""
    slider, y, half = panel.slider, layout.track_y, 7
    x, _ = knob_place(panel)
    _fill(image, (TRACK[0] - half, y - half, TRACK[1] + half, y + half), LINE, half)
    _fill(image, (TRACK[0] - half, y - half, TRACK[0] + half, y + half), ACCENT, half)
    draw.rectangle((TRACK[0], y - half, x, y + half - 1), fill=ACCENT)  # its end is under the knob
    for stop in slider.stops:
        at = _along(stop)
        _fill(image, (at - 12, y - 12, at + 12, y + 12), TEXT, 12)
    shown = next((s for s in slider.stops if abs(s.x - slider.x) <= ON_STOP), None)
    names, em = _placed_names(slider.stops, shown)
    for stop, (middle, beside) in names:
        on = stop == shown
        _text(draw, (middle, y + beside), stop.name, em, ACCENT if on else TEXT, "mm", on)
    state = _knob_state(panel)
    held = state == "held"
    radius = KNOB + {"held": 5, "hovered": 2, "": 0}[state]
    _fill(image, (x - radius, y - radius, x + radius, y + radius), TEXT if held else ACCENT, radius)
    inner = radius * 0.42
    _fill(image, (x - inner, y - inner, x + inner, y + inner), ACCENT if held else SURFACE, inner)


@lru_cache(maxsize=64)
def _placed_names(
    stops: tuple[Stop, ...], shown: Stop | None
) -> tuple[list[tuple[Stop, Place]], int]:
    """The stops whose names find room, the middle of each beside the line, and their letters'
    height: above the line where they can, else smaller, and below it.

    The one that is shown always does, then the ends, then as they come.
    """
    ranks = {s.x: rank for rank, s in enumerate(sorted(stops, key=lambda s: s.x))}
    order = sorted(stops, key=lambda s: (s != shown, min(s.x, 1 - s.x), s.x))
    for em, lanes in ((BODY, (-66,)), (SMALL, (-66,)), (LEAST, (-66, 56))):
        placed: list[tuple[Stop, Place]] = []
        spans: list[tuple[float, float, int]] = []
        for stop in order:
            half = letters(em, bold=True).getlength(drawable(stop.name, em)) / 2
            middle = min(max(_along(stop), MARGIN + half), WIDTH - MARGIN - half)
            low, high = middle - half - 16, middle + half + 16
            for lane in lanes if ranks[stop.x] % 2 == 0 else lanes[::-1]:
                if all(high < a or b < low for a, b, other in spans if other == lane):
                    placed.append((stop, (middle, lane)))
                    spans.append((middle - half, middle + half, lane))
                    break
        if len(placed) == len(order):
            break
    return placed, em


def _legend(
    image: "Image.Image", draw: "ImageDraw.ImageDraw", slider: Slider, stop: Stop, box: Box
) -> None:
    """The palette from its least to its greatest value with round values below; faint while the
    thermal stop is not what is shown.
    """
    from PIL import Image

    weight = float(thermal_weights(StopBlend(slider.stops), slider.x)[0][0])
    strength = FAINT + (1 - FAINT) * legend_opacity(weight)
    left, top, right, _ = box
    unit = f"{stop.palette}, {stop.unit}" if stop.unit else stop.palette
    ink = _mixed(SURFACE, TEXT, strength)
    title, em = _fitted(stop.name, SMALL, (right - left) * 0.6, LEAST)
    _text(draw, (left, top + 16), title, em, ink, "lm")
    _text(draw, (right, top + 16), unit, SMALL, ink, "rm")
    high, low_y, high_y = round(right - left), round(top + 42), round(top + 72)
    places = np.linspace(0, 255, high).round().astype(int)
    colors = palette_colors(stop.palette)[places] * 255  # (pixels, 3)
    mixed = np.asarray(SURFACE) + (colors - SURFACE) * strength
    bar = np.repeat(mixed[None], high_y - low_y, axis=0)
    strip = Image.fromarray(bar.round().astype(np.uint8)).convert("RGBA")
    image.paste(strip, (round(left), low_y), _rounded(strip.size, 8))
    if stop.value_range is None:
        return
    least, most = stop.value_range
    values = nice_ticks(least, most)
    for value, text in zip(values, tick_text(values), strict=True):
        at = left + (right - left) * (value - least) / (most - least if most > least else 1.0)
        half = letters(LEAST).getlength(text) / 2
        draw.line((at, high_y + 2, at, high_y + 9), fill=ink, width=3)
        _text(draw, (min(max(at, left + half), right - half), high_y + 26), text, LEAST, ink, "mm")


def _button(image: "Image.Image", draw: "ImageDraw.ImageDraw", lit: _Lit, item: Item) -> None:
    """A flat button; lit when it is the choice, pointed at, or pressed."""
    chosen = item.name == f"quality:{lit.quality}" or (item.name == "floor" and lit.floor)
    held = item.name in lit.held
    hovered = item.name in lit.hovered
    fill, ink, text = RAISED, TEXT, item.text
    if item.name == "size":
        fill, text = SURFACE, size_text(lit.scale) if lit.scale > 0 else ""
    elif held or chosen:
        fill, ink = ACCENT, SURFACE
    elif hovered:
        fill = LIFTED
    if item.name == "exit" and lit.asks and not held:
        fill, ink = WARNING, TEXT
    if item.name == "exit" and lit.asks:
        text = "Really exit?"
    if item.name == "true" and lit.true and not held:
        ink = MUTED
    _fill(image, item.box, fill, 20)
    if hovered and item.name != "size":
        _fill(image, item.box, TEXT, 20, inside=4)
    left, top, right, bottom = item.box
    em = BIG - 8 if len(text) == 1 else BODY
    text, em = _fitted(text, em, right - left - 20, LEAST)
    _text(draw, ((left + right) / 2, (top + bottom) / 2), text, em, ink, "mm")


def _along(stop: Stop) -> float:
    return TRACK[0] + stop.x * (TRACK[1] - TRACK[0])


def _mixed(a: Ink, b: Ink, part: float) -> Ink:
    return tuple(round(p + (q - p) * part) for p, q in zip(a, b, strict=True))


def _text(draw, at, text: str, em: int, ink: Ink, anchor: str, bold: bool = False) -> None:
    draw.text(at, drawable(text, em), fill=ink, font=letters(em, bold), anchor=anchor)


@lru_cache(maxsize=512)
def _fitted(text: str, em: int, room: float, least: int, bold: bool = False) -> tuple[str, int]:
    """The text and the height of its letters so that it fits: smaller first, then cut short."""
    text = drawable(text, em)
    while em > least and letters(em, bold).getlength(text) > room:
        em -= 2
    if letters(em, bold).getlength(text) <= room:
        return text, em
    while text and letters(em, bold).getlength(text + "\u2026") > room:
        text = text[:-1]
    return text.rstrip() + "\u2026", em


def _fill(image: "Image.Image", box: Box, ink: Ink, radius: float, inside: int = 0) -> None:
    """A rounded box; with `inside` only a rim so many pixels thick."""
    left, top, right, bottom = (round(edge) for edge in box)
    size = (max(right - left, 1), max(bottom - top, 1))
    image.paste(ink, (left, top), _rounded(size, min(radius, min(size) / 2), inside))


@lru_cache(maxsize=256)
def _rounded(size: tuple[int, int], radius: float, inside: int = 0) -> "Image.Image":
    """A mask with round corners and smooth edges."""
    from PIL import Image, ImageDraw

    width, height = size
    large = Image.new("L", (width * FINE, height * FINE), 0)
    box = (0, 0, width * FINE - 1, height * FINE - 1)
    draw = ImageDraw.Draw(large)
    draw.rounded_rectangle(box, radius * FINE, fill=255)
    if inside:
        t = inside * FINE
        inner = (t, t, box[2] - t, box[3] - t)
        draw.rounded_rectangle(inner, max(radius * FINE - t, 0), fill=0)
    return large.resize(size, Image.Resampling.BOX)
