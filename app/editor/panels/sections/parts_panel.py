"""The panel's section "Parts": things and junk of a captured scene, taken out of it."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import button_row, choice, slider, tip
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
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


def draw_parts(tool: PartsTool, ui_scale: float) -> None:
    """All of the section."""
    changed, _ = imgui.checkbox("take things out", tool.on)
    tip("Point at a thing and it lights up; a click chooses it. Key O.", ui_scale)
    if changed:
        tool.toggle()
    if not tool.on:
        return
    if tool.crop is not None:
        draw_crop(tool, tool.crop, ui_scale)
        return
    chosen = f"{number(tool.count)} anchors of {tool.name}" if tool.count else "nothing is chosen"
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
        imgui.text_disabled(f"a click takes {size} of what it means")
    clicked = button_row(CHOICES, ui_scale, 3)
    if clicked:
        {"None": tool.clear, "Invert": tool.invert, "Crop\u2026": tool.begin_crop}[clicked]()
    if not theme.has_keys():
        return  # a hand in a headset draws no boxes
    imgui.push_item_width(-1)
    labels = ("a box takes the thing in it", "a box takes all in it")
    tool.takes_all = choice("box", tool.takes_all, (False, True), labels)
    tip("A thing in front of others, or all that shows there: junk in the air.", ui_scale)
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
            new = slider(name, value, float(low[axis]), float(high[axis]), f"{name}: %.2f m")
            tip("A side of the box; what is red goes.", ui_scale)
            if new != value:
                tool.move_crop_side(axis, side, new)
    imgui.pop_item_width()
    gone = int(tool.outside().sum())
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.ACCENT, 1))
    if imgui.button(f"Crop: {number(gone)} anchors go###crop", Vec(-1, 0)):
        tool.apply_crop()
    imgui.pop_style_color()
    tip("All outside the box is deleted, in one step. Enter.", ui_scale)
    if imgui.button("Cancel", Vec(-1, 0)):
        tool.crop = None
    tip("Nothing goes. Esc.", ui_scale)
