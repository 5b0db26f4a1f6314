"""The panel at the left: the bar of tools, a title, the sections of the tool in hand, a foot."""

from collections.abc import Callable
from dataclasses import dataclass

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    centred_text,
    item_label,
    section,
    symbol_button,
    tip,
)
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.state.layout import Layout
from shapeshift.app.editor.texts.table import said

Vec = imgui.ImVec2
# Where there is no bar of tools: what a first visitor needs comes first; what is not named, last.
ORDER = (
    "Scale", "Room", "Touch", "Stops", "Look", "Inspect", "Gallery", "Scenes", "Comfort",
    "Objects", "Parts", "Regions", "Sections", "Performance",
)  # fmt: skip


TOOLS_WIDE, TOOL_TALL, TOOL_LEAST = 48.0, 46.0, 38.0  # lower ones have no name; logical pixels
SYMBOL_PX, NAME_PX = 17.0, 11.0
LANGUAGES = "languages"  # the list under the globe
LARGER = "Larger text: Ctrl +, Ctrl 0 as at first."
SMALLER = "Smaller text: Ctrl \u2013, Ctrl 0 as at first."


@dataclass(frozen=True)
class Section:
    """A heading of the panel that folds, with what lies under it."""

    name: str
    draw: Callable[[float], None]  # called with ui_scale between imgui.begin and end
    open_first: bool = False
    opens: Callable[[], bool] | None = None  # True: unfold it now, with the tool that it begins
    shown: Callable[[], bool] | None = None  # False: leave it out, there is nothing in it
    in_hand: Callable[[], bool] | None = None  # the mouse is this tool's now
    waits: bool = False  # it opens by itself: not in place of a tool that is in hand


@dataclass(frozen=True)
class Tool:
    """A symbol of the bar, and what the panel shows while it is chosen."""

    name: str
    symbol: str  # a letter of theme.SYMBOLS
    what: str  # its tip
    sections: tuple[str, ...]
    keys: tuple[str, ...] = ()  # groups of the sheet of keys that are its own
    missing: str = ""  # said where its first section is left out


TOOLS = (
    Tool("Slide", "\uf1de", "Stops, how all looks, views, regions with an x of their own.",
         ("Stops", "Look", "Views", "Regions"),
         ("Slider", "Two stops at once", "Camera", "Regions")),
    Tool("Inspect", "\uf2c9", "Degrees: marks, isotherms, reports. Key Y.", ("Inspect", "Look"),
         ("Inspect",), "No stop of this scene shows values, such as heat."),
    Tool("Measure", "\uf545", "Lengths, angles and areas. Shift+Y.", ("Measure",), ("Measure",)),
    Tool("Cut", "\uf0c4", "Planes and boxes that cut the scene open. Shift+O.", ("Sections",),
         ("Sections",)),
    Tool("Parts", "\uf12e", "Takes things and junk out of a captured scene. Key O.",
         ("Parts", "Objects"), ("Parts", "Objects")),
    Tool("Touch", "\uf256", "Objects: place, bodies, carrying, throwing. Key T.",
         ("Touch", "Objects"), ("Touch", "Objects"),
         "Nothing here can be moved yet: make something an object (Parts), or add one below."),
    Tool("Style", "\uf1fc", "A picture of each stop, and new shapes for them.",
         ("Gallery", "Look"), (), "There is nothing to be styled."),
    Tool("Film", "\uf008", "Keys of the camera and of the slider, and the film of them.",
         ("Film",)),
    Tool("Share", "\uf1e0", "A web page, files for other programs.",
         ("Web page", "Export", "Cameras")),
)  # fmt: skip
SETUP = Tool("Settings", "\uf013", "Units, speed and quality.",
             ("Settings", "Performance"))  # fmt: skip
GLOBE = "\uf0ac"


