"""The panel's section "Regions": parts of an object with a control value of their own."""

from typing import Any

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.slider import track
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    button_row,
    choice,
    item_label,
    right_aligned,
    slider,
    tip,
)
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.regions import KINDS, Region
from shapeshift.app.editor.texts.table import said

Vec = imgui.ImVec2
LARGEST = 2.0  # scene radii, of a size
LONGEST_NAME = 40
MOST_BRUSH = 120.0  # logical pixels
DIRECTIONS = {  # name -> the way out of a half-space's plane, into what it selects
    "up": (0, 1, 0), "down": (0, -1, 0), "right": (1, 0, 0), "left": (-1, 0, 0),
    "front": (0, 0, 1), "back": (0, 0, -1),
}  # fmt: skip
HALVES = ("half width", "half height", "half depth")
PAINTED = {"None": "Paint nothing.", "All": "Paint everything.", "Invert": "The other part."}
KIND_TIPS = {
    "box": "A box with its own x; click into the picture to place it.",
    "sphere": "A sphere with its own x; click into the picture to place it.",
    "half-space": "All on one side of a plane; click into the picture to place it.",
    "lens": "What you look at, through a round lens around the line of sight. Key L.",
    "painted": "What you paint: hold B and drag over the picture, Shift erases.",
}


def draw_regions(state: EditorState, ui_scale: float) -> None:
    """Buttons that add, the list, and the controls of the chosen one."""
    if not state.scene.objects:
        imgui.text_disabled(said("There is no object to select from."))
        return
    for number, kind in enumerate(KINDS):
        _add_button(state, number, kind, ui_scale)
    regions = state.regions
    for number in range(len(regions.items)):
        imgui.push_id(number)
        _row(state, number, ui_scale)
        imgui.pop_id()
    if regions.current is not None:
        imgui.push_item_width(-1)
        imgui.push_id("chosen")
        _chosen(state, regions.current, ui_scale)
        imgui.pop_id()
        imgui.pop_item_width()


def _add_button(state: EditorState, number: int, kind: str, ui_scale: float) -> None:
    """One of the buttons that add a region, three to a line."""
    gap = imgui.get_style().item_spacing.x
    if number % 3:
        imgui.same_line()
        width = imgui.get_content_region_avail().x / (3 - number % 3)
        width -= gap * (2 - number % 3) / (3 - number % 3)
    else:
        width = (imgui.get_content_region_avail().x - 2 * gap) / 3
    word = "plane" if kind == "half-space" else kind
    if imgui.button(f"+ {said(word)}###add {kind}", Vec(width, 0)):
        state.add_region(kind)
    tip(KIND_TIPS[kind], ui_scale)


def _row(state: EditorState, number: int, ui_scale: float) -> None:
    """On or off, the name that chooses it, its x."""
    regions = state.regions
    region = regions.items[number]
    changed, on = imgui.checkbox("##on", region.enabled)
    if changed:
        regions.edit(number, enabled=on)
    tip("On or off; it keeps its settings.", ui_scale)
    imgui.same_line()
    chosen = number == regions.chosen
    ink = theme.ACCENT if chosen else theme.TEXT
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*ink, 1))
    width = imgui.get_content_region_avail().x - 56 * ui_scale
    if imgui.selectable(region.name or said("(no name)"), chosen, 0, Vec(width, 0))[0]:
        regions.choose(-1 if chosen else number)
    imgui.pop_style_color()
    tip("Choose it to edit it; click again to leave it.", ui_scale)
    imgui.same_line()
    blend = state.scene.objects[region.index].model.blend
    right_aligned(f"x {blend.slider_x(region.x):.2f}")


