"""A legend in the corner of a debug picture."""

import numpy as np

from shapeshift.runtime_models.files.plain_text import name_line

Rows = list[tuple[str, tuple[float, float, float]]]
TEXT = (235, 235, 235)
BEHIND = (16, 16, 16)


def with_legend(picture: np.ndarray, rows: Rows) -> np.ndarray:
    """(H, W, 3) display sRGB with the rows (text, colour) written into its upper left corner."""
    if not rows:
        return picture
    from PIL import Image, ImageDraw

    from shapeshift.renderer.debug.letters import drawable, letters

    image = Image.fromarray((np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    height = max(11, image.height // 45)  # pixels of a line's letters
    font = letters(height)
    rows = [(drawable(name_line(text), height), color) for text, color in rows]
    line, margin = round(height * 1.4), round(height * 0.6)
    width = max(draw.textlength(text, font) for text, _ in rows) + height + 3 * margin
    draw.rectangle((0, 0, width, line * len(rows) + margin), fill=BEHIND)
    for i, (text, color) in enumerate(rows):
        top = margin + i * line
        fill = tuple(round(255 * c) for c in color)
        draw.rectangle((margin, top, margin + height, top + height), fill=fill)
        draw.text((height + 2 * margin, top), text, fill=TEXT, font=font)
    return np.asarray(image, np.float32) / 255
