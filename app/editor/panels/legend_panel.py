"""The legend of a debug view, beside the panel: what its colours mean, with their counts."""

from collections.abc import Sequence

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.texts.table import said

Vec = imgui.ImVec2
Row = tuple[str, tuple[float, float, float]]  # text, display sRGB


def draw_legend(rows: Sequence[Row], free: Box, ui_scale: float) -> None:
    """Draws rows of swatch and text in the upper left corner of what is free.

    No more rows than leave the middle of the scene to be seen.
    """
    left, top, right, bottom = free
    rows = [(_in_language(text), rgb) for text, rgb in rows]
    step = imgui.get_text_line_height() + 4 * ui_scale
    high, wide = 0.45 * (bottom - top) - 36 * ui_scale, 0.45 * (right - left)
    narrow = max((imgui.calc_text_size(text).x for text, _ in rows), default=0.0) < wide
    rows = rows if narrow else rows[: max(int(high / step), 1)]
    if not rows:
        return
    line, pad, margin = imgui.get_text_line_height(), 10 * ui_scale, 16 * ui_scale
    width = max(imgui.calc_text_size(text).x for text, _ in rows) + line + 3 * pad
    left += margin if left <= 0 else margin / 2
    draw = imgui.get_background_draw_list()
    draw.add_rect_filled(
        Vec(left, margin),
        Vec(left + width, margin + 2 * pad + step * len(rows) - 4 * ui_scale),
        theme.color(theme.SURFACE, 0.85),
        8 * ui_scale,
    )
    for number, (text, rgb) in enumerate(rows):
        y = margin + pad + number * step
        x = left + pad
        draw.add_rect_filled(
            Vec(x, y + 0.1 * line), Vec(x + 0.8 * line, y + 0.9 * line), theme.color(rgb), 2.0
        )
        draw.add_text(Vec(x + line + pad, y), theme.color(theme.TEXT), text)


def _in_language(text: str) -> str:
    """Of a row "words: number" the words."""
    words, colon, number = text.partition(": ")
    return said(words) + colon + number
