"""What the panel has in a headset alone: the head with its slider, "Room", the foot, and the
sections of tools that a hand has.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.cuts_panel import draw_cuts
from shapeshift.app.editor.panels.open_row import draw_recent_picture
from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.scale_bar import draw_scale_bar, in_unit
from shapeshift.app.editor.panels.sections.regions_panel import draw_regions
from shapeshift.app.editor.panels.slider import draw_slider
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.overlay_renderer import Textures
from shapeshift.app.editor.panels.widgets.panel_rows import item_label, labelled_slider
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.track import shown_words
from shapeshift.app.editor.texts.table import said
from shapeshift.app.headset.in_hand.finger_brush import LEAST_M, MOST_M
from shapeshift.app.headset.in_hand.hand_tools import HandTools
from shapeshift.app.headset.pacing import QUALITIES
from shapeshift.app.headset.scene_shelf import SceneShelf
from shapeshift.app.headset.sections.comfort_section import lit_button
from shapeshift.app.headset.xr_user import XrState
from shapeshift.app.inspection.window.inspect_panel import InspectActions, draw_inspect
from shapeshift.app.inspection.window.ray_marks import LENGTHS, SPOTS
from shapeshift.renderer.colors.palette import ALL_VALUES

Vec = imgui.ImVec2


# Tools: Sections, Regions with paint, Inspect.

HOW_TOOLS = {
    "cut": "Squeeze at its outline: it follows the hand. A box's dots move its sides.",
    "paint": "Trigger or pinch paints at the fingertip, the stick makes it larger; B or Y erases.",
    "marks": "The trigger lays or chooses what the ray meets; with B or Y it removes a mark.",
}


def tool_sections(tools: HandTools, save: Callable[[], None]) -> list[Section]:
    """save: writes the scene, as Start from here does, and leaves its first look."""
    return [
        Section("Sections", lambda scale: _draw_sections(tools, save, scale)),
        Section("Regions", lambda scale: _draw_regions(tools, save, scale)),
        Section("Inspect", lambda scale: _draw_inspect(tools, save, scale)),
    ]


def _draw_sections(tools: HandTools, save: Callable[[], None], scale: float) -> None:
    tool = tools.sections
    _undo_save(tools, save)
    if tool.current is not None:
        changed, on = imgui.checkbox(item_label("in reach of hands"), tool.on)
        if changed:
            tool.on = on
        if tool.on:
            if imgui.button(item_label("Bring it here"), Vec(-1, 0)):
                tools.bring()
            _hint("cut")
    draw_cuts(tool, tools.editor, scale)


def _draw_regions(tools: HandTools, save: Callable[[], None], scale: float) -> None:
    brush = tools.brush
    _undo_save(tools, save)
    changed, on = imgui.checkbox(item_label("paint with a finger"), brush.on)
    if changed:
        brush.on = on
    if brush.on:
        _, brush.erases = imgui.checkbox(item_label("erase"), brush.erases)
        least, most = 1000 * LEAST_M, 1000 * MOST_M
        logarithmic = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp
        moved, radius = labelled_slider(
            "fingertip", 1000 * brush.radius_m, least, most, "fingertip: %.0f mm", logarithmic
        )
        if moved:
            brush.radius_m = radius / 1000
        _hint("paint")
    draw_regions(tools.editor, scale)


def _draw_inspect(tools: HandTools, save: Callable[[], None], scale: float) -> None:
    tool, marks = tools.inspecting, tools.marks
    gap, room = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
    if tool.measured is None:
        marks.pulls = LENGTHS
        changed, on = imgui.checkbox(item_label("measure lengths"), tool.on)
        if changed:
            tool.on = on
    else:
        auto = partial(setattr, marks, "wants_auto", True)
        report = partial(setattr, tools, "wants_report", True) if tools.inspect else None
        actions = InspectActions(_toggle(tools), auto, save, report)
        draw_inspect(tool, actions, tools.unit, scale)
        _ends(tools)
    if tool.on:
        if tool.measured is not None:
            width = (room - gap) / 2
            if lit_button(item_label("spots"), marks.pulls == SPOTS, width):
                marks.pulls, marks.first = SPOTS, None
            imgui.same_line()
            if lit_button(item_label("lengths"), marks.pulls == LENGTHS, width):
                marks.pulls = LENGTHS
        _hint("marks")
    if imgui.button(item_label("Undo"), Vec(-1, 0)) and not tools.undo():
        _nothing(tools)


def _toggle(tools: HandTools) -> Callable[[], None]:
    def toggle() -> None:
        tools.inspecting.on = not tools.inspecting.on

    return toggle


def _ends(tools: HandTools) -> None:
    """Level and span: the values that the ends of the palette stand for."""
    tool = tools.inspecting
    assert tool.measured is not None  # asked for where there is heat
    own, wanted = tool.measured.stop.unit, tools.unit
    unit, low, high = in_unit(own, *tool.value_range, wanted)
    _, first, last = in_unit(own, *tool.ends, wanted)
    sign = f" {unit.replace('%', '%%')}".rstrip()
    words = said("coldest: %.1f"), said("hottest: %.1f")
    if tool.measured.stop.kind == "values":
        number = f": %.{tool.measured.stop.digits}f"
        words = said("lowest") + number, said("highest") + number
    moved, first = labelled_slider("coldest", first, low, high, words[0] + sign)
    also, last = labelled_slider("hottest", last, low, high, words[1] + sign)
    if moved or also:
        back = in_unit(unit, first, last, own)[1:] if unit != own else (first, last)
        tool.ends = back


def _hint(name: str) -> None:
    imgui.push_text_wrap_pos(0)
    imgui.text_disabled(said(HOW_TOOLS[name]))
    imgui.pop_text_wrap_pos()


def _undo_save(tools: HandTools, save: Callable[[], None]) -> None:
    width = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
    if imgui.button(item_label("Undo"), Vec(width, 0)) and not tools.undo():
        _nothing(tools)
    imgui.same_line()
    if imgui.button(item_label("Save"), Vec(width, 0)):
        save()


def _nothing(tools: HandTools) -> None:
    tools.editor.messages.say(said("There is nothing to undo."), time.perf_counter())


@dataclass(frozen=True)
class SceneActions:
    """What the section asks of the session."""

    open: Callable[[Path], None]
    start_here: Callable[[], None]
    picture: Callable[[], None]
    record: Callable[[], None] = lambda: None
    recording: Callable[[], bool] = lambda: False


def draw_scenes(
    shelf: SceneShelf, actions: SceneActions, textures: Textures, ui_scale: float
) -> None:
    """Three buttons, and a row a scene."""
    width = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
    if imgui.button(item_label("Take a picture"), Vec(width, 0)):
        actions.picture()
    imgui.same_line()
    if imgui.button(item_label("Start from here"), Vec(width, 0)):
        actions.start_here()
    label = item_label("Record frames")
    if actions.recording():
        label = item_label("Stop recording")
    if imgui.button(label, Vec(2 * width + imgui.get_style().item_spacing.x, 0)):
        actions.record()
    if shelf.opening is not None:
        imgui.text_disabled(said("Opening {names} \u2026", names=shelf.opening.name))
    for row, (name, path) in enumerate(shelf.rows):
        picture: np.ndarray | None = shelf.pictures.of(path) if shelf.pictures else None
        draw_recent_picture(textures, row, picture, ui_scale)
        high = imgui.get_item_rect_size().y
        if imgui.selectable(f"{name}##{row}", path == shelf.shown, 0, Vec(0, high))[0]:
            actions.open(path)


SIZES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)
SURE_S = 4.0  # Exit asks once more for so long
QUALITY_NAMES = {"auto": "Auto", "best": "Best", "balanced": "Balanced", "fast": "Fast"}
SCALE_TALL = 124.0  # units of the overlay, of the scale of a value stop
SCALE_WIDE = 100.0
HOW = (
    "The menu button, or the palm turned up, opens and closes the panel. The stick of the hand "
    "that carries it slides; the stick of the hand that points at it scrolls."
)


@dataclass
class RoomActions:
    """What the panel asks of the session; the frame is known there."""

    recentre: Callable[[], None]
    resize: Callable[[float], None]  # metres of the world a metre of the room
    leave: Callable[[], None]


def draw_head(state: EditorState, ui_scale: float) -> None:
    """Whose slider it is, which stop is shown, and the slider; what could not be done."""
    if not state.sliders:
        imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), "Shapeshift")
        imgui.text_disabled(said("nothing here changes its shape"))
    for index in state.sliders:
        imgui.push_id(index)
        obj = state.scene.objects[index]
        _named(state, obj.name, shown_words(state.stops(index), obj.x, obj.slider_x), ui_scale)
        draw_slider(state, index, ui_scale)
        imgui.pop_id()
    for sentence in state.messages.problems:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.WARNING, 1))
        imgui.text_wrapped(sentence)
        imgui.pop_style_color()
        if imgui.button(f"OK##{sentence}"):
            state.messages.dismiss(sentence)


def _named(state: EditorState, name: str, shown: str, ui_scale: float) -> None:
    """The name, what it shows, and arrows to the others that have a slider and are seen."""
    seen = [i for i in state.movable if state.scene.objects[i].visible]
    names = [state.scene.objects[index].name for index in seen]
    side, gap = imgui.get_frame_height(), imgui.get_style().item_spacing.x
    start, room = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
    arrows = 2 * side + gap if len(names) > 1 else 0.0
    corner = imgui.get_cursor_screen_pos()
    edge = Vec(corner.x + room - arrows - gap, corner.y + side)
    imgui.push_clip_rect(corner, edge, True)
    imgui.align_text_to_frame_padding()
    imgui.text_disabled(name)
    imgui.same_line()
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), shown)
    imgui.pop_clip_rect()
    place = names.index(name) if name in names else -1
    for label, way in (("previous", -1), ("next", 1)) if arrows else ():
        left = room - arrows if way < 0 else room - side
        imgui.set_cursor_pos(Vec(start.x + left, start.y))
        if imgui.arrow_button(label, imgui.Dir.left if way < 0 else imgui.Dir.right):
            state.chosen = names[(place + way) % len(names)]


def draw_room(state: XrState, actions: RoomActions) -> None:
    """How large the world looks, how it is drawn, the grid on the floor."""
    gap, room = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
    width, left = (room - 3 * gap) / 4, imgui.get_cursor_pos_x()
    scale = state.play_space.scale
    imgui.align_text_to_frame_padding()
    imgui.text(size_text(scale))
    for number, (label, wanted) in enumerate(
        (("\u2013", next_scale(scale, False)), ("+", next_scale(scale, True)), ("1 : 1", 1.0))
    ):
        imgui.same_line()
        imgui.set_cursor_pos_x(left + (number + 1) * (width + gap))
        if lit_button(label, label == "1 : 1" and abs(scale - 1) < 1e-3, width):
            actions.resize(wanted)
    names = [item_label(QUALITY_NAMES[name]) for name in QUALITIES]
    texts = [imgui.calc_text_size(said(QUALITY_NAMES[name])).x for name in QUALITIES]
    spare = (room - 3 * gap - sum(texts)) / len(texts)
    for number, name in enumerate(QUALITIES):
        if number:
            imgui.same_line()
        if lit_button(names[number], state.pacing.quality == name, texts[number] + spare):
            state.pacing.quality = name
    _, state.floor_shown = imgui.checkbox(item_label("grid on the floor"), state.floor_shown)


def draw_help() -> None:
    """How the panel opens, and what the sticks do while it is there."""
    imgui.push_text_wrap_pos(0)
    imgui.text_unformatted(said(HOW))
    imgui.pop_text_wrap_pos()


def draw_scale(state: EditorState, ui_scale: float) -> None:
    """The palette of the value stop with its values."""
    corner = imgui.get_cursor_screen_pos()
    box = (corner.x, corner.y, corner.x + SCALE_WIDE * ui_scale, corner.y + SCALE_TALL * ui_scale)
    ends = state.settings.heat_ends if state.settings.heat_ends != ALL_VALUES else None
    draw_scale_bar(state.scene, box, ui_scale, imgui.get_window_draw_list(), ends=ends)
    imgui.dummy(Vec(SCALE_WIDE * ui_scale, SCALE_TALL * ui_scale))


class Foot:
    """Recentre and Exit, which asks once more."""

    def __init__(self, actions: RoomActions) -> None:
        self._actions = actions
        self.sure_s = 0.0  # seconds for which Exit asks "really?"

    def draw(self, seconds: float) -> None:
        self.sure_s = max(self.sure_s - seconds, 0.0)
        width = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
        if imgui.button(item_label("Recentre"), Vec(width, 0)):
            self.sure_s = 0.0
            self._actions.recentre()
        imgui.same_line()
        asks = self.sure_s > 0
        if asks:
            imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*theme.WARNING, 1))
        label = said("Really exit?") if asks else said("Exit")
        if imgui.button(f"{label}###exit", Vec(width, 0)):
            self.sure_s = 0.0 if asks else SURE_S
            if asks:
                self._actions.leave()
        if asks:
            imgui.pop_style_color()


def size_text(scale: float) -> str:
    """How large the world looks."""
    size = 100 / scale
    return f"{size:.0f} %" if size >= 100 else f"{size:.3g} %"


def next_scale(scale: float, larger: bool) -> float:
    """The next size of SIZES; larger looking means fewer metres of the world in the room."""
    size, slack = 1 / scale, 1.001
    if larger:
        return 1 / next((s for s in SIZES if s > size * slack), max(size, SIZES[-1]))
    return 1 / next((s for s in reversed(SIZES) if s * slack < size), min(size, SIZES[0]))
