"""The panel's section "Look": palette, picture or debug view, appearance, background."""

from dataclasses import replace

from imgui_bundle import imgui

from shapeshift.app.editor.panels.sections.appearance_panel import (
    draw_appearance,
    draw_background,
)
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
    """Palette and debug view are neither saved with a scene nor undone, the rest is both."""
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
    if state.scene.objects:
        draw_appearance(state, ui_scale)
        draw_background(state, ui_scale)
    imgui.pop_item_width()
