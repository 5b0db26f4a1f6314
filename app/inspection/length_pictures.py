"""Measured lengths in reports and pictures: a table's rows, and lines over a photo."""

from collections.abc import Sequence

import numpy as np

from shapeshift.app.inspection.pictures import BEHIND, LINE
from shapeshift.scene.inspection.length_marks import LengthMark
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

LENGTH_COLUMNS = ("length", "kind", "value", "note")
LENGTHS_WORDS = "Lengths, angles and areas have one standard deviation beside them."
KIND_WORDS = {"distance": "distance", "polyline": "way", "angle": "angle", "area": "area"}
Measured = Sequence[tuple[LengthMark, str]]  # and what it comes to, in words


def length_rows(measured: Measured) -> list[tuple[str, ...]]:
    """The cells of LENGTH_COLUMNS."""
    return [(each.name, KIND_WORDS[each.kind], words, each.note) for each, words in measured]


def with_lengths(image: np.ndarray, view: View, measured: Measured) -> np.ndarray:
    """(H, W, 3) the picture of a view with what was measured: lines, points, names and values."""
    if not measured:
        return image
    from PIL import Image, ImageDraw

    from shapeshift.renderer.debug.letters import drawable, letters

    drawn = Image.fromarray((np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8))
    draw = ImageDraw.Draw(drawn)
    height = max(10, drawn.height // 36)  # pixels of a letter
    font, dot = letters(height), max(2, height // 5)
    through = ValuePicture(view, np.zeros((0, 0)), np.zeros((0, 0)))
    places = [through.pixel_of(each.points)[0] for each, _ in measured]
    shown = [np.isfinite(pixels).all() for pixels in places]  # else behind the eye, in part
    for (each, _), pixels, is_shown in zip(measured, places, shown, strict=True):
        corners = [(float(x), float(y)) for x, y in pixels] if is_shown else []
        way = [*corners, *corners[:1]] if each.kind == "area" else corners
        for color, width in ((BEHIND, dot + 2), (LINE, max(1, dot // 2))):
            draw.line(way, fill=color, width=width)
        for x, y in corners:
            draw.ellipse((x - dot, y - dot, x + dot, y + dot), fill=LINE, outline=BEHIND)
    for (each, words), pixels, is_shown in zip(measured, places, shown, strict=True):
        if not is_shown:
            continue
        text = drawable(f"{each.name}  {words}", height)
        at = pixels[1] if each.kind == "angle" else pixels.mean(axis=0)
        wide = draw.textlength(text, font) + 4
        left = min(max(at[0] + dot + 2, 0), max(drawn.width - wide, 0))
        top = min(max(at[1] + dot + 2, 0), max(drawn.height - height - 6, 0))
        draw.rectangle((left, top, left + wide, top + height + 4), fill=BEHIND)
        draw.text((left + 2, top + 1), text, fill=LINE, font=font)
    return np.asarray(drawn, np.float32) / 255
