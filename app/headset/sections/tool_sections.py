"""The panel's sections of tools that a hand has: Sections, Regions with paint, Inspect."""

import time
from collections.abc import Callable
from functools import partial

from imgui_bundle import imgui

from shapeshift.app.editor.panels.cuts_panel import draw_cuts
from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.scale_bar import in_unit
from shapeshift.app.editor.panels.sections.regions_panel import draw_regions
from shapeshift.app.editor.panels.widgets.panel_rows import item_label, labelled_slider
from shapeshift.app.editor.texts.table import said
from shapeshift.app.headset.in_hand.finger_brush import LEAST_M, MOST_M
from shapeshift.app.headset.in_hand.hand_tools import HandTools
from shapeshift.app.headset.sections.comfort_section import lit_button
from shapeshift.app.inspection.window.inspect_panel import InspectActions, draw_inspect
from shapeshift.app.inspection.window.ray_marks import LENGTHS, SPOTS

Vec = imgui.ImVec2
HOW = {
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
    imgui.text_disabled(said(HOW[name]))
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
