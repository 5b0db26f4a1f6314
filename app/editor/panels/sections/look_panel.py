"""The panel's section "Look": palette, picture or debug view, appearance, background."""

from dataclasses import replace

from imgui_bundle import imgui

from shapeshift.app.editor.panels.sections.appearance_panel import (
    draw_appearance,
    draw_background,
)
from shapeshift.app.editor.panels.widgets.panel_rows import choice, slider, tip
from shapeshift.app.editor.state.editor_state import AS_FILED, EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.renderer.colors.palette import PALETTES
from shapeshift.renderer.settings import DEBUG_VIEWS

TWO_STOPS = ("one stop", "two stops beside a line", "heat over shape")
MOST_DETAIL = 3.0
PALETTE_TIP = (
    "The colours in which a stop shows its values. In all but turbo and rainbow lighter "
    "is hotter (in black-hot darker), also for eyes that confuse colours; viridis and cividis are "
    "made for them."
)
DEBUG_NAMES = {
    "": "picture",
    "culls": "what is culled, and why",
    "birdseye": "the same from above",
    "overdraw": "overdraw",
    "depth": "depth",
    "object": "objects",
    "ellipses": "splats as ellipses",
    "points": "splats as points",
    "rings": "splats as rings",
}


def draw_two_stops(state: EditorState, ui_scale: float) -> None:
    """One stop, two beside a line, or heat over the shape of the other."""
    split, index = state.split, state.sliders[0]
    now = TWO_STOPS[1 + split.over] if split.on else TWO_STOPS[0]
    chosen = choice("two stops", now, TWO_STOPS, TWO_STOPS)
    tip("Another stop at once: keys C and Shift+C. Its knob is blue.", ui_scale)
    if chosen == TWO_STOPS[0] and split.on:
        split.on = False
    elif chosen != now:
        obj, way = state.scene.objects[index], state.shifts.get(index)
        split.toggle(obj, chosen == TWO_STOPS[2], way)
    if split.on and split.over:
        split.detail = slider("detail", split.detail, 0.0, MOST_DETAIL, "shape: %.2f")
        tip("How much of the photo's edges shows through the colours of heat.", ui_scale)


def draw_look(state: EditorState, ui_scale: float) -> None:
    """Palette and debug view are neither saved with a scene nor undone, the rest is both."""
    imgui.push_item_width(-1)
    if state.has_palettes:
        names = [AS_FILED, *PALETTES]
        labels = [said("heat: as filed"), *(said("heat: {name}", name=name) for name in PALETTES)]
        chosen = choice("palette", state.palette, names, labels, names=True)
        tip(PALETTE_TIP, ui_scale)
        if chosen != state.palette:
            state.choose_palette(chosen)
    names = [said("show: {what}", what=said(DEBUG_NAMES[name])) for name in DEBUG_VIEWS]
    debug = choice("debug", state.settings.debug, DEBUG_VIEWS, names, names=True)
    tip("The picture, or what it is made of. Key G goes through these, Shift+G back.", ui_scale)
    if debug != state.settings.debug:
        state.settings = replace(state.settings, debug=debug)
    if state.split.possible and state.sliders:
        draw_two_stops(state, ui_scale)
    if state.scene.objects:
        draw_appearance(state, ui_scale)
        draw_background(state, ui_scale)
    imgui.pop_item_width()
