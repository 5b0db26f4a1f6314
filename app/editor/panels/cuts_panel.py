"""The panel's section "Sections": planes and boxes that cut the scene, or show a stop beyond."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    button_row,
    choice,
    item_label,
    slider,
    tip,
)
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.section_tool import DECIMALS, SectionTool
from shapeshift.app.editor.texts.table import said
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.sections.section import CAPPED, HARD, SOFT, PlaneShape, SceneSection, flipped

Vec = imgui.ImVec2
ADD = {
    "+ cut plane": "A plane: what lies beyond it is not drawn.",
    "+ cut box": "A box: what lies outside of it is not drawn.",
}
EDGES = {
    CAPPED: "edge: capped", HARD: "edge: hard, by centres", SOFT: "edge: soft",
}  # fmt: skip
SIDES = {
    "X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0),
}  # fmt: skip


def draw_cuts(tool: SectionTool, state: EditorState, ui_scale: float) -> None:
    """Buttons that add, the list, and the controls of the chosen one."""
    if not state.scene.objects:
        imgui.text_disabled(said("There is nothing to be cut."))
        return
    name = tool.owner
    imgui.text_disabled(said("of {name}", name=name) if name else said("of the whole scene"))
    clicked = button_row(ADD, ui_scale, 2)
    if clicked:
        tool.add(plane=clicked == "+ cut plane")
    for number, section in enumerate(tool.sections):
        imgui.push_id(number)
        _row(tool, number, section, ui_scale)
        imgui.pop_id()
    current = tool.current
    if current is not None:
        imgui.push_item_width(-1)
        imgui.push_id("chosen")
        _chosen(tool, state, current, ui_scale)
        imgui.pop_id()
        imgui.pop_item_width()


def _row(tool: SectionTool, number: int, section: SceneSection, ui_scale: float) -> None:
    """On or off, and the words that choose it."""
    changed, on = imgui.checkbox("##on", section.enabled)
    if changed:
        tool.change(number, "switch a section", enabled=on)
    tip("On or off; it keeps its settings.", ui_scale)
    imgui.same_line()
    chosen = tool.on and number == tool.number
    imgui.push_style_color(
        imgui.Col_.text, imgui.ImVec4(*(theme.ACCENT if chosen else theme.TEXT), 1)
    )
    plane = isinstance(section.shape, PlaneShape)
    words = said("plane {number}" if plane else "box {number}", number=number + 1)
    if imgui.selectable(f"{words}###row", chosen)[0]:
        if chosen:
            tool.on = False
        else:
            tool.choose(number)
    imgui.pop_style_color()
    tip("Choose it: its handles are in the picture. Shift+O.", ui_scale)


def _chosen(tool: SectionTool, state: EditorState, section: SceneSection, ui_scale: float) -> None:
    number = tool.number
    if isinstance(section.shape, PlaneShape):
        _plane(tool, state, ui_scale)
    edge = choice("edge", section.edge, EDGES, EDGES.values())
    tip("Capped: splats end at the side. Hard: each is there or not. Soft: they fade.", ui_scale)
    if edge != section.edge:
        tool.change(number, "edge of a section", edge=edge)
        return
    if section.edge == SOFT:
        far = 0.5 * state.radius
        width = slider("width", section.width_m, 0.001 * far, far, "width: %.3f m")
        tip("Over this far splats fade, inside of the side.", ui_scale)
        if width != section.width_m:
            tool.change(
                number, "edge of a section", "section width", width_m=round(width, DECIMALS)
            )
    _beyond(tool, state, section, ui_scale)
    if imgui.button(item_label("Remove"), Vec(-1, 0)):
        tool.remove(number)
    tip("Ctrl+Z brings it back.", ui_scale)


def _plane(tool: SectionTool, state: EditorState, ui_scale: float) -> None:
    """Where the plane is along its normal, which way it looks, and its other side."""
    shape = tool.shape
    assert isinstance(shape, PlaneShape), "asked for planes alone"
    middle = float(np.array(shape.normal) @ state.centre)
    now, far = shape.offset_m - middle, state.radius
    now = now if abs(now) >= 0.0005 else 0.0  # not -0.000
    by = slider("offset", now, -far, far, "place: %.3f m")
    tip("Along its normal from the middle of the scene; its dot is dragged, too.", ui_scale)
    if by != now:
        tool.put_shape(PlaneShape(shape.normal, middle + by), "section place")
        return
    for name, normal in SIDES.items():
        if imgui.button(f"{name}###along {name}", Vec(34 * ui_scale, 0)):
            tool.put_shape(PlaneShape(normal, float(np.array(normal) @ state.centre)))
        tip("Across this axis, through the middle.", ui_scale)
        imgui.same_line()
    if imgui.button(item_label("Other side"), Vec(-1, 0)):
        tool.put_shape(flipped(shape))
    tip("What is kept and what is cut away change places.", ui_scale)


def _beyond(tool: SectionTool, state: EditorState, section: SceneSection, ui_scale: float) -> None:
    """Nothing beyond, or a stop."""
    index = state.chosen_index if tool.owner else 0
    stops = state.stops(index or 0)
    if len(stops) < 2:
        return
    xs: list[Control | None] = [None, *(stop.x for stop in stops)]
    names = [said("beyond: nothing")] + [said("beyond: {name}", name=s.name) for s in stops]
    if section.beyond not in xs:  # of the file: a number or a blend
        xs.append(section.beyond)
        names.append(said("beyond: another x"))
    at = xs.index(section.beyond)
    chosen = choice("beyond", at, range(len(xs)), names, names=True)
    tip("What is shown there: nothing, or the layer of another stop.", ui_scale)
    if chosen != at:
        tool.change(tool.number, "beyond a section", beyond=xs[chosen])
