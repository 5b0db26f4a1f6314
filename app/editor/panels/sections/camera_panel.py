"""The panel's section "Camera": views from all sides, those of a file, and keeping views in one."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.sections.named_views_panel import draw_lens, draw_named_views
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import button_row, choice, item_label, tip
from shapeshift.app.editor.state.camera.stepping import picture_box
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.scene.cameras.write_cameras import FORMS

Vec = imgui.ImVec2
SIDES = {
    "Front": "From +Z. Numpad 1.",
    "Right": "From +X. Numpad 3; Ctrl: the left side.",
    "Top": "From above. Numpad 7; Ctrl: from below.",
    "Back": "From -Z. Ctrl and numpad 1.",
}
WAYS = ("Fly", "Orbit")  # to the other one
STEPS = {
    "Previous": "Key P; moving leaves the camera.",
    "Next": "Key N; moving leaves the camera.",
}
KEEP = "Key K. All views of this start go into one file; drop one on the window to step through it."
FORM_NAMES = {
    "ours": "our own list",
    "inria": "3DGS cameras.json",
    "transforms": "transforms.json",
    "nerfstudio": "nerfstudio camera path",
    "vr": "splatapult floor",
    "colmap-bin": "COLMAP, binary",
    "colmap-txt": "COLMAP, text",
}


def draw_edges(state: EditorState, viewpoint: Viewpoint, ui_scale: float) -> None:
    """Where the picture of the camera that is looked through ends."""
    steps = viewpoint.steps
    if steps.cameras is None or not (state.overlay and steps.at_camera) or steps.moving:
        return
    view = viewpoint.view()
    box = picture_box(steps.cameras.views[steps.index], view)
    per_pixel = imgui.get_io().display_size.x / view.size[0]  # logical pixels
    left, top, right, low = np.array(box) * per_pixel
    imgui.get_background_draw_list().add_rect(
        Vec(left, top), Vec(right, low), theme.color(theme.MUTED, 0.6), 0, max(1.0, ui_scale)
    )


def draw_cameras(state: EditorState, viewpoint: Viewpoint, ui_scale: float) -> None:
    """Views from all sides, the camera's ways, cameras of a file, keeping views."""
    steps, kept = viewpoint.steps, viewpoint.kept
    if clicked := button_row(SIDES, ui_scale, len(SIDES)):
        viewpoint.look_from(clicked.lower())
    flying = WAYS[viewpoint.camera.flying]
    moves = {
        "Frame all": "Everything into the picture. Key F.",
        "First view": "As it was opened. Shift+F.",
        flying: "Key V; W A S D Q E move.",
    }
    deeds = {
        "Frame all": viewpoint.frame_all,
        "First view": viewpoint.go_home,
        flying: viewpoint.toggle_flying,
    }
    if clicked := button_row(moves, ui_scale, len(moves)):
        deeds[clicked]()
    draw_lens(viewpoint, ui_scale)
    draw_named_views(state, viewpoint, ui_scale)
    if steps.count:
        imgui.text_disabled(steps.text)
        clicked = button_row(STEPS, ui_scale, 2)
        if clicked:
            viewpoint.step_to_camera(1 if clicked == "Next" else -1)
    gap, room = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
    if imgui.button(item_label("Keep view"), Vec((room - gap) / 2, 0)):
        viewpoint.keep_view()
    tip(KEEP, ui_scale)
    imgui.same_line()
    imgui.push_item_width(-1)
    names = [said(FORM_NAMES[form]) for form in FORMS]
    kept.form = choice("form", kept.form, FORMS, names, names=True)
    tip("What the file of kept views is written for.", ui_scale)
    imgui.pop_item_width()
