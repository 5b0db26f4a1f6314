"""The panel's section "Views": from all sides, the scene's own, cameras of a file; the lens."""

import math
from collections.abc import Callable

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    button_row,
    choice,
    item_label,
    labelled_slider,
    subsection,
    symbol_button,
    tip,
)
from shapeshift.app.editor.state.arrange import edit
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint, picture_box
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.scene.cameras.write_cameras import FORMS
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import FirstView, NamedView, SceneFile

# The lens, and the scene's own views: a list, a plus, a star for the first one.

Vec = imgui.ImVec2
STAR = "\uf005"
FOV_DEGREES = (10.0, 120.0)
SPEEDS = (0.05, 20.0)  # times the usual one
NEAREST_RADII, FARTHEST_RADII = 0.001, 2.0  # of the scene: what the near plane can be
LOGARITHMIC = imgui.SliderFlags_.always_clamp | imgui.SliderFlags_.logarithmic


def draw_lens(viewpoint: Viewpoint, ui_scale: float) -> None:
    """Field of view, near plane, speed of flight, parallel rays, what drags turn about."""
    camera = viewpoint.camera
    if not subsection("Lens and speed", camera.parallel or camera.near_m > 0):
        return
    imgui.push_item_width(-1)
    degrees = math.degrees(camera.fov_y)
    moved, degrees = labelled_slider("fov", degrees, *FOV_DEGREES, "field of view: %.0f\u00b0")
    tip("Degrees from top to bottom. A narrow one flattens, a wide one shows more.", ui_scale)
    if moved:
        viewpoint.leave_camera()
        camera.fov_y = math.radians(degrees)
    least, most = NEAREST_RADII * camera.radius, FARTHEST_RADII * camera.radius
    moved, near = labelled_slider(
        "near", max(camera.near_m, least), least, most,
        "nothing nearer than %.3g m" if camera.near_m > least else "near plane: as usual",
        LOGARITHMIC,
    )  # fmt: skip
    tip("What is nearer to the eye is left out, to look inside. At the left end none is.", ui_scale)
    if moved:
        camera.near_m = near if near > least else 0.0
    moved, speed = labelled_slider("speed", camera.speed, *SPEEDS, "speed: %.2g x", LOGARITHMIC)
    tip("Of flight with W A S D Q E, and of a gamepad's stick. Shift is faster.", ui_scale)
    if moved:
        camera.speed = speed
    changed, parallel = imgui.checkbox(item_label("orthographic"), camera.parallel)
    tip("Parallel rays: what is farther is not smaller. Numpad 5; not in flight.", ui_scale)
    if changed and parallel != camera.parallel:
        viewpoint.toggle_orthographic()
    label = item_label("turn about what is pressed")
    _, camera.about_pointer = imgui.checkbox(label, camera.about_pointer)
    tip("A drag turns about the place under the mouse, which stays there.", ui_scale)
    imgui.pop_item_width()


def draw_named_views(state: EditorState, viewpoint: Viewpoint, ui_scale: float) -> None:
    """Views of the scene by their names: go there, rename, take out, open the scene with one; add
    that of now.
    """
    if not state.scene.objects:
        return
    side = imgui.get_frame_height()
    if imgui.button(item_label("+ View"), Vec(-side - imgui.get_style().item_spacing.x, 0)):
        _edit(state, lambda file: edits.keep_view(file, viewpoint.stated()), "add a view")
    tip("The view of now under a name, in the scene file once it is saved.", ui_scale)
    imgui.same_line()
    if symbol_button("star of now", STAR, side, False):
        begin_with(state, viewpoint.stated())
    tip("The scene opens with the view of now, once it is saved.", ui_scale)
    for named in state.edited.file.views:
        imgui.push_id(named.name)
        _row(state, viewpoint, named, ui_scale)
        imgui.pop_id()


def begin_with(state: EditorState, view: FirstView) -> None:
    """The scene opens with a view."""
    _edit(state, lambda file: edits.look_from(file, view), "first look")
    state.say(said("The scene opens with this view, once it is saved."))


def _row(state: EditorState, viewpoint: Viewpoint, named: NamedView, ui_scale: float) -> None:
    """The name, which can be typed, between going there, the star, and taking it out."""
    side = imgui.get_frame_height()
    if imgui.arrow_button("go", imgui.Dir.right):
        viewpoint.go_to(named.view)
    tip(said("Goes to {name}.", name=named.name), ui_scale)
    imgui.same_line()
    gap = imgui.get_style().item_spacing.x
    imgui.set_next_item_width(imgui.get_content_region_avail().x - 2 * (side + gap))
    entered = imgui.InputTextFlags_.enter_returns_true
    changed, text = imgui.input_text("##name", named.name, entered)
    tip("Its name; Enter takes it over.", ui_scale)
    if changed and text != named.name:
        what = f"rename {named.name}"
        _edit(state, lambda file: edits.rename_view(file, named.name, text), what)
    imgui.same_line()
    if symbol_button(f"star {named.name}", STAR, side, named.view == state.edited.file.view):
        begin_with(state, named.view)
    tip(said("The scene opens with {name}, once it is saved.", name=named.name), ui_scale)
    imgui.same_line()
    if imgui.button("\u00d7", Vec(-1, 0)):
        _edit(state, lambda file: edits.remove_view(file, named.name), f"take out {named.name}")
    tip(said("Takes out {name}; Ctrl+Z brings it back.", name=named.name), ui_scale)


def _edit(state: EditorState, change: Callable[[SceneFile], SceneFile], what: str) -> None:
    """Does an edit of the scene file; where it cannot be done, says why."""
    try:
        edit(state, change(state.edited.file), what)
    except ValueError as error:  # BadFile is one
        state.messages.fail(str(error))


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
    """Views from all sides, the scene's own, cameras of a file, the lens."""
    steps = viewpoint.steps
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
    draw_named_views(state, viewpoint, ui_scale)
    if steps.count:
        imgui.text_disabled(steps.text)
        clicked = button_row(STEPS, ui_scale, 2)
        if clicked:
            viewpoint.step_to_camera(1 if clicked == "Next" else -1)
    draw_lens(viewpoint, ui_scale)


def draw_kept_views(viewpoint: Viewpoint, ui_scale: float) -> None:
    """The panel's section "Cameras": views in a file for other programs."""
    kept = viewpoint.kept
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
