"""The panel's section "Look": the picture or a debug view of it, palette and background."""

from dataclasses import replace

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.panel_rows import choice, tip
from shapeshift.app.editor.state.editor_state import AS_FILED, EditorState
from shapeshift.renderer.colors.palette import PALETTES
from shapeshift.renderer.settings import DEBUG_VIEWS

DEBUG_NAMES = {
    "": "picture",
    "culls": "what is culled, and why",
    "birdseye": "the same from above",
    "overdraw": "overdraw",
    "depth": "depth",
    "object": "objects",
}


def draw_look(state: EditorState, ui_scale: float) -> None:
    """None of this is saved with a scene, and none of it is undone."""
    imgui.push_item_width(-1)
    if state.has_palettes:
        names = [AS_FILED, *PALETTES]
        labels = ["heat: as filed", *(f"heat: {name}" for name in PALETTES)]
        chosen = choice("palette", state.palette, names, labels)
        tip("The colours in which a thermal stop shows temperatures.", ui_scale)
        if chosen != state.palette:
            state.choose_palette(chosen)
    names = [f"show: {DEBUG_NAMES[name]}" for name in DEBUG_VIEWS]
    debug = choice("debug", state.settings.debug, DEBUG_VIEWS, names)
    tip("The picture, or what it is made of. Key G goes through these, Shift+G back.", ui_scale)
    if debug != state.settings.debug:
        state.settings = replace(state.settings, debug=debug)
    imgui.pop_item_width()
    changed, background = imgui.color_edit3(
        "background", list(state.settings.background), imgui.ColorEditFlags_.no_inputs
    )
    tip("The colour behind the scene: click it to choose another.", ui_scale)
    if changed:
        state.settings = replace(state.settings, background=tuple(background))
