"""What a person does to the objects of the scene by keys and clicks: choose, edit, undo, save."""

import glfw
from imgui_bundle import imgui

from shapeshift.app.editor.panels.save_boxes import draw_saving
from shapeshift.app.editor.state.files.saving import Saving, unsaved
from shapeshift.app.editor.state.object_edits import ObjectEdits
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.adding import Adding
from shapeshift.app.editor.window.hands import InputActions
from shapeshift.app.editor.window.window import (
    CLICK_PIXELS,
    Drag,
    Drop,
    Event,
    KeyDown,
    Press,
    Release,
    Window,
)

KEYS = (
    ("click", "choose an object"),
    ("M", "handles: move, turn, none"),
    ("Ctrl+D, Delete", "copy, delete the chosen one"),
)


class Objects:
    """What a person does to the objects of the scene that is open."""

    def __init__(
        self,
        window: Window,
        hands: InputActions,
        edits: ObjectEdits,
        saving: Saving,
        adding: Adding,
    ) -> None:
        self._window, self._hands = window, hands
        self.state, self.edits = edits.state, edits
        self.saving, self.adding = saving, adding
        self._click: tuple[float, float] | None = None  # where a press was that may be a click
        self._opened = True  # another scene is there, and the section has not unfolded for it
        self._leaving = False  # the window may be closed, whatever is unsaved

    @property
    def unsaved(self) -> bool:
        return unsaved(self.state)

    def forget(self) -> None:
        """Another scene: nothing of the old one is asked or typed."""
        self._opened, self._click, self.edits.typed = True, None, ("", "")

    def unfold(self) -> None:
        """There is an object more, whose name is to be seen."""
        self._opened = True

    def opens(self) -> bool:
        """True once for a scene of several objects: the section unfolds for it."""
        opened, self._opened = self._opened, False
        several = len(self.state.scene.objects) > 1
        return opened and (several or self.state.edited.path is not None)

    def may_close(self) -> bool:
        """Whether the window may be closed now; else it is asked what to do with the changes."""
        if self._leaving or not self.unsaved:
            return True
        self.saving.before_losing(self._leave)
        return False

    def _leave(self) -> None:
        self._leaving = True
        self._window.close()

    def status(self) -> str:
        return said("not saved") if self.unsaved else ""

    def handle_event(self, event: Event) -> bool:
        """True for shortcuts, for a click that chooses, and for what is dropped to be added."""
        if isinstance(event, KeyDown) and (self.saving.asking or self.adding.asking):
            return True  # a box is open, and keys are for it
        match event:
            case KeyDown(shortcut="z", shift=False):
                self.edits.undo()
            case KeyDown(shortcut="y") | KeyDown(shortcut="z"):
                self.edits.redo()
            case KeyDown(shortcut="s", shift=True):
                self.saving.ask_name()
            case KeyDown(shortcut="s"):
                self.saving.save()
            case KeyDown(shortcut="d"):
                self.edits.duplicate()
            case KeyDown(key=glfw.KEY_DELETE) if self.state.chosen:
                self.edits.delete()
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
        placing = self.state.regions.placing or self._window.held(glfw.KEY_B)
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
        objects = self.state.scene.objects
        if len(objects) < 2:
            return
        hit = self._hands.point_at(x, y)
        self.state.chosen = objects[hit.index].name if hit is not None else ""

    def each_frame(self) -> bool:
        """The end of a drag, what is being read; True while that goes on."""
        self.state.record_regions()
        if not imgui.is_mouse_down(0):
            self.state.rest()
        return self.adding.poll()

    def draw_boxes(self, ui_scale: float) -> None:
        """The boxes that ask for a name, before something is lost, for what to add."""
        draw_saving(self.saving, self.state.edited.name, ui_scale)
        self.adding.draw(ui_scale)
