"""The panel's section "Scenes": what was opened before, with pictures; a start, and a snapshot."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.open_row import draw_recent_picture
from shapeshift.app.editor.panels.widgets.panel_rows import item_label
from shapeshift.app.editor.panels.widgets.textures import Textures
from shapeshift.app.editor.texts.table import said
from shapeshift.app.headset.scene_shelf import SceneShelf

Vec = imgui.ImVec2


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
