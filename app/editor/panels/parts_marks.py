"""What a drag of the tool "Parts" draws over the picture: a box, a lasso, the edge of a sphere."""

from collections.abc import Sequence

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.parts.selecting import LASSO, SPHERE

Vec = imgui.ImVec2
Place = tuple[float, float]  # logical pixels


def draw_drag(
    drag: str, start: Place, way: Sequence[Place], removes: bool, ui_scale: float
) -> None:
    """From where the button went down, along the way that the mouse has gone since."""
    draw = imgui.get_background_draw_list()
    ink, wide = theme.color(theme.TEXT if removes else theme.ACCENT, 0.9), 1.5 * ui_scale
    if drag == LASSO:
        points = [Vec(*start), *(Vec(x, y) for x, y in way)]
        draw.add_polyline(points, ink, wide, imgui.ImDrawFlags_.closed)
    elif drag == SPHERE:
        radius = float(np.hypot(way[-1][0] - start[0], way[-1][1] - start[1]))
        draw.add_circle(Vec(*start), radius, ink, 0, wide)
        draw.add_circle_filled(Vec(*start), 2.5 * ui_scale, ink)
    else:
        corners = np.array([start, way[-1]])
        low, high = corners.min(axis=0), corners.max(axis=0)
        draw.add_rect(Vec(*low), Vec(*high), ink, 0.0, wide)
