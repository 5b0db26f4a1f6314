"""The panel's section "Objects": the list, what is edited of the chosen one, undo, redo, save."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import glfw
import numpy as np
from imgui_bundle import imgui

from app import theme
from app.adding import Adding
from app.arrange import copy_offset, edit, keep_standing, place, redo, undo
from app.gizmo import MOVE, TURN, Gizmo, attach_gizmo
from app.hands import point_at
from app.panel_rows import button_row, choice, number, right_aligned, slider, tip
from app.saving import Saving, unsaved
from app.sections import Section
from app.window import CLICK_PIXELS, Drag, Drop, Event, KeyDown, Press, Release
from runtime_models.model import BadFile
from scene import edits
from scene.framing import model_points
from scene.pose import Pose
from scene.scene_file import BACKGROUND, FAR_M, HULLS, SceneFile, SceneItem

if TYPE_CHECKING:
    from app.desktop import Viewer

Vec = imgui.ImVec2
MOST_ROWS = 8  # of the list that are seen at once
MASSES = (0.05, 5.0)  # kilograms, between which the physics holds them
NONE = "none"  # as a collider
KEYS = (
    ("click", "choose a thing"),
    ("Ctrl+Z, Ctrl+Y", "undo, redo an edit"),
    ("Ctrl+D, Delete", "copy, delete the chosen one"),
    ("Ctrl+S", "save the scene; Shift: as"),
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
    hooks.sections.append(Section("Objects", objects.draw, above=True, opens=objects.opens))
    hooks.keys += KEYS
    return objects


class Objects:
    """What a person does to the objects of the scene that is open."""

    def __init__(self, viewer: "Viewer") -> None:
        self.viewer = viewer
        self.saving = Saving(viewer)
        self.gizmo: Gizmo = attach_gizmo(viewer)
        self.adding = Adding(viewer, self._count_changed)
        self._click: tuple[float, float] | None = None  # where a press was that may be a click
        self._name: tuple[str, str] = ("", "")  # the chosen object, and its name as it is typed
        self._opened = True  # another scene is there, and the section has not unfolded for it
        self._leaving = False  # the window may be closed, whatever is unsaved
        self._title = ("", False)  # what the window's title says: a name, something is unsaved

    @property
    def stage(self):
        return self.viewer.stage

    @property
    def unsaved(self) -> bool:
        return unsaved(self.stage)

    def forget(self) -> None:
        """Another scene: nothing of the old one is asked or typed."""
        self._opened, self._click, self._name = True, None, ("", "")
        self.gizmo.holding = False

    def opens(self) -> bool:
        """True once for a scene of several things: the section unfolds for it."""
        opened, self._opened = self._opened, False
        several = len(self.stage.scene.objects) > 1
        return opened and (several or self.stage.document.path is not None)

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
        document = self.stage.document
        return "not saved" if document.path and (document.edited or self.unsaved) else ""

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
            case KeyDown(key=glfw.KEY_DELETE) if self.stage.chosen:
                self.delete()
            case KeyDown(key=glfw.KEY_ESCAPE) if self.stage.chosen:
                self.stage.chosen = ""
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
        placing = self.stage.regions.placing or self.viewer.window.held(glfw.KEY_B)
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
        things = self.stage.scene.objects
        if len(things) < 2:
            return
        hit = point_at(self.viewer, x, y)
        self.stage.chosen = things[hit.index].name if hit is not None else ""

    def each_frame(self) -> bool:
        """The end of a drag, the title, what is being read; True while that goes on."""
        if not imgui.is_mouse_down(0):
            self.stage.rest()
        title = (self.stage.title, self.unsaved)
        if title != self._title:
            self._title = title
            self.viewer.set_title()
        return self.adding.poll()

    # ---- edits

    def edit(self, change: Callable[..., SceneFile], *values: object, what: str) -> bool:
        """Does an edit of scene/edits.py; False, and a word on it, where it cannot be done."""
        stage = self.stage
        try:
            edit(stage, change(stage.document.file, *values), what)
        except ValueError as error:  # BadFile is one
            self.viewer.say(str(error))
            return False
        return True

    def duplicate(self) -> None:
        """A copy beside the chosen object, which is chosen then."""
        stage, name = self.stage, self.stage.chosen
        index = stage.chosen_index
        if index is None:
            return
        thing = stage.scene.objects[index]
        by = copy_offset(thing, model_points(thing.model)[0])
        known = {item.name for item in stage.document.file.all_items}
        if self.edit(edits.duplicate, name, by, what=f"copy {name}"):
            stage.chosen = next(i.name for i in stage.document.file.items if i.name not in known)
            self._count_changed()

    def delete(self) -> None:
        if self.stage.chosen_index is not None:
            name = self.stage.chosen
            if self.edit(edits.remove, name, what=f"delete {name}"):
                self._count_changed()

    def undo(self) -> None:
        self._step(undo, "Undone")

    def redo(self) -> None:
        self._step(redo, "Done again")

    def _step(self, step: Callable, word: str) -> None:
        count = len(self.stage.scene.objects)
        try:
            what = step(self.stage)
        except BadFile as error:
            self.viewer.say(str(error))
            return
        self.viewer.say(f"{word}: {what}" if what else f"Nothing to be {word.lower()}")
        if len(self.stage.scene.objects) != count:
            self._count_changed()

    def _count_changed(self) -> None:
        """What was measured for the budget was measured on other splats."""
        dial = self.viewer.dial
        dial.wanted = dial.wanted or dial.measuring or dial.choice is not None
        dial.forget()

    # ---- the panel

    def draw(self, ui_scale: float) -> None:
        history = self.stage.document.history
        row = (("Undo", history.undoes, self.undo), ("Redo", history.redoes, self.redo))
        width = (imgui.get_content_region_avail().x - 2 * imgui.get_style().item_spacing.x) / 3
        for word, what, act in row:
            imgui.begin_disabled(not what)
            if imgui.button(word, Vec(width, 0)):
                act()
            imgui.end_disabled()
            tip(what or f"Nothing to {word.lower()}.", ui_scale)
            imgui.same_line()
        if imgui.button("Save\u2026" if self.stage.document.path is None else "Save", Vec(-1, 0)):
            self.saving.save()
        tip("Ctrl+S writes the scene file; Ctrl+Shift+S asks for another name.", ui_scale)
        self._list(ui_scale)
        clicked = button_row(("Add", "Copy", "Delete"), ui_scale, 3)
        if clicked:
            {"Add": self.adding.ask, "Copy": self.duplicate, "Delete": self.delete}[clicked]()
        if self.stage.chosen_index is not None:
            imgui.push_item_width(-1)
            self._chosen(self.stage.document.file, ui_scale)
            imgui.pop_item_width()
        if self.stage.world is not None and stands_elsewhere(self.stage):
            if imgui.button("Keep as it stands", Vec(-1, 0)):
                keep_standing(self.stage)
            tip("Where everything is now, and its x, becomes where it starts.", ui_scale)

    def _list(self, ui_scale: float) -> None:
        """A line an object: seen or not, its name, its x."""
        things = self.stage.scene.objects
        line = imgui.get_frame_height_with_spacing()
        long = len(things) > MOST_ROWS
        if long:
            imgui.begin_child("list", Vec(0, MOST_ROWS * line))
        for index, thing in enumerate(things):
            imgui.push_id(index)
            changed, seen = imgui.checkbox("##seen", thing.visible)
            tip("Seen or hidden; a hidden thing is touched as before.", ui_scale)
            if changed:
                word = "show" if seen else "hide"
                self.edit(edits.hide, thing.name, not seen, what=f"{word} {thing.name}")
            imgui.same_line()
            chosen = thing.name == self.stage.chosen
            ink = theme.ACCENT if chosen else theme.TEXT if thing.visible else theme.MUTED
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*ink, 1))
            width = imgui.get_content_region_avail().x - 56 * ui_scale
            if imgui.selectable(thing.name, chosen, 0, Vec(width, 0))[0]:
                self.stage.chosen = "" if chosen else thing.name
            imgui.pop_style_color()
            tip(f"{thing.name}: {number(thing.model.splat_count)} splats", ui_scale)
            imgui.same_line()
            right_aligned(f"x {thing.x:.2f}")
            imgui.pop_id()
        if long:
            imgui.end_child()

    def _chosen(self, file: SceneFile, ui_scale: float) -> None:
        """Name, handles, place and body of the chosen object."""
        item = edits.find(file, self.stage.chosen)
        if item is None:
            return
        imgui.push_id(item.name)
        if item.name != BACKGROUND:
            self._rename(item)
        modes = {MOVE: "Move", TURN: "Turn"}
        for mode, word in modes.items():
            lit = self.gizmo.mode == mode
            if lit:
                imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.ACCENT, 1))
            gap = imgui.get_style().item_spacing.x
            room = imgui.get_content_region_avail().x
            if imgui.button(word, Vec((room - gap) / 2 if mode == MOVE else -1, 0)):
                self.gizmo.mode = "" if lit else mode
            if lit:
                imgui.pop_style_color()
            tip("Handles on the thing in the picture. Key M.", ui_scale)
            if mode == MOVE:
                imgui.same_line()
        self._place()
        self._body(item, ui_scale)
        imgui.pop_id()

    def _rename(self, item: SceneItem) -> None:
        """The name, taken over by Enter or by leaving the field."""
        if self._name[0] != item.name:
            before, typed = self._name
            self._name = (item.name, item.name)
            if typed != before and edits.find(self.stage.document.file, before) is not None:
                self.edit(edits.rename, before, typed, what=f"rename {before}")
        _, text = imgui.input_text("##name", self._name[1])
        self._name = (item.name, text)
        if imgui.is_item_deactivated_after_edit():
            if not self.edit(edits.rename, item.name, text, what=f"rename {item.name}"):
                self._name = ("", "")  # the old name again

    def _place(self) -> None:
        """Metres, as numbers; a double click types them."""
        index = self.stage.chosen_index
        pose = self.stage.scene.objects[index].world_from_object
        speed = 0.002 * self.stage.radius
        values = [float(metres) for metres in pose.position]
        moved, values = imgui.drag_float3("##place", values, speed, -FAR_M, FAR_M, "%.3f m")
        if moved and np.isfinite(values).all():
            values = np.clip(np.array(values, np.float64), -FAR_M, FAR_M)
            place(self.stage, index, Pose(values, pose.wxyz))

    def _body(self, item: SceneItem, ui_scale: float) -> None:
        """Whether it can be touched, whether it moves, how heavy it is."""
        mesh = item.collider if item.collider not in (None, HULLS) else None
        kinds = [NONE, HULLS] + [mesh] * (mesh is not None)
        names = ["cannot be touched", "touched: its splats", f"touched: {mesh}"][: len(kinds)]
        now = item.collider or NONE
        chosen = choice("collider", now, kinds, names)
        if chosen != now:
            collider = None if chosen == NONE else chosen
            self._change(item, "body of", collider=collider)
        if item.collider is None or item.name == BACKGROUND:
            return
        changed, moves = imgui.checkbox("moves", not item.static)
        if changed:
            self._change(item, "body of", static=not moves)
        tip("What does not move is touched all the same: a table, a wall.", ui_scale)
        if not item.static:
            mass = slider("mass", item.mass_kg, *MASSES, "mass: %.2f kg")
            if mass != item.mass_kg:
                self._change(item, "mass of", together=f"mass {item.name}", mass_kg=mass)

    def _change(self, item: SceneItem, what: str, together: str = "", **values: object) -> None:
        stage = self.stage
        try:
            file = edits.change(stage.document.file, item.name, **values)
            edit(stage, file, f"{what} {item.name}", together)
        except ValueError as error:
            self.viewer.say(str(error))

    def draw_boxes(self, ui_scale: float) -> None:
        """The boxes that ask for a name, before something is lost, for what to add."""
        if not self.stage.problem:  # which has a box of its own
            self.saving.draw(ui_scale)
            self.adding.draw(ui_scale)


def stands_elsewhere(stage) -> bool:
    """Whether anything is not where it starts, or at another x."""
    items = {item.name: item for item in stage.document.file.all_items}
    for thing in stage.scene.objects:
        item, pose = items[thing.name], thing.world_from_object
        if thing.x != item.x or not np.allclose(pose.position, item.position, atol=1e-5):
            return True
        if abs(np.dot(pose.wxyz, item.pose.wxyz)) < 1 - 1e-6:
            return True
    return False
