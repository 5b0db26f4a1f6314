"""The panel's section "Camera": views from all sides, those of a file, and keeping views in one."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import button_row, choice, tip
from shapeshift.app.editor.state.camera.stepping import picture_box
from shapeshift.app.editor.window.hooks import Section
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraList, moved
from shapeshift.scene.cameras.write_cameras import COLMAP_FORMS, FORMS, write_cameras
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.app.editor.window.viewer import Viewer

Vec = imgui.ImVec2
SIDES = {
    "front": "From +Z. Numpad 1.",
    "right": "From +X. Numpad 3; Ctrl: the left side.",
    "top": "From above. Numpad 7; Ctrl: from below.",
    "back": "From -Z. Ctrl and numpad 1.",
}
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


class KeptViews:
    """The views that a person keeps; every one is written at once, into a file of this start."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._number = 0
        self.form = "ours"
        self.views: list[View] = []

    def keep(self, view: View) -> Path:
        """Adds a view; returns where all of them lie now.  Raises BadFile, OSError."""
        self._folder.mkdir(parents=True, exist_ok=True)
        if not self._number:
            taken = {path.name.split(".")[0] for path in self._folder.glob("views-*")}
            self._number = next(n for n in range(1, 10**6) if f"views-{n:04d}" not in taken)
        views = (*self.views, view)
        if self.form == "vr":  # a floor is one view: the last
            views = views[-1:]
        names = tuple(f"view {i + 1}" for i in range(len(views)))
        ending = "" if self.form in COLMAP_FORMS else f".{self.form}.json"
        path = self._folder / f"views-{self._number:04d}{ending}"
        write_cameras(CameraList(views, names, self.form), path, self.form)
        self.views.append(view)
        return path


def attach_cameras(viewer: "Viewer") -> None:
    """Adds the section, and what the status line says of cameras."""
    viewer.hooks.sections.append(
        Section("Camera", lambda scale: draw_cameras(viewer, scale), open_first=True)
    )
    viewer.hooks.status.append(lambda: viewer.steps.text)
    viewer.hooks.marks.append(lambda scale: draw_edges(viewer, scale))


def draw_edges(viewer: "Viewer", ui_scale: float) -> None:
    """Where the picture of the camera that is looked through ends."""
    steps, window = viewer.steps, viewer.window
    if not (viewer.overlay and steps.standing) or steps.moving:
        return
    box = picture_box(steps.cameras.views[steps.index], viewer.view())
    left, top, right, low = np.array(box) * window.logical_size[0] / window.size[0]
    imgui.get_background_draw_list().add_rect(
        Vec(left, top), Vec(right, low), theme.color(theme.MUTED, 0.6), 0, 0, max(1.0, ui_scale)
    )


def draw_cameras(viewer: "Viewer", ui_scale: float) -> None:
    steps, kept = viewer.steps, viewer.kept
    sides = {name.title(): what for name, what in SIDES.items()}
    if clicked := button_row(sides, ui_scale, len(sides)):
        viewer.leave_camera()
        viewer.camera.look_from(clicked.lower())
    moves = {
        "Frame all": "Everything into the picture. Key F.",
        "First view": "As it was opened. Shift+F.",
        "Orbit" if viewer.camera.flying else "Fly": "Key V; W A S D Q E move.",
    }
    if clicked := button_row(moves, ui_scale, len(moves)):
        viewer.leave_camera()
        move_camera(viewer, clicked)
    if steps.count:
        imgui.text_disabled(steps.text)
        clicked = button_row(STEPS, ui_scale, 2)
        if clicked:
            step_to_camera(viewer, 1 if clicked == "Next" else -1)
    gap, room = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
    if imgui.button("Keep view", Vec((room - gap) / 2, 0)):
        keep_view(viewer)
    tip(KEEP, ui_scale)
    imgui.same_line()
    imgui.push_item_width(-1)
    kept.form = choice("form", kept.form, FORMS, [f"as {FORM_NAMES[form]}" for form in FORMS])
    tip("What the file of kept views is written for.", ui_scale)
    imgui.pop_item_width()


def move_camera(viewer: "Viewer", word: str) -> None:
    """What a button of the section, or its key, does to the camera."""
    camera = viewer.camera
    if word == "Frame all":
        distance = viewer.state.fit(viewer.view(), camera.fov_y, viewer.free_size())
        camera.frame(viewer.state.centre, distance)
    elif word == "First view":
        camera.come_home(viewer.state.first_view(viewer.free_size()))
    else:
        camera.toggle_flying()


def step_to_camera(viewer: "Viewer", by: int) -> None:
    """To the next (1) or the previous (-1) camera, with a word on what its file leaves out."""
    steps = viewer.steps
    if not steps.step(by, viewer.view()):
        viewer.say("There are no cameras to step through; drop a file of them here.")
    elif steps.untold:
        viewer.say("\n".join(steps.untold))
        steps.untold = ()


def keep_view(viewer: "Viewer") -> None:
    """Writes the view of now, as it would be without the panel, behind those kept before."""
    view = viewer.plain_view()
    (view,) = moved([view], viewer.state.origin)
    try:
        path = viewer.kept.keep(view)
    except BadFile as error:
        viewer.messages.fail(str(error))
    except OSError as error:
        viewer.messages.fail(f"The view cannot be kept: {error.strerror}: {error.filename}")
    else:
        viewer.say(f"Kept in {path.absolute()}")
