"""The panel's section "Parts": things and junk of a captured scene, taken out of it."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.sections.histogram_panel import draw_histogram
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    button_row,
    choice,
    item_label,
    slider,
    tip,
)
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.parts.parts_tool import REPLACE, PartsTool
from shapeshift.app.editor.state.parts.selecting import ALL, COLOR, DRAGS, LASSO, SPHERE, THING
from shapeshift.app.editor.texts.table import said
from shapeshift.scene.pick import anchor_places

Vec = imgui.ImVec2
MOST_BRUSH = 120.0  # logical pixels
AXES = ("left", "right"), ("low", "high"), ("back", "front")  # ends of x, y and z
DEEDS = {
    "Object": "Make it an object that can be moved, hidden and thrown. Enter.",
    "Hide": "An object that is not seen; its box in Objects shows it again.",
    "Delete": "Gone, and not in what is saved. Key Delete; Ctrl+Z brings it back.",
}
SIZES = {
    "Less": "The next click takes less than it means. Ctrl+wheel.",
    "More": "The next click takes more than it means. Ctrl+wheel.",
}
CHOICES = {
    "None": "Choose nothing. Esc.",
    "Invert": "Everything else of the object.",
    "Crop\u2026": "A box; all outside of it goes.",
}
FLOATERS = "Junk in the air: small groups apart, huge faint splats. Look, then press Delete."
DRAG_WORDS = {
    THING: "drag: the thing in a box",
    ALL: "drag: all in a box",
    LASSO: "drag: all in a lasso",
    SPHERE: "drag: a sphere about a place",
    COLOR: "click: a colour, everywhere",
}
LEAST_LIKENESS, MOST_LIKENESS = 0.01, 0.4  # of Oklab


def draw_parts(
    tool: PartsTool, ui_scale: float, how: str = REPLACE, eye: np.ndarray | None = None
) -> None:
    """All of the section; `how` is what the keys that are held make of a choice, and `eye` (3,)
    metres, world, from where colours are seen.
    """
    changed, _ = imgui.checkbox(item_label("take things out"), tool.on)
    tip("Point at a thing and it lights up; a click chooses it. Key O.", ui_scale)
    if changed:
        tool.toggle()
    if not tool.on:
        return
    if tool.crop is not None:
        draw_crop(tool, tool.crop, ui_scale)
        return
    chosen = chosen_words(tool)
    imgui.push_text_wrap_pos(0)
    imgui.text_disabled(chosen)
    imgui.pop_text_wrap_pos()
    imgui.begin_disabled(not tool.count)
    clicked = button_row(DEEDS, ui_scale, 3)
    imgui.end_disabled()
    if clicked:
        {"Object": tool.make, "Hide": tool.hide, "Delete": tool.delete}[clicked]()
    size = f"{100 * tool.factor:.0f} %" if tool.factor != 1 else ""
    clicked = button_row(SIZES, ui_scale, 2)
    if clicked:
        tool.grow(1.0 if clicked == "More" else -1.0)
    if size:
        imgui.text_disabled(said("a click takes {size} of what it means", size=size))
    clicked = button_row(CHOICES, ui_scale, 3)
    if clicked:
        {"None": tool.clear, "Invert": tool.invert, "Crop\u2026": tool.begin_crop}[clicked]()
    eye = np.zeros(3) if eye is None else eye
    if imgui.button(item_label("Floaters"), Vec(-1, 0)):
        tool.selecting.propose_floaters(eye, how)
    tip(FLOATERS, ui_scale)
    if theme.has_keys():  # a hand in a headset draws no boxes
        draw_hand(tool, ui_scale)
        draw_histogram(tool, how, eye, ui_scale)


def chosen_words(tool: PartsTool) -> str:
    """How many anchors are chosen, and of what."""
    if not tool.count:
        return said("nothing is chosen")
    return said("{count} anchors of {name}", count=number(tool.count), name=tool.name)


def draw_hand(tool: PartsTool, ui_scale: float) -> None:
    """What the left button does in the picture, and the size of the brush."""
    select = tool.selecting
    imgui.push_item_width(-1)
    select.drag = choice("drag", select.drag, DRAGS, [DRAG_WORDS[drag] for drag in DRAGS])
    tip("A thing in front of others, or all that shows there, behind it too. Key U.", ui_scale)
    if select.drag == COLOR:
        select.likeness = slider(
            "likeness", select.likeness, LEAST_LIKENESS, MOST_LIKENESS, "as unlike as: %.2f"
        )
        tip("How far a colour may be from the one that is clicked: black to white is 1.", ui_scale)
    else:
        regions = tool.state.regions
        regions.brush = slider("brush", regions.brush, 3.0, MOST_BRUSH, "brush: %.0f px")
        tip("Hold B and drag to add anchors, with Shift or Alt to remove them.", ui_scale)
    imgui.pop_item_width()


def draw_crop(tool: PartsTool, crop: np.ndarray, ui_scale: float) -> None:
    """Six sides of the crop box, in the object's frame, and what to do with it."""
    if tool.index is None:
        return
    places = anchor_places(tool.state.scene.objects[tool.index].model)
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    imgui.push_item_width(-1)
    for axis, names in enumerate(AXES):
        for side, name in enumerate(names):
            value = float(crop[side, axis])
            new = slider(name, value, float(low[axis]), float(high[axis]), f"{said(name)}: %.2f m")
            tip("A side of the box; what is red goes.", ui_scale)
            if new != value:
                tool.move_crop_side(axis, side, new)
    imgui.pop_item_width()
    gone = int(tool.outside().sum())
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.ACCENT, 1))
    if imgui.button(said("Crop: {count} anchors go", count=number(gone)) + "###crop", Vec(-1, 0)):
        tool.apply_crop()
    imgui.pop_style_color()
    tip("All outside the box is deleted, in one step. Enter.", ui_scale)
    if imgui.button(item_label("Cancel"), Vec(-1, 0)):
        tool.crop = None
    tip("Nothing goes. Esc.", ui_scale)
