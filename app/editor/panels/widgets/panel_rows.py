"""What sections of the panel are made of: headings that fold, rows, sliders with an open end."""

from collections.abc import Iterable, Mapping
from typing import TypeVar

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.texts.table import said

Vec = imgui.ImVec2
T = TypeVar("T")
TIP_WIDTH = 300.0  # logical pixels; longer explanations wrap
ROWS_SHOWN = 16  # of an open list; more are reached by scrolling


def item_label(name: str) -> str:
    """What stands on an item in the language in use; which item it is does not depend on that, and
    is said by what follows "###" where one item has several texts.
    """
    text, _, item = name.partition("###")
    shown = said(text)
    return name if shown == text else f"{shown}###{item or name}"


def section(name: str, open_first: bool = False, unfold: bool = False) -> bool:
    """A heading that folds; returns whether it is open, as it is after `unfold`."""
    imgui.dummy(Vec(0, 1))
    if unfold:
        imgui.set_next_item_open(True)
    flags = imgui.TreeNodeFlags_.no_tree_push_on_open | imgui.TreeNodeFlags_.span_avail_width
    if open_first:
        flags |= imgui.TreeNodeFlags_.default_open
    imgui.push_style_var(imgui.StyleVar_.frame_padding, Vec(0, imgui.get_style().frame_padding.y))
    is_open = imgui.tree_node_ex(item_label(name), flags)
    imgui.pop_style_var()
    return is_open


def subsection(name: str, lit: bool, muted: bool = True) -> bool:
    """A heading within a section, in the accent's colour when `lit`, else `muted` or plain."""
    ink = theme.ACCENT if lit else theme.MUTED if muted else theme.TEXT
    flags = imgui.TreeNodeFlags_.no_tree_push_on_open | imgui.TreeNodeFlags_.span_avail_width
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*ink, 1))
    imgui.push_style_var(imgui.StyleVar_.frame_padding, Vec(0, 1))
    is_open = imgui.tree_node_ex(item_label(name), flags)
    imgui.pop_style_var()
    imgui.pop_style_color()
    return is_open


def rows(pairs: Iterable[tuple[str, str]], share: float = 0.0) -> None:
    """Muted names, values: at the right, or from a `share` of the width on, where they wrap."""
    for name, value in pairs:
        imgui.text_disabled(said(name))
        if share:
            imgui.same_line(imgui.get_window_size().x * share)
            imgui.push_text_wrap_pos(0)
            imgui.text_unformatted(value)
            imgui.pop_text_wrap_pos()
        else:
            imgui.same_line()
            right_aligned(value)


def right_aligned(text: str) -> None:
    room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
    imgui.text_unformatted(text)


class LastTip:
    """What the item says of itself that was under the mouse last."""

    text = ""


def tip(text: str, ui_scale: float) -> None:
    """Explains the item before it when the mouse rests there, also when it is disabled; a ray
    never rests, and has no keys to be named.
    """
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        LastTip.text = said(text)
    rests = imgui.HoveredFlags_.for_tooltip | imgui.HoveredFlags_.allow_when_disabled
    if not (theme.has_keys() and imgui.is_item_hovered(rests)):
        return
    imgui.begin_tooltip()
    imgui.push_text_wrap_pos(TIP_WIDTH * ui_scale)
    imgui.text_unformatted(said(text))
    imgui.pop_text_wrap_pos()
    imgui.end_tooltip()


def centred_text(text: str, middle: imgui.ImVec2, size: float, ink: int) -> None:
    """A line of a size of its own about a place."""
    imgui.push_font(None, size)
    room = imgui.calc_text_size(text)
    at = Vec(middle.x - room.x / 2, middle.y - room.y / 2)
    imgui.get_window_draw_list().add_text(at, ink, text)
    imgui.pop_font()


def symbol_button(name: str, symbol: str, side: float, lit: bool) -> bool:
    """A square with a letter of the font of symbols; True when it was clicked."""
    corner = imgui.get_cursor_screen_pos()
    clicked = imgui.invisible_button(name, Vec(side, side))
    ink = theme.ACCENT if lit or imgui.is_item_hovered() else theme.MUTED
    middle = Vec(corner.x + side / 2, corner.y + side / 2)
    centred_text(symbol, middle, 0.6 * side, theme.color(ink))
    return clicked


def open_slider(
    name: str, value: float, low: float, high: float, text: str, any_text: str
) -> float:
    """A logarithmic slider whose end means no limit: returns inf there.

    `text` shows a limit ("largest splat: %.0f px"), `any_text` that there is none.
    """
    flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp
    shown = min(value, high)
    moved, new = labelled_slider(name, shown, low, high, any_text if shown >= high else text, flags)
    if not moved:
        return value
    return new if new < high else float(np.inf)


def slider(
    name: str, value: float, low: float, high: float, text: str, zero_text: str = ""
) -> float:
    """A plain slider; `zero_text` stands there instead of `text` at its lower end."""
    at_zero = zero_text and value <= low
    moved, new = labelled_slider(name, value, low, high, zero_text if at_zero else text)
    return new if moved else value


def labelled_slider(
    name: str, value: float, low: float, high: float, text: str,
    flags: int = imgui.SliderFlags_.always_clamp,
) -> tuple[bool, float]:  # fmt: skip
    """A line of text, with the value where it has a %, and under it the slider.

    The two are one item for a tip.  No knob lies over its own number.
    """
    imgui.begin_group()
    shown = said(text)
    imgui.text_unformatted(shown % value if "%" in text else shown)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, Vec(imgui.get_style().frame_padding.x, 0))
    imgui.push_style_var(imgui.StyleVar_.frame_rounding, imgui.get_text_line_height() / 2)
    imgui.push_style_var(imgui.StyleVar_.grab_rounding, imgui.get_text_line_height() / 2)
    width = imgui.calc_item_width()
    imgui.set_next_item_width(width if width > 0 else -1)
    if isinstance(value, int):
        moved, new = imgui.slider_int(f"##{name}", value, int(low), int(high), "", flags)
    else:
        moved, new = imgui.slider_float(f"##{name}", value, low, high, "", flags)
    imgui.pop_style_var(3)
    imgui.end_group()
    return moved, new


def choice(
    name: str, value: T, values: Iterable[T], labels: Iterable[str], names: bool = False
) -> T:
    """A list to choose from; returns the value that is chosen now.

    `names`: the labels are names out of files, which are the same in every language.
    """
    values, labels = list(values), list(labels)
    shown = labels if names else [said(label) for label in labels]
    changed, chosen = imgui.combo(f"##{name}", values.index(value), shown, ROWS_SHOWN)
    return values[chosen] if changed else value


def button_row(tips: Mapping[str, str], ui_scale: float, columns: int) -> str:
    """Buttons of equal width, some to a line; the name of the one that was clicked, or "".

    `tips` says what each name does.
    """
    gap = imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap * (columns - 1)) / columns
    clicked = ""
    for index, (name, what) in enumerate(tips.items()):
        if index % columns:
            imgui.same_line()
        if imgui.button(item_label(name), Vec(width, 0)):
            clicked = name
        tip(what, ui_scale)
    return clicked


def ms_text(value: float) -> str:
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:.0f}"


def db_text(value: float) -> str:
    """Decibels; equal pictures have no number."""
    return said("equal") if value >= 200 else f"{value:.1f} dB"