@dataclass(frozen=True)
class PanelActions:
    """What the panel's own buttons do."""

    fold: Callable[[bool], None]  # whether the panel is to be folded
    resize_text: Callable[[int], None]  # 1 larger, -1 smaller
    show_keys: Callable[[], None]
    sections: dict[str, bool]  # that a hand has opened or folded, by name
    keep: Callable[[], None]  # they have changed
    tool: Callable[[], str]  # the name of the one that is chosen
    choose: Callable[[str], None]  # another one
    draw_languages: Callable[[float], None]  # under the globe, in a list that is open
    unfold: set[str]  # names of sections that are to be open when they are drawn next


def chosen_tool(name: str) -> Tool:
    """The tool of that name; the first one for a name of another version."""
    return next((tool for tool in (*TOOLS, SETUP) if tool.name == name), TOOLS[0])


def of_tool(tool: Tool, sections: list[Section]) -> list[Section]:
    """What the panel shows of all sections, in the tool's order."""
    found = [other for other in sections if other.name in tool.sections]
    return sorted(found, key=lambda other: tool.sections.index(other.name))


def hear_calls(sections: list[Section], actions: PanelActions) -> None:
    """Chooses the tool whose section asks to be opened, by a key or by what was opened."""
    for other in sections:
        if other.opens is None or not other.opens():
            continue
        actions.unfold.add(other.name)
        tool = chosen_tool(actions.tool())
        busy = any(each.in_hand is not None and each.in_hand() for each in of_tool(tool, sections))
        begun = next((each for each in TOOLS if each.sections[0] == other.name), None)
        if begun is not None and other.name not in tool.sections and not (other.waits and busy):
            actions.choose(begun.name)


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
    hear_calls(sections, actions)
    width, tool = right - left, chosen_tool(actions.tool())
    imgui.set_next_window_size_constraints(Vec(width, 0), Vec(width, max(low - up, 1.0)))
    imgui.begin("##panel", None, plain | flags.always_auto_resize)
    start = imgui.get_cursor_pos()
    _tools(tool, actions, low - up, ui_scale)
    imgui.set_cursor_pos(start)
    beside = TOOLS_WIDE * ui_scale + imgui.get_style().item_spacing.x - start.x
    imgui.indent(beside)
    _title(title, actions, ui_scale)
    for draw in top:
        draw(ui_scale)
    shown = of_tool(tool, sections)
    if _scrolling(tool, shown, low, actions, ui_scale):
        actions.keep()
    _foot(actions, ui_scale)
    imgui.unindent(beside)
    box = theme.window_box()
    imgui.end()
    return box


def _tools(tool: Tool, actions: PanelActions, high: float, ui_scale: float) -> None:
    """The bar at the panel's left edge: a symbol a tool, with its name where there is room."""
    corner, wide = imgui.get_window_pos(), TOOLS_WIDE * ui_scale
    pad = 4 * ui_scale
    room = high - pad - imgui.get_style().window_padding.y
    cell = min(TOOL_TALL * ui_scale, room / len(TOOLS))
    named = cell >= TOOL_LEAST * ui_scale
    draw = imgui.get_window_draw_list()
    right = corner.x + wide
    end = Vec(right, corner.y + imgui.get_window_size().y)
    draw.add_line(Vec(right, corner.y), end, theme.color(theme.TRACK, 0.5))
    for number, each in enumerate(TOOLS):
        y = corner.y + pad + number * cell
        imgui.set_cursor_screen_pos(Vec(corner.x, y))
        if imgui.invisible_button(each.name, Vec(wide, cell)):
            actions.choose(each.name)
            actions.unfold.add(each.sections[0])
        lit, hovered = each is tool, imgui.is_item_hovered()
        tip(each.what, ui_scale)
        if lit or hovered:
            field = Vec(corner.x, y), Vec(right, y + cell)
            draw.add_rect_filled(*field, theme.color(theme.RAISED))
        if lit:
            edge = Vec(corner.x + 2.5 * ui_scale, y + cell)
            draw.add_rect_filled(Vec(corner.x, y), edge, theme.color(theme.ACCENT))
        ink = theme.color(theme.ACCENT if lit else theme.TEXT if hovered else theme.MUTED)
        middle, half = corner.x + wide / 2, y + cell * (0.4 if named else 0.5)
        size = min(SYMBOL_PX * ui_scale, 0.65 * cell)
        centred_text(each.symbol, Vec(middle, half), size, ink)
        if named:
            low_y = y + cell - 0.78 * NAME_PX * ui_scale
            centred_text(said(each.name), Vec(middle, low_y), NAME_PX * ui_scale, ink)


