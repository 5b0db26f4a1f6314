"""The scale of thermal stops in the scene view: palette, values, unit; it fades in with them."""

import numpy as np
from imgui_bundle import imgui

from app.panels import theme
from renderer.palette import legend_opacity, palette_colors, thermal_blend
from renderer.ticks import nice_ticks, tick_text
from scene.scene import Scene

Vec = imgui.ImVec2
BAR = (16.0, 300.0)  # logical pixels, width and height
STRIPES = 128


def draw_scale_bar(scene: Scene, ui_scale: float) -> None:
    """Draws the bar at the right edge; it fades in with the thermal stop."""
    palette, weight, stop = thermal_blend(scene)
    weight = legend_opacity(weight)
    if not palette or stop is None or stop.value_range is None or not weight > 0.01:
        return
    screen = imgui.get_io().display_size
    width, height = BAR[0] * ui_scale, min(BAR[1] * ui_scale, screen.y * 0.5)
    right, top = screen.x - 84 * ui_scale, (screen.y - height) / 2 - 20 * ui_scale
    draw = imgui.get_background_draw_list()
    line = imgui.get_text_line_height()
    pad = 12 * ui_scale
    draw.add_rect_filled(
        Vec(right - width - pad, top - line - 1.6 * pad),
        Vec(screen.x - 16 * ui_scale, top + height + 1.2 * pad),
        theme.color(theme.SURFACE, 0.80 * weight),
        8 * ui_scale,
    )
    _stripes(palette, weight, Vec(right - width, top), Vec(right, top + height))
    title = f"{stop.name} {stop.unit}".strip()
    title_left = min(right - width, screen.x - 26 * ui_scale - imgui.calc_text_size(title).x)
    draw.add_text(
        Vec(title_left, top - line - 0.7 * pad), theme.color(theme.TEXT, weight), stop.unit or title
    )
    low, high = stop.value_range
    values = nice_ticks(low, high)
    for value, text in zip(values, tick_text(values), strict=True):
        y = top + height * (1 - (value - low) / (high - low if high > low else 1.0))
        ink = theme.color(theme.TEXT, weight)
        draw.add_line(Vec(right, y), Vec(right + 5 * ui_scale, y), ink, max(1.0, ui_scale))
        draw.add_text(Vec(right + 10 * ui_scale, y - line / 2), ink, text)


def _stripes(palette: str, weight: float, low: Vec, high: Vec) -> None:
    """The palette from cold (bottom) to hot (top) as a smooth gradient."""
    draw = imgui.get_background_draw_list()
    steps = np.linspace(255, 0, STRIPES + 1).astype(int)
    inks = [theme.color(tuple(map(float, c)), weight) for c in palette_colors(palette)[steps]]
    edges = np.linspace(low.y, high.y, STRIPES + 1)
    for i in range(STRIPES):
        draw.add_rect_filled_multi_color(
            Vec(low.x, edges[i]),
            Vec(high.x, edges[i + 1]),
            inks[i],
            inks[i],
            inks[i + 1],
            inks[i + 1],
        )
