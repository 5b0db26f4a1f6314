"""Measured lengths, angles and areas over the picture, each with its value."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.marks_over import NOWHERE, draw_words
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

Vec = imgui.ImVec2
DOT = 4.0  # logical pixels


def draw_length(
    kind: str, points: np.ndarray, view: View, words: str, chosen: bool, ui_scale: float
) -> None:
    """points (n, 3) metres in the world; view: of the window, its size in logical pixels."""
    pixels, _ = ValuePicture(view, NOWHERE, NOWHERE).pixel_of(points)
    if not np.isfinite(pixels).all():
        return  # behind the eye, in whole or in part
    ink = theme.color(theme.ACCENT if chosen else theme.TEXT)
    ground = theme.color(theme.SURFACE, 0.7)
    draw = imgui.get_background_draw_list()
    corners = [Vec(*place) for place in pixels.tolist()]
    closed = kind == "area" and len(corners) > 2
    if closed:
        draw.add_concave_poly_filled(corners, theme.color(theme.ACCENT, 0.15))
    for color, width in ((ground, 4.0), (ink, 1.6)):
        flags = imgui.ImDrawFlags_.closed if closed else 0
        draw.add_polyline(corners, color, width * ui_scale, flags)
    for corner in corners:
        draw.add_circle_filled(corner, (DOT + 1.5) * ui_scale, ground)
        draw.add_circle_filled(corner, DOT * ui_scale, ink)
    if words:
        x, y = label_place(kind, pixels)
        draw_words(words, (x + 8 * ui_scale, y + 4 * ui_scale), ui_scale, ink)


def label_place(kind: str, pixels: np.ndarray) -> tuple[float, float]:
    """Where its words go, of points (n, 2) pixels: at an angle's vertex, else in the middle."""
    if kind == "angle" and len(pixels) == 3:
        x, y = pixels[1]
    elif kind == "polyline":
        x, y = pixels[-1]
    else:
        x, y = pixels.mean(axis=0)
    return float(x), float(y)
