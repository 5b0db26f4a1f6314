"""Of the panel's section "Look": exposure, gamma, tint and opacity, and what is behind everything.

All of it is of the scene file: undone, and saved with it.
"""

from dataclasses import replace

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.panel_rows import (
    item_label,
    labelled_slider,
    subsection,
    tip,
)
from shapeshift.app.editor.state.arrange import edit
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.appearance import NEUTRAL, Appearance, Color, Sky, plain_color
from shapeshift.scene.document import edits

SLIDERS = {  # name -> least, most, what stands over it, logarithmic, what it does
    "exposure": (-4.0, 4.0, "exposure: %+.2f stops", False,
                 "Stops of light: 1 doubles it. Measured heat keeps its colours."),
    "gamma": (0.25, 4.0, "gamma: %.2f", True,
              "Above 1 dark tones are brighter, below 1 darker. Black and white stay."),
    "opacity": (0.0, 1.0, "opacity: %.2f", False, "Of every splat; at 0 nothing is seen."),
}  # fmt: skip
PICKED = imgui.ColorEditFlags_.no_inputs
CLEAR_SKY = Sky((0.36, 0.56, 0.85), (0.86, 0.91, 0.96), (0.42, 0.40, 0.37))
PARTS = {
    "zenith": "The colour straight above.",
    "horizon": "The colour level with the eye.",
    "ground": "The colour straight below.",
}


def draw_appearance(state: EditorState, ui_scale: float) -> None:
    """Of the chosen object where there is one, else of the whole scene."""
    item = edits.find(state.edited.file, state.chosen)
    of_scene = state.edited.file.appearance
    lit = (of_scene if item is None else item.appearance) != NEUTRAL
    if not subsection("Exposure, gamma, tint, opacity", lit):
        return
    name, now = ("", of_scene) if item is None else (item.name, item.appearance)
    imgui.push_id(f"appearance {name}")
    imgui.text_disabled(said("of {name}", name=name) if name else said("of the whole scene"))
    for field, (least, most, text, logarithmic, what) in SLIDERS.items():
        flags = imgui.SliderFlags_.always_clamp
        flags |= imgui.SliderFlags_.logarithmic if logarithmic else 0
        moved, value = labelled_slider(field, getattr(now, field), least, most, text, flags)
        tip(what, ui_scale)
        if moved:
            _appear(state, name, _with(now, field, round(value, 4)), field)
    tint = _picked("tint", now.tint, "A colour that is multiplied with all of its own.", ui_scale)
    if tint != now.tint:
        _appear(state, name, replace(now, tint=tint), "tint")
    if now != NEUTRAL:
        imgui.same_line()
        if imgui.button(item_label("As it was")):
            _appear(state, name, NEUTRAL, "")
        tip("No exposure, gamma 1, no tint, opacity 1.", ui_scale)
    imgui.pop_id()


def draw_background(state: EditorState, ui_scale: float) -> None:
    """One colour, or those of a sky."""
    now = state.settings.background
    changed, on = imgui.checkbox(item_label("sky"), isinstance(now, Sky))
    tip("Behind the scene a sky over a ground instead of one colour.", ui_scale)
    if changed:
        _put_sky(state, CLEAR_SKY if on else _plain(plain_color(now)), "")
        return
    if isinstance(now, Sky):
        for number, (part, what) in enumerate(PARTS.items()):
            if number:
                imgui.same_line()
            color = _picked(part, getattr(now, part), what, ui_scale)
            if color != getattr(now, part):
                _put_sky(state, replace(now, **{part: color}), part)
        return
    imgui.same_line()
    color = _picked("background", now, "The colour behind the scene.", ui_scale)
    if color != now:
        _put_sky(state, _plain(color), "background")


def _picked(name: str, color: Color, what: str, ui_scale: float) -> Color:
    """A field of a colour; a click opens where another one is chosen."""
    changed, chosen = imgui.color_edit3(item_label(name), list(color), PICKED)
    tip(said("{what} Click it to choose another.", what=said(what)), ui_scale)
    return three(min(max(part, 0.0), 1.0) for part in chosen) if changed else color


def _plain(color: Color) -> Sky:
    return Sky(color, color, color)


def _with(now: Appearance, field: str, value: float) -> Appearance:
    """With another exposure, gamma or opacity."""
    if field == "exposure":
        return replace(now, exposure=value)
    return replace(now, gamma=value) if field == "gamma" else replace(now, opacity=value)


def _appear(state: EditorState, name: str, appearance: Appearance, field: str) -> None:
    file = edits.set_appearance(state.edited.file, name, appearance)
    what = f"{field or 'look'} of {name or 'the scene'}"
    edit(state, file, what, f"{what} {name}" if field else "")


def _put_sky(state: EditorState, sky: Sky, part: str) -> None:
    file = edits.set_sky(state.edited.file, sky)
    edit(state, file, part or "sky", f"sky {part}" if part else "")
