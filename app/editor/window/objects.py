"""What a person does to the objects of the scene that is open: choose, edit, undo, save."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import glfw
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.sections.objects_panel import draw_objects
from shapeshift.app.editor.state.arrange import (
    as_it_stands,
    copy_offset,
    edit,
    record_regions,
    redo,
    undo,
)
from shapeshift.app.editor.state.files.saving import Saving, unsaved
from shapeshift.app.editor.window.adding import Adding
from shapeshift.app.editor.window.gizmo import Gizmo, attach_gizmo
from shapeshift.app.editor.window.hands import point_at
from shapeshift.app.editor.window.hooks import Section
from shapeshift.app.editor.window.window import (
    CLICK_PIXELS,
    Drag,
    Drop,
    Event,
    KeyDown,
    Press,
    Release,
)
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.framing import model_points
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from shapeshift.scene.pose import Pose

if TYPE_CHECKING:
    from shapeshift.app.editor.state.editor_state import EditorState
    from shapeshift.app.editor.window.viewer import Viewer

KEYS = (
    ("click", "choose a thing"),
    ("M", "handles: move, turn, none"),
    ("Ctrl+D, Delete", "copy, delete the chosen one"),
)


def attach_objects(viewer: "Viewer") -> "Objects":
    """Adds the section, its keys, clicks and boxes to a viewer."""
    objects = Objects(viewer)
    hooks = viewer.hooks
    hooks.takes.append(objects.take)
    hooks.each_frame.append(objects.each_frame)
    hooks.marks.append(objects.draw_boxes)
    hooks.status.append(objects.status)
    hooks.opened.append(objects.forget)
    hooks.closing.append(objects.may_close)
    hooks.sections.append(
        Section(
            "Objects",
            lambda s: draw_objects(objects, s),
            opens=objects.opens,
            early=lambda: len(objects.state.scene.objects) > 1,
        )
    )
    hooks.keys["Objects"] = list(KEYS)
    return objects


class Objects:
    """What a person does to the objects of the scene that is open."""

    def __init__(self, viewer: "Viewer") -> None:
        self.viewer = viewer
        self.saving = Saving(viewer, viewer.own_files)
        self.gizmo: Gizmo = attach_gizmo(viewer)
        self.adding = Adding(viewer, self._count_changed)
        self._click: tuple[float, float] | None = None  # where a press was that may be a click
        self.typed: tuple[str, str] = ("", "")  # the chosen object, and its name as it is typed
        self._opened = True  # another scene is there, and the section has not unfolded for it
        self._leaving = False  # the window may be closed, whatever is unsaved
        self._title = ("", False)  # what the window's title says: a name, something is unsaved

    @property
    def state(self) -> "EditorState":
        return self.viewer.state

    @property
    def unsaved(self) -> bool:
        return unsaved(self.state)

    def forget(self) -> None:
        """Another scene: nothing of the old one is asked or typed."""
        self._opened, self._click, self.typed = True, None, ("", "")
        self.gizmo.holding = False

    def opens(self) -> bool:
        """True once for a scene of several things: the section unfolds for it."""
        opened, self._opened = self._opened, False
        several = len(self.state.scene.objects) > 1
        return opened and (several or self.state.document.path is not None)

    def may_close(self) -> bool:
        """Whether the window may be closed now; else it is asked what to do with the changes."""
        if self._leaving or not self.unsaved or self.viewer.options.screenshot is not None:
            return True
        self.saving.before_losing(self._leave)
        return False

    def _leave(self) -> None:
        self._leaving = True
        self.viewer.window.close()

    def status(self) -> str:
        return "not saved" if self.unsaved else ""

    # ---- input

    def take(self, event: Event) -> bool:
        """True for shortcuts, for a click that chooses, and for what is dropped to be added."""
        if isinstance(event, KeyDown) and (self.saving.asking or self.adding.asking):
            return True  # a box is open, and keys are for it
        match event:
            case KeyDown(shortcut="z", shift=False):
                self.undo()
            case KeyDown(shortcut="y") | KeyDown(shortcut="z"):
                self.redo()
            case KeyDown(shortcut="s", shift=True):
                self.saving.ask_name()
            case KeyDown(shortcut="s"):
                self.saving.save()
            case KeyDown(shortcut="d"):
                self.duplicate()
            case KeyDown(key=glfw.KEY_DELETE) if self.state.chosen:
                self.delete()
            case KeyDown(key=glfw.KEY_ESCAPE) if self.state.chosen:
                self.state.chosen = ""
                return False  # regions want it, too
            case Drop() if self.adding.asking:
                self.adding.begin(event.paths)
            case Press() | Drag() | Release():
                self._see_click(event)
                return False
            case _:
                return False
        return True

    def _see_click(self, event: Press | Drag | Release) -> None:
        """A press and a release in one place choose what is there; the camera takes drags."""
        placing = self.state.regions.placing or self.viewer.window.held(glfw.KEY_B)
        match event:
            case Press(button="left") if not placing:
                self._click = (event.x, event.y)
            case Press():
                self._click = None
            case Drag() if self._click is not None:
                x, y = self._click
                if abs(event.x - x) + abs(event.y - y) > CLICK_PIXELS:
                    self._click = None
            case Release(button="left") if self._click is not None:
                (x, y), self._click = self._click, None
                self.choose_at(x, y)

    def choose_at(self, x: float, y: float) -> None:
        """Chooses what lies there, logical pixels; of a single object nothing is asked."""
        things = self.state.scene.objects
        if len(things) < 2:
            return
        hit = point_at(self.viewer, x, y)
        self.state.chosen = things[hit.index].name if hit is not None else ""

    def each_frame(self) -> bool:
        """The end of a drag, the title, what is being read; True while that goes on."""
        record_regions(self.state)
        if not imgui.is_mouse_down(0):
            self.state.rest()
        title = (self.state.title, self.unsaved)
        if title != self._title:
            self._title = title
            self.viewer.set_title()
        return self.adding.poll()

    # ---- edits

    def edit(
        self, change: Callable[..., SceneFile], *values: object, what: str, together: str = ""
    ) -> bool:
        """Does an edit of scene/document/edits.py; where it cannot be done False, and says why."""
        state = self.state
        try:
            edit(state, change(state.document.file, *values), what, together)
        except ValueError as error:  # BadFile is one
            self.viewer.messages.fail(str(error))
            return False
        return True

    def change(self, item: SceneItem, what: str, together: str = "", **values: object) -> bool:
        """Other values of an object's fields."""
        return self.edit(
            lambda file: edits.change(file, item.name, **values), what=what, together=together
        )

    def keep_standing(self) -> None:
        """Where everything is now, and its x, is where it starts."""
        self.edit(lambda file: as_it_stands(self.state), what="keep as it stands")

    def duplicate(self) -> None:
        """A copy beside the chosen object, which is chosen then."""
        state, name = self.state, self.state.chosen
        index = state.chosen_index
        if index is None:
            return
        thing = state.scene.objects[index]
        by = copy_offset(thing, model_points(thing.model)[0])
        known = {item.name for item in state.document.file.all_items}
        pose = thing.world_from_object

        def beside(file: SceneFile) -> SceneFile:
            """The copy stands by what is seen, wherever that may have gone since the start."""
            file = edits.duplicate(file, name, by)
            copy = next(item.name for item in file.items if item.name not in known)
            file = edits.place(file, copy, Pose(pose.position + by, pose.wxyz))
            return edits.set_x(file, copy, thing.x)

        if self.edit(beside, what=f"copy {name}"):
            state.chosen = next(i.name for i in state.document.file.items if i.name not in known)
            self._count_changed()

    def delete(self) -> None:
        if self.state.chosen_index is not None:
            name = self.state.chosen
            if self.edit(edits.remove, name, what=f"delete {name}"):
                self._count_changed()

    def undo(self) -> None:
        self._step(undo, "Undone")

    def redo(self) -> None:
        self._step(redo, "Done again")

    def _step(self, step: Callable, word: str) -> None:
        count = len(self.state.scene.objects)
        try:
            what = step(self.state)
        except BadFile as error:
            self.viewer.say(str(error))
            return
        self.viewer.say(f"{word}: {what}" if what else f"Nothing to be {word.lower()}")
        if len(self.state.scene.objects) != count:
            self._count_changed()

    def _count_changed(self) -> None:
        """What was measured for the budget was measured on other splats."""
        dial = self.viewer.dial
        dial.wanted = dial.wanted or dial.measuring or dial.choice is not None
        dial.forget()

    def look_from_here(self) -> None:
        """The view of now, about the point that it turns around, is where the scene opens."""
        viewer = self.viewer
        view = viewer.plain_view()
        eye = view.world_from_eye.position
        ahead = -view.world_from_eye.matrix()[:3, 2]
        far = float(np.dot(self.state.centre - eye, ahead))
        target = eye + ahead * max(far, 0.1 * self.state.radius)
        fov_y = float(np.arctan(view.tangents[3]) - np.arctan(view.tangents[2]))
        if self.edit(edits.look_from, eye, target, fov_y, what="first look"):
            viewer.say("The scene opens with this view, once it is saved.")

    def draw_boxes(self, ui_scale: float) -> None:
        """The boxes that ask for a name, before something is lost, for what to add."""
        self.saving.draw(ui_scale)
        self.adding.draw(ui_scale)
