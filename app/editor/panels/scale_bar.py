"""The scale of thermal stops in the scene view: palette, values, unit; it fades in with them."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.renderer.colors.palette import legend_opacity, palette_colors, thermal_blend
from shapeshift.renderer.debug.ticks import nice_ticks, tick_text
from shapeshift.scene.scene import Scene

Vec = imgui.ImVec2
WIDTH = 16.0  # logical pixels, of the colours
PAD = 12.0
STRIPES = 128
# unit of temperature: kelvins a degree, and the kelvins of its zero
KELVIN = {"\u00b0C": (1.0, 273.15), "\u00b0F": (5 / 9, 459.67 * 5 / 9), "K": (1.0, 0.0)}


def draw_scale_bar(
    scene: Scene,
    box: Box,
    ui_scale: float,
    draw: imgui.ImDrawList | None = None,
    wanted: str = "",
) -> None:
    """Draws the bar with its ticks into a box, over the picture or into a list that is given; it
    fades in with the thermal stop.  wanted: a unit of temperature instead of the stop's own.
    """
    palette, weight, stop = thermal_blend(scene)
    weight = legend_opacity(weight)
    if not palette or stop is None or stop.value_range is None or not weight > 0.01:
        return
    left, top, right, bottom = box
    width, pad, line = WIDTH * ui_scale, PAD * ui_scale, imgui.get_text_line_height()
    draw = draw or imgui.get_background_draw_list()
    ground = theme.color(theme.SURFACE, 0.80 * weight)
    draw.add_rect_filled(Vec(left, top), Vec(right, bottom), ground, 8 * ui_scale)
    ink = theme.color(theme.TEXT, weight)
    draw.push_clip_rect(Vec(left, top), Vec(right, bottom))
    unit, low, high = in_unit(stop.unit, *stop.value_range, wanted)
    draw.add_text(Vec(left + pad, top + pad / 2), ink, unit or stop.name)
    first, last = top + line + 1.2 * pad, bottom - pad  # of the colours, top and bottom
    bar = left + pad + width
    _stripes(draw, palette, weight, Vec(left + pad, first), Vec(bar, last))
    values = nice_ticks(low, high)
    for value, text in zip(values, tick_text(values), strict=True):
        y = last - (last - first) * (value - low) / (high - low if high > low else 1.0)
        draw.add_line(Vec(bar, y), Vec(bar + 5 * ui_scale, y), ink, max(1.0, ui_scale))
        draw.add_text(Vec(bar + 10 * ui_scale, y - line / 2), ink, text)
    draw.pop_clip_rect()


def in_unit(unit: str, low: float, high: float, wanted: str) -> tuple[str, float, float]:
    """A range of temperatures in the unit that is wanted; as it is where it is none."""
    if unit not in KELVIN or wanted not in KELVIN:
        return unit, low, high
    (size, zero), (other, other_zero) = KELVIN[unit], KELVIN[wanted]
    low, high = ((value * size + zero - other_zero) / other for value in (low, high))
    return wanted, low, high


def has_scale(scene: Scene) -> bool:
    """Whether there is something of it to be seen."""
    palette, weight, stop = thermal_blend(scene)
    known = bool(palette) and stop is not None and stop.value_range is not None
    return known and legend_opacity(weight) > 0.01


def _stripes(
    draw: imgui.ImDrawList, palette: str, weight: float, low: imgui.ImVec2, high: imgui.ImVec2
) -> None:
    """The palette from cold (bottom) to hot (top) as a smooth gradient."""
    steps = np.linspace(255, 0, STRIPES + 1).astype(int)
    colors = palette_colors(palette)[steps].tolist()  # (STRIPES + 1, 3)
    inks = [theme.color((red, green, blue), weight) for red, green, blue in colors]
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
