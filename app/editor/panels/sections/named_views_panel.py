"""Of the panel's section "Camera": its lens and its ways, and the scene's named views."""

import math
from collections.abc import Callable

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.panel_rows import (
    item_label,
    labelled_slider,
    subsection,
    tip,
)
from shapeshift.app.editor.state.arrange import edit
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import NamedView, SceneFile

Vec = imgui.ImVec2
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
    """Views of the scene by their names: go there, rename, take out; add that of now."""
    if not state.scene.objects:
        return
    for named in state.edited.file.views:
        imgui.push_id(named.name)
        _row(state, viewpoint, named, ui_scale)
        imgui.pop_id()
    gap, room = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
    if imgui.button(item_label("Add view"), Vec((room - gap) / 2, 0)):
        _edit(state, lambda file: edits.keep_view(file, viewpoint.stated()), "add a view")
    tip("The view of now under a name, in the scene file once it is saved.", ui_scale)
    imgui.same_line()
    if imgui.button(item_label("Start here"), Vec(-1, 0)):
        _edit(state, lambda file: edits.look_from(file, viewpoint.stated()), "first look")
        state.say(said("The scene opens with this view, once it is saved."))
    tip("The scene opens with the view of now, once it is saved.", ui_scale)


def _row(state: EditorState, viewpoint: Viewpoint, named: NamedView, ui_scale: float) -> None:
    """The name, which can be typed, between going there and taking it out."""
    side = imgui.get_frame_height()
    if imgui.arrow_button("go", imgui.Dir.right):
        viewpoint.go_to(named.view)
    tip(said("Goes to {name}.", name=named.name), ui_scale)
    imgui.same_line()
    imgui.set_next_item_width(imgui.get_content_region_avail().x - side - 8 * ui_scale)
    entered = imgui.InputTextFlags_.enter_returns_true
    changed, text = imgui.input_text("##name", named.name, entered)
    tip("Its name; Enter takes it over.", ui_scale)
    if changed and text != named.name:
        what = f"rename {named.name}"
        _edit(state, lambda file: edits.rename_view(file, named.name, text), what)
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
