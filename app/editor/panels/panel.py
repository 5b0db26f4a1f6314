"""The panel at the left: its frame, its title, its sections in their order, its foot."""

from collections.abc import Callable
from dataclasses import dataclass

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import item_label, section, tip
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.state.layout import Layout
from shapeshift.app.editor.texts.table import said

Vec = imgui.ImVec2
# What somebody who is here for the first time needs comes first; what is not named, last.
ORDER = (
    "Scale", "Room", "Touch", "Stops", "Look", "Inspect", "Measure", "Gallery", "Scenes",
    "Comfort", "Camera", "Film", "Objects", "Parts", "Regions", "Sections", "Export", "Settings",
    "Performance",
)  # fmt: skip


LARGER = "Larger text: Ctrl +, Ctrl 0 as at first."
SMALLER = "Smaller text: Ctrl \u2013, Ctrl 0 as at first."


@dataclass(frozen=True)
class Section:
    """A heading of the panel that folds, with what lies under it."""

    name: str
    draw: Callable[[float], None]  # called with ui_scale between imgui.begin and end
    open_first: bool = False
    opens: Callable[[], bool] | None = None  # True: unfold it now
    shown: Callable[[], bool] | None = None  # False: leave it out, there is nothing in it
    early: Callable[[], bool] | None = None  # True: after Touch now, whatever its name


@dataclass(frozen=True)
class PanelActions:
    """What the panel's own buttons do."""

    fold: Callable[[bool], None]  # whether the panel is to be folded
    resize_text: Callable[[int], None]  # 1 larger, -1 smaller
    show_keys: Callable[[], None]
    sections: dict[str, bool]  # that a hand has opened or folded, by name
    keep: Callable[[], None]  # they have changed


def draw_panel(
    title: str,
    sections: list[Section],
    top: list[Callable[[float], None]],
    actions: PanelActions,
    layout: Layout,
    ui_scale: float,
) -> Box:
    """The panel, or the button that stands for it.  Returns where it is.

    `top` is drawn under the title, before the sections.
    """
    if layout.panel is None:
        return (0.0, 0.0, 0.0, 0.0)
    left, up, right, low = layout.panel
    imgui.set_next_window_pos(Vec(left, up))
    flags = imgui.WindowFlags_
    plain = flags.no_title_bar | flags.no_resize | flags.no_move | flags.no_saved_settings
    if layout.folded:
        return _folded(actions, right - left, plain, ui_scale)
    width = right - left
    imgui.set_next_window_size_constraints(Vec(width, 0), Vec(width, max(low - up, 1.0)))
    imgui.begin("##panel", None, plain | flags.always_auto_resize)
    _title(title, actions, ui_scale)
    for draw in top:
        draw(ui_scale)
    if _scrolling(sections, low, actions.sections, ui_scale):
        actions.keep()
    _foot(actions, ui_scale)
    box = theme.window_box()
    imgui.end()
    return box


def _scrolling(sections: list[Section], low: float, kept: dict[str, bool], ui_scale: float) -> bool:
    """The sections, which scroll where they reach below `low`: the foot stays in sight.

    True: one was opened or folded.
    """
    style = imgui.get_style()
    foot = imgui.get_frame_height() + 2 * style.item_spacing.y + 2 + style.window_padding.y
    room = low - imgui.get_cursor_screen_pos().y - foot
    imgui.set_next_window_size_constraints(Vec(0, 0), Vec(float("inf"), max(room, 1.0)))
    imgui.begin_child("##sections", Vec(0, 0), imgui.ChildFlags_.auto_resize_y)
    toggled = draw_sections(sections, ui_scale, kept)
    imgui.end_child()
    return toggled


