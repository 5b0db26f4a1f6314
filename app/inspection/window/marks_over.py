"""Marks over the picture, what lies under the mouse, and alarms: with names and values."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.scale_bar import in_unit
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.texts.table import said
from shapeshift.app.inspection.pictures import ALARM_SHARE, ALARMS, label_places, outline_of
from shapeshift.scene.inspection.marks import HIDDEN, Isotherm, Mark, MarkReading
from shapeshift.scene.inspection.value_picture import ValuePicture, value_text
from shapeshift.scene.pose import View

Vec = imgui.ImVec2
CROSS = 10.0  # logical pixels, of a spot
FAINT = 0.35  # of the ink of a mark that this view does not see
ASIDE = 0.6  # of the ink of what is no mark's value
MOST_LABELS = 100
WHY_HIDDEN = HIDDEN
NOWHERE = np.zeros((0, 0))


def words_of(
    value: float, picture: ValuePicture, wanted: str, ends: tuple[float, float] | None = None
) -> str:
    """A value in the unit of temperature that is wanted; "--" where it is not known.  ends: of what
    photos showed, on this surface.
    """
    unit, low, high = in_unit(picture.unit, *(ends or (-np.inf, np.inf)), wanted)
    shown = in_unit(picture.unit, value, value, wanted)[1]
    return value_text(shown, unit, None if picture.may_exceed else (low, high), picture.digits)


@dataclass(frozen=True)
class MarkLabel:
    """What stands beside a mark."""

    words: str  # name and value
    aside: str  # in grey: what this view reads instead, or why it reads nothing
    corner: np.ndarray  # (2,) logical pixels, of its left upper end if there is room
    ink: int

    @property
    def size(self) -> tuple[float, float]:
        """Of its plate, logical pixels."""
        return plate_size(f"{self.words} {self.aside}".rstrip())


def plate_size(words: str) -> tuple[float, float]:
    """Of the plate of words, logical pixels."""
    text, pad = imgui.calc_text_size(words), plate_pad()
    return text.x + 2 * pad, text.y + pad


def plate_pad() -> float:
    """Around words on a plate, logical pixels."""
    return 0.25 * imgui.get_text_line_height()


def label_words(
    mark: Mark, reading: MarkReading | None, picture: ValuePicture | None, wanted: str,
    is_current: bool = True,
) -> tuple[str, str]:  # fmt: skip
    """Name and value, and what stands in grey beside them.  wanted: a unit of temperature;
    is_current: the reading is of what is seen now.
    """
    if reading is None or picture is None:
        return mark.name, ""
    value = words_of(reading.value, picture, wanted, reading.ends)
    if not is_current:
        return f"{mark.name} {value}", ""
    if reading.hidden:
        known = np.isfinite(reading.value)
        return f"{mark.name} {value}" if known else mark.name, said(reading.hidden)
    now = words_of(reading.value_now, picture, wanted, reading.now.ends)
    return f"{mark.name} {value}", "" if now == value or mark.laid is None else now


def draw_mark(
    mark: Mark, reading: MarkReading | None, view: View, words: tuple[str, str], chosen: bool,
    ui_scale: float,
) -> MarkLabel | None:  # fmt: skip
    """Its outline; what is to stand beside it.  view: of the window, its size in logical pixels.

    reading: None where nothing was measured yet.  None: it is behind the eye or beside the view.
    """
    through = ValuePicture(view, NOWHERE, NOWHERE)
    pixels = through.pixel_of(mark.points)[0]
    if not np.isfinite(pixels).all():
        return None
    seen = reading is None or not reading.hidden
    ink = theme.color(theme.ACCENT if chosen else theme.TEXT, 1.0 if seen else FAINT)
    ground = theme.color(theme.SURFACE, 0.7 if seen else FAINT)
    draw = imgui.get_background_draw_list()
    lines = outline_of(MarkReading(mark), through, int(CROSS * ui_scale))
    for color, width in ((ground, 4.0), (ink, 1.6)):
        for line in lines:
            draw.add_polyline([Vec(*p) for p in line.tolist()], color, width * ui_scale, 0)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    if (high < 0).any() or (low > view.size).any():
        return None
    corner = np.concatenate(lines).max(axis=0) + 3 * ui_scale
    return MarkLabel(*words, corner, theme.color(theme.ACCENT if chosen else theme.TEXT))


def draw_labels(labels: Sequence[MarkLabel], room: tuple[int, int]) -> None:
    """On plates that do not overlap; room: of the window, logical pixels."""
    labels = labels[:MOST_LABELS]
    places = label_places([each.corner for each in labels], [each.size for each in labels], room)
    for label, place in zip(labels, places, strict=True):
        if place is not None:
            draw_words(label.words, place, label.ink, label.aside)


def draw_words(text: str, at: tuple[float, float], ink: int | None = None, aside: str = "") -> None:
    """Words on a plate; `at` is its upper left corner; aside: in grey behind them."""
    whole, pad = f"{text} {aside}".rstrip(), plate_pad()
    size, first = imgui.calc_text_size(whole), imgui.calc_text_size(f"{text} ")
    draw = imgui.get_background_draw_list()
    low = Vec(at[0] + size.x + 2 * pad, at[1] + size.y + pad)
    draw.add_rect_filled(Vec(*at), low, theme.color(theme.SURFACE, 0.85), pad)
    draw.add_text(Vec(at[0] + pad, at[1] + pad / 2), ink or theme.color(theme.TEXT), text)
    if aside:
        there = Vec(at[0] + pad + first.x, at[1] + pad / 2)
        draw.add_text(there, theme.color(theme.TEXT, ASIDE), aside)


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