def _scrolling(
    tool: Tool, sections: list[Section], low: float, actions: PanelActions, ui_scale: float
) -> bool:
    """The sections, which scroll where they reach below `low`: the foot stays in sight.

    True: one was opened or folded.
    """
    style = imgui.get_style()
    foot = imgui.get_frame_height() + 2 * style.item_spacing.y + 2 + style.window_padding.y
    room = low - imgui.get_cursor_screen_pos().y - foot
    imgui.set_next_window_size_constraints(Vec(0, 0), Vec(float("inf"), max(room, 1.0)))
    imgui.begin_child(f"##sections {tool.name}", Vec(0, 0), imgui.ChildFlags_.auto_resize_y)
    first = next((each for each in sections if each.name == tool.sections[0]), None)
    if tool.missing and first is not None and first.shown is not None and not first.shown():
        imgui.dummy(Vec(0, 1))
        imgui.push_text_wrap_pos(0)
        imgui.text_disabled(said(tool.missing))
        imgui.pop_text_wrap_pos()
    toggled = draw_sections(sections, ui_scale, actions.sections, actions.unfold, tool.sections[0])
    imgui.end_child()
    return toggled


def draw_sections(
    sections: list[Section], ui_scale: float, kept: dict[str, bool] | None = None,
    unfold: set[str] | None = None, open_first: str = "",
) -> bool:  # fmt: skip
    """Headings that fold, in the order given, in the window that is being made.

    kept: those that were opened (True) or folded by hand before; what a hand does now is put there,
    and the result tells whether it did.  unfold: those to be opened now, which leave it;
    open_first: one that is open at first, besides those that say so themselves.
    """
    kept, toggled = kept if kept is not None else {}, False
    unfold = unfold if unfold is not None else set()
    for other in sections:
        if other.shown is not None and not other.shown():
            continue
        at_first = other.open_first or other.name == open_first
        is_open = section(other.name, kept.get(other.name, at_first), other.name in unfold)
        unfold.discard(other.name)
        if imgui.is_item_toggled_open():
            kept[other.name], toggled = is_open, True
        if is_open:
            imgui.push_id(other.name)
            imgui.push_text_wrap_pos(0)  # a sentence in any language goes on in the next line
            other.draw(ui_scale)
            imgui.pop_text_wrap_pos()
            imgui.pop_id()
    return toggled


def in_order(sections: list[Section]) -> list[Section]:
    """All of them as they stand in one column; what ORDER does not name comes last."""
    known = {name: place for place, name in enumerate(ORDER)}
    return sorted(sections, key=lambda other: known.get(other.name, len(ORDER)))


def _title(title: str, actions: PanelActions, ui_scale: float) -> None:
    """The program's name, what is open; the globe, the settings, what folds all this."""
    side = imgui.get_frame_height()
    start, room = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), "Shapeshift")
    imgui.same_line()
    imgui.push_text_wrap_pos(start.x + room - 3 * side - 4 * ui_scale)
    imgui.text_unformatted(title or said("nothing is open"))
    imgui.pop_text_wrap_pos()
    below = imgui.get_cursor_pos()
    imgui.set_cursor_pos(Vec(start.x + room - 3 * side, start.y - 2 * ui_scale))
    if symbol_button("globe", GLOBE, side, False):
        imgui.open_popup(LANGUAGES)
    tip("Language", ui_scale)
    if imgui.begin_popup(LANGUAGES):
        actions.draw_languages(ui_scale)
        imgui.end_popup()
    imgui.set_cursor_pos(Vec(start.x + room - 2 * side, start.y - 2 * ui_scale))
    chosen = actions.tool() == SETUP.name
    if symbol_button("setup", SETUP.symbol, side, chosen):
        actions.choose(TOOLS[0].name if chosen else SETUP.name)
    tip(SETUP.what, ui_scale)
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