def _chosen(state: EditorState, region: Region, ui_scale: float) -> None:
    """Every control of the region that is being edited."""
    regions, number = state.regions, state.regions.chosen
    objects = state.scene.objects
    if theme.has_keys():  # a hand in a headset types nothing
        changed, name = imgui.input_text("##name", region.name)
        tip("Its name.", ui_scale)
        if changed:
            regions.edit(number, name=name[:LONGEST_NAME])
    if len(objects) > 1 and region.kind != "painted":
        names = [said("of {name}", name=obj.name) for obj in objects]
        index = choice("object", region.index, range(len(objects)), names, names=True)
        tip("The object whose part it is.", ui_scale)
        regions.edit(number, index=index)
    if region.is_placed and theme.has_keys():  # that hand takes it and puts it down
        _place(state, ui_scale)
    _sizes(state, region, ui_scale)
    far = 0.5 * state.radius
    border = slider("border", region.border, 0.0, far, "border: %.3f m", "border: sharp")
    tip("Over this far x goes over from inside to outside; at 0 shapes may tear.", ui_scale)
    regions.edit(number, border=border)
    stops, blend = state.stops(region.index), objects[region.index].model.blend
    moved = track(stops, (blend.slider_x(region.x),), state.grip, 46 * ui_scale)
    if moved.knob is not None:
        regions.edit(number, x=moved.x)
    elif moved.stop is not None:
        regions.edit(number, x=stops[moved.stop].x)
    if imgui.button(item_label("Remove"), Vec(-1, 0)):
        regions.remove(number)
    tip("Ctrl+Z brings it back.", ui_scale)


def _place(state: EditorState, ui_scale: float) -> None:
    """The button after which a click into the picture sets the place."""
    regions = state.regions
    label = said("Click into the picture \u2026" if regions.placing else "Place")
    if regions.placing:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.ACCENT, 1))
    clicked = imgui.button(f"{label}###place", Vec(-1, 0))
    if regions.placing:
        imgui.pop_style_color()
    if clicked:
        regions.placing = not regions.placing
    tip("The next click puts its centre on the surface there; drag to move it on.", ui_scale)


def _sizes(state: EditorState, region: Region, ui_scale: float) -> None:
    """What makes a region large or small; depends on its kind."""
    regions, number = state.regions, state.regions.chosen
    low, high = 0.01 * state.radius, LARGEST * state.radius
    if region.kind == "box":
        half = []
        for name, metres in zip(HALVES, region.half, strict=True):
            half.append(slider(name, float(metres), low, high, f"{said(name)}: %.2f m"))
            tip("From the middle of the box to its side.", ui_scale)
        regions.edit(number, half=np.array(half))
    elif region.kind == "sphere":
        radius = slider("radius", float(region.half[0]), low, high, "radius: %.2f m")
        tip("From the middle of the sphere to its skin.", ui_scale)
        regions.edit(number, half=np.full(3, radius))
    elif region.kind == "half-space":
        _direction(state, region, ui_scale)
    elif region.kind == "lens":
        degrees = float(np.degrees(np.arctan(region.tangent)))
        degrees = slider("lens", degrees, 1.0, 60.0, "half its angle: %.0f\u00b0")
        tip("The lens stays around the line of sight, whatever you look at.", ui_scale)
        if not np.isclose(degrees, np.degrees(np.arctan(region.tangent)), atol=1e-3):
            regions.edit(number, tangent=float(np.tan(np.radians(degrees))))
    else:
        _brush(state, region, ui_scale)


def _direction(state: EditorState, region: Region, ui_scale: float) -> None:
    """Which side of the plane is selected."""
    regions = state.regions
    names = list(DIRECTIONS)
    near = [float(np.dot(region.normal, DIRECTIONS[name])) for name in names]
    at = names[int(np.argmax(near))]
    chosen = choice(
        "direction", at, names, [said("towards: {side}", side=said(name)) for name in names]
    )
    tip("The side of the plane that it selects.", ui_scale)
    if chosen != at:
        regions.edit(regions.chosen, normal=np.array(DIRECTIONS[chosen], float))


def _brush(state: EditorState, region: Region, ui_scale: float) -> None:
    """The brush, how much is painted, and what needs no brush."""
    regions = state.regions
    if theme.has_keys():
        regions.brush = slider("brush", regions.brush, 3.0, MOST_BRUSH, "brush: %.0f px")
        tip(KIND_TIPS["painted"], ui_scale)
    if region.painted is None:
        return
    count = int(region.painted.sum())
    imgui.text_disabled(said("{count:,} of {all:,} painted", count=count, all=len(region.painted)))
    clicked = button_row(PAINTED, ui_scale, 3)
    if clicked:
        new: Any = {"None": np.zeros_like, "All": np.ones_like, "Invert": np.logical_not}[clicked]
        regions.edit(regions.chosen, painted=new(region.painted))
