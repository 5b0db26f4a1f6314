"""The scale of value stops in the scene view: palette, values, unit; it fades in with them."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.renderer.colors.palette import (
    ALL_VALUES,
    legend_opacity,
    palette_between,
    value_blend,
)
from shapeshift.renderer.debug.debug_map import nice_ticks, tick_text
from shapeshift.scene.scene import Scene

Vec = imgui.ImVec2
WIDTH = 16.0  # logical pixels, of the colours
PAD = 12.0
STRIPES = 128
HANDLE = 7.0  # half the height of a handle, and how far it reaches beyond the colours
GRASP = 9.0  # so near to a handle it is meant
# unit of temperature: kelvins a degree, and the kelvins of its zero
KELVIN = {"\u00b0C": (1.0, 273.15), "\u00b0F": (5 / 9, 459.67 * 5 / 9), "K": (1.0, 0.0)}


def draw_scale_bar(
    scene: Scene,
    box: Box,
    ui_scale: float,
    draw: imgui.ImDrawList | None = None,
    wanted: str = "",
    ends: tuple[float, float] | None = None,
) -> None:
    """Draws the bar with its ticks into a box, over the picture or into a list that is given; it
    fades in with the value stop.  wanted: a unit of temperature instead of the stop's own.  ends:
    shares of the range that the palette's ends stand for, each with a handle; None: all, and none.
    """
    palette, weight, stop = value_blend(scene)
    weight = legend_opacity(weight)
    if not palette or stop is None or stop.value_range is None or not weight > 0.01:
        return
    left, top, right, bottom = box
    pad, line = PAD * ui_scale, imgui.get_text_line_height()
    draw = draw or imgui.get_background_draw_list()
    ground = theme.color(theme.SURFACE, 0.80 * weight)
    draw.add_rect_filled(Vec(left, top), Vec(right, bottom), ground, 8 * ui_scale)
    ink = theme.color(theme.TEXT, weight)
    draw.push_clip_rect(Vec(left, top), Vec(right, bottom))
    unit, low, high = in_unit(stop.unit, *stop.value_range, wanted)
    draw.add_text(Vec(left + pad, top + pad / 2), ink, unit or stop.name)
    start, first, bar, last = colors_box(box, ui_scale)
    colors = palette_between(palette, ends or ALL_VALUES)
    _stripes(draw, colors, weight, Vec(start, first), Vec(bar, last))
    for share in ends or ():
        y, reach = height_of(share, box, ui_scale), HANDLE * ui_scale
        corners = Vec(start - reach, y - reach), Vec(start - reach, y + reach), Vec(start + 2, y)
        draw.add_triangle_filled(*corners, theme.color(theme.ACCENT, weight))
        draw.add_line(Vec(start, y), Vec(bar, y), theme.color(theme.ACCENT, weight), 2 * ui_scale)
    values, above = nice_ticks(low, high), bottom + line  # where the text below the next one is
    for value, text in zip(values, tick_text(values), strict=True):
        y = last - (last - first) * (value - low) / (high - low if high > low else 1.0)
        draw.add_line(Vec(bar, y), Vec(bar + 5 * ui_scale, y), ink, max(1.0, ui_scale))
        if above - y >= 0.95 * line:  # a low bar has not room for all of them
            draw.add_text(Vec(bar + 10 * ui_scale, y - line / 2), ink, text)
            above = y
    draw.pop_clip_rect()


def colors_box(box: Box, ui_scale: float) -> Box:
    """Where the colours of a bar are that is drawn into a box."""
    left, top, _, bottom = box
    pad, line = PAD * ui_scale, imgui.get_text_line_height()
    return left + pad, top + line + 1.2 * pad, left + pad + WIDTH * ui_scale, bottom - pad


def height_of(share: float, box: Box, ui_scale: float) -> float:
    """Where on the screen a share of the range is; beyond the range at its end."""
    _, first, _, last = colors_box(box, ui_scale)
    return last - (last - first) * min(max(share, 0.0), 1.0)


def share_at(y: float, box: Box, ui_scale: float) -> float:
    """The share of the range that is there."""
    _, first, _, last = colors_box(box, ui_scale)
    return min(max((last - y) / max(last - first, 1e-6), 0.0), 1.0)


def handle_at(
    x: float, y: float, box: Box, ends: tuple[float, float], ui_scale: float
) -> int | None:
    """Which of the two handles lies there: 0 is the lower one; None: neither."""
    start, _, bar, _ = colors_box(box, ui_scale)
    reach = GRASP * ui_scale
    away = [abs(y - height_of(share, box, ui_scale)) for share in ends]
    near = int(away[1] <= away[0])
    return near if start - reach - 2 <= x <= bar + reach and away[near] <= reach else None


def in_unit(unit: str, low: float, high: float, wanted: str) -> tuple[str, float, float]:
    """A range of temperatures in the unit that is wanted; as it is where it is none."""
    if unit not in KELVIN or wanted not in KELVIN:
        return unit, low, high
    (size, zero), (other, other_zero) = KELVIN[unit], KELVIN[wanted]
    low, high = ((value * size + zero - other_zero) / other for value in (low, high))
    return wanted, low, high


def has_scale(scene: Scene) -> bool:
    """Whether there is something of it to be seen."""
    palette, weight, stop = value_blend(scene)
    known = bool(palette) and stop is not None and stop.value_range is not None
    return known and legend_opacity(weight) > 0.01


def _stripes(
    draw: imgui.ImDrawList, colors: np.ndarray, weight: float, low: imgui.ImVec2, high: imgui.ImVec2
) -> None:
    """The colours (256, 3) of a palette from cold (bottom) to hot (top) as a smooth gradient."""
    steps = np.linspace(255, 0, STRIPES + 1).astype(int)
    inks = [theme.color((red, green, blue), weight) for red, green, blue in colors[steps].tolist()]
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