def draw_sections(
    sections: list[Section], ui_scale: float, kept: dict[str, bool] | None = None
) -> bool:
    """Headings that fold, in their order, in the window that is being made.

    kept: those that were opened (True) or folded by hand before; what a hand does now is put there,
    and the result tells whether it did.
    """
    kept, toggled = kept if kept is not None else {}, False
    for other in sorted(sections, key=_rank):
        if other.shown is not None and not other.shown():
            continue
        unfold = other.opens is not None and other.opens()
        is_open = section(other.name, kept.get(other.name, other.open_first), unfold)
        if imgui.is_item_toggled_open():
            kept[other.name], toggled = is_open, True
        if is_open:
            imgui.push_id(other.name)
            imgui.push_text_wrap_pos(0)  # a sentence in any language goes on in the next line
            other.draw(ui_scale)
            imgui.pop_text_wrap_pos()
            imgui.pop_id()
    return toggled


def _rank(other: Section) -> float:
    """Its place in the panel, smallest first."""
    if other.early is not None and other.early():
        return ORDER.index("Touch") + 0.5
    return ORDER.index(other.name) if other.name in ORDER else len(ORDER)


def _title(title: str, actions: PanelActions, ui_scale: float) -> None:
    """The program's name, what is open, and the button that folds all this."""
    side = imgui.get_frame_height()
    start, room = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), "Shapeshift")
    imgui.same_line()
    imgui.push_text_wrap_pos(start.x + room - side - 4 * ui_scale)
    imgui.text_unformatted(title or said("nothing is open"))
    imgui.pop_text_wrap_pos()
    below = imgui.get_cursor_pos()
    imgui.set_cursor_pos(Vec(start.x + room - side, start.y - 2 * ui_scale))
    if _arrow("fold", side, -1):
        actions.fold(True)
    tip("Fold the panel; H hides all there is.", ui_scale)
    imgui.set_cursor_pos(below)


def _folded(actions: PanelActions, side: float, plain: int, ui_scale: float) -> Box:
    """A small square with an arrow."""
    imgui.set_next_window_size(Vec(side, side))
    imgui.push_style_var(imgui.StyleVar_.window_padding, Vec(4 * ui_scale, 4 * ui_scale))
    imgui.begin("##folded", None, plain | imgui.WindowFlags_.no_scrollbar)
    if _arrow("unfold", side - 8 * ui_scale, 1):
        actions.fold(False)
    tip("Open the panel: files, stops, look, camera.", ui_scale)
    box = theme.window_box()
    imgui.end()
    imgui.pop_style_var()
    return box


def _arrow(name: str, side: float, direction: int) -> bool:
    """A square with three lines to open (1), or an angle to fold (-1)."""
    corner = imgui.get_cursor_screen_pos()
    clicked = imgui.invisible_button(name, Vec(side, side))
    draw, middle = imgui.get_window_draw_list(), Vec(corner.x + side / 2, corner.y + side / 2)
    ink = theme.color(theme.ACCENT if imgui.is_item_hovered() else theme.MUTED)
    wide, reach = max(1.5, side / 14), side * 0.2
    if direction > 0:
        for y in (-reach, 0.0, reach):
            left, right = middle.x - 1.3 * reach, middle.x + 1.3 * reach
            draw.add_line(Vec(left, middle.y + y), Vec(right, middle.y + y), ink, wide)
    else:
        tip_x, end_x = middle.x - reach / 2, middle.x + reach / 2
        for y in (-reach, reach):
            draw.add_line(Vec(tip_x, middle.y), Vec(end_x, middle.y + y), ink, wide)
    return clicked


def _foot(actions: PanelActions, ui_scale: float) -> None:
    """The sheet of keys, and the size of the text."""
    imgui.dummy(Vec(0, 2))
    gap, small = imgui.get_style().item_spacing.x, 34 * ui_scale
    room = imgui.get_content_region_avail().x
    if imgui.button(item_label("Keys (F1)"), Vec(room - 2 * (small + gap), 0)):
        actions.show_keys()
    tip("All keys and what the mouse does.", ui_scale)
    for label, step in (("A\u2013", -1), ("A+", 1)):
        imgui.same_line()
        if imgui.button(label, Vec(small, 0)):
            actions.resize_text(step)
        tip(LARGER if step > 0 else SMALLER, ui_scale)
