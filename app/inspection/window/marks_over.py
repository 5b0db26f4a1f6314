"""Marks over the picture, what lies under the mouse, and alarms: with names and values."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.scale_bar import in_unit
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.inspection.pictures import ALARM_SHARE, ALARMS, outline_of
from shapeshift.scene.inspection.marks import Isotherm, Mark, MarkReading
from shapeshift.scene.inspection.value_picture import ValuePicture, value_text
from shapeshift.scene.pose import View

Vec = imgui.ImVec2
CROSS = 10.0  # logical pixels, of a spot
HIDDEN = 0.35  # of the ink of a mark that this view does not see
NOWHERE = np.zeros((0, 0))


def words_of(value: float, picture: ValuePicture, wanted: str) -> str:
    """A value in the unit of temperature that is wanted; "--" where it is not known."""
    unit, low, high = in_unit(picture.unit, *picture.value_range, wanted)
    ends = None if picture.may_exceed else (low, high)
    shown = in_unit(picture.unit, value, value, wanted)[1]
    return value_text(shown, unit, ends, picture.digits)


def draw_mark(
    mark: Mark, reading: MarkReading | None, view: View, words: str, chosen: bool, ui_scale: float
) -> None:
    """Its outline with its name and value; view: of the window, its size in logical pixels.

    reading: None where the view has moved since it was measured.
    """
    through = ValuePicture(view, NOWHERE, NOWHERE)
    if not np.isfinite(through.pixel_of(mark.points)[0]).all():
        return  # behind the eye, in whole or in part
    seen = reading is None or reading.samples > 0
    ink = theme.color(theme.ACCENT if chosen else theme.TEXT, 1.0 if seen else HIDDEN)
    ground = theme.color(theme.SURFACE, 0.7 if seen else HIDDEN)
    draw = imgui.get_background_draw_list()
    lines = outline_of(MarkReading(mark), through, int(CROSS * ui_scale))
    for color, width in ((ground, 4.0), (ink, 1.6)):
        for line in lines:
            draw.add_polyline([Vec(*p) for p in line.tolist()], color, width * ui_scale, 0)
    if not seen:
        return
    corner = np.concatenate(lines).max(axis=0) + 3 * ui_scale
    draw_words(f"{mark.name} {words}".rstrip(), (corner[0], corner[1]), ui_scale, ink)


def draw_words(
    text: str, at: tuple[float, float], ui_scale: float, ink: int | None = None, right: bool = False
) -> None:
    """Words on a dark ground; `at` is their upper left corner, or upper right one if `right`."""
    size, pad = imgui.calc_text_size(text), 4 * ui_scale
    left, top = at[0] - (size.x + 2 * pad if right else 0.0), at[1]
    draw = imgui.get_background_draw_list()
    low = Vec(left + size.x + 2 * pad, top + size.y + pad)
    draw.add_rect_filled(Vec(left, top), low, theme.color(theme.SURFACE, 0.8), pad)
    draw.add_text(Vec(left + pad, top + pad / 2), ink or theme.color(theme.TEXT), text)


def draw_rubber(kind: str, start: tuple[float, float], end: tuple[float, float]) -> None:
    """What a drag would lay: a line, a circle or a box."""
    draw, ink = imgui.get_background_draw_list(), theme.color(theme.ACCENT)
    if kind == "line":
        draw.add_line(Vec(*start), Vec(*end), ink, 2.0)
    elif kind == "circle":
        radius = float(np.hypot(end[0] - start[0], end[1] - start[1]))
        draw.add_circle(Vec(*start), radius, ink, 0, 2.0)
    else:
        draw.add_rect(Vec(*start), Vec(*end), ink, 0, 2.0)


def alarm_layer(picture: ValuePicture, isotherms: tuple[Isotherm, ...]) -> np.ndarray:
    """(H, W, 4) uint8: the areas of isotherms in their colours, clear elsewhere."""
    out = np.zeros((*picture.values.shape, 4), np.uint8)
    for each in isotherms:
        inside = each.holds(picture.values) & picture.known
        out[inside] = [round(255 * part) for part in (*ALARMS[each.kind], ALARM_SHARE)]
    return out
