"""What a person does to the objects of the scene by keys and clicks: choose, edit, undo, save."""

from collections.abc import Callable, Sequence
from pathlib import Path

import glfw
from imgui_bundle import imgui

from shapeshift.app.camera_files import camera_reading
from shapeshift.app.editor.panels.widgets.boxes import PathBox, answer_row, question_box
from shapeshift.app.editor.state.arrange import edit, undo
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import OpenedFiles, Opener, Progress, read_files
from shapeshift.app.editor.state.files.saving import LOSE, Saving, unsaved, what_is_lost
from shapeshift.app.editor.state.object_edits import ObjectEdits
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.files import poll_opener
from shapeshift.app.editor.window.hands import InputActions
from shapeshift.app.editor.window.recovering import Recovering
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
from shapeshift.app.opening import ReadingOptions, open_model
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import is_scene_file
from shapeshift.scene.scene import Scene

# Adding an object to the scene that is open: the box that takes a path or a dropped file.


class Adding:
    """The box, and the reading that may be under way."""

    def __init__(
        self, state: EditorState, options: ReadingOptions, upload: Callable[[Scene], None],
        added: Callable[[], None], recent: Callable[[], Sequence[Path]],
    ) -> None:  # fmt: skip
        """`upload` gives a scene to the device and raises BadFile where it does not fit."""
        self._state, self._options = state, options
        self._upload, self._added, self._recent = upload, added, recent
        self._opener = Opener()
        self._box = PathBox("Add to the scene", "Add")

    @property
    def asking(self) -> bool:
        return self._box.asking

    def ask(self) -> None:
        self._box.ask()

    def begin(self, paths: tuple[Path, ...]) -> None:
        """Reads files and adds them when all are there."""
        self._box.close()
        options = self._options

        def read(paths: tuple[Path, ...], progress: Progress) -> OpenedFiles:
            return read_files(
                paths,
                lambda path, progress: open_model(path, options, progress),  # finest level at once
                camera_reading(options),
                progress,
                options.reading(),
                beside=False,
            )

        self._opener.start(paths, read)
        self._state.say(self._opener.note)

    def poll(self) -> bool:
        """Takes over what has been read; True while something is being read or looked for."""
        return poll_opener(self._state, self._opener, self.add_opened) or self._box.browsing

    def add_opened(self, found: OpenedFiles) -> None:
        """One object more of each source; a scene that the device cannot hold stays without."""
        state = self._state
        if found.path is not None:
            state.problem = said(
                "{name} is a scene file: open it instead, or add its models one by one.",
                name=found.path.name,
            )
            return
        if not found.sources:
            state.problem = said("A file of cameras is no object; drop it on the window itself.")
            return
        file = state.edited.file
        for source in found.sources:
            item = state.edited.item(source)
            file = edits.add(file, item)
        try:
            edit(state, file, f"add {file.items[-1].name}")
        except (BadFile, ValueError) as error:
            state.problem = str(error)
            return
        try:
            self._upload(state.scene)
        except BadFile as error:
            undo(state)
            state.problem = str(error)
            return
        state.chosen = file.items[-1].name
        self._added()

    def draw(self, ui_scale: float) -> None:
        """The box: a path, a recent file, or something that is dropped meanwhile."""
        paths = [path for path in self._recent() if not is_scene_file(path)]
        if chosen := self._box.draw(paths, ui_scale):
            self.begin(chosen)


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
        recovering: Recovering,
    ) -> None:
        self._window, self._hands = window, hands
        self.state, self.edits = edits.state, edits
        self.saving, self.adding, self.recovering = saving, adding, recovering
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

    def asked(self) -> tuple:
        """What boxes ask; another value is drawn at once."""
        saving = self.saving
        waits = saving.then is not None
        return saving.name, saving.taken, waits, self.adding.asking, self.recovering.asked()

    def status(self) -> str:
        words = [said("not saved")] * self.unsaved + [self.recovering.status()]
        return ", ".join(filter(None, words))

    def handle_event(self, event: Event) -> bool:
        """True for shortcuts, for a click that chooses, and for what is dropped to be added."""
        asks = self.saving.asking or self.adding.asking or self.recovering.asked()
        if isinstance(event, KeyDown) and asks:
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
        return self.recovering.each_frame() | self.adding.poll()

    def draw_boxes(self, ui_scale: float) -> None:
        """The boxes that ask for a name, before something is lost, for what to add."""
        draw_saving(self.saving, self.state, ui_scale)
        if not self.saving.asking:
            self.recovering.draw(ui_scale)
        self.adding.draw(ui_scale)


# The two boxes about saving: one asks for a name, one before something is lost.

OVER = "Over it"  # writes over the file that was opened
SAVE, UNSAVED = "Save the scene", "Changes are not saved"


def draw_saving(saving: Saving, state: EditorState, ui_scale: float) -> None:
    """Whichever box is open."""
    if saving.name:
        if question_box(SAVE, ui_scale):
            _draw_name(saving, ui_scale)
            imgui.end_popup()
    elif saving.then is not None and question_box(UNSAVED, ui_scale):
        _draw_lose(saving, state, ui_scale)
        imgui.end_popup()


def _draw_name(saving: Saving, ui_scale: float) -> None:
    imgui.push_item_width(-1)
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    flags = imgui.InputTextFlags_.enter_returns_true
    entered, name = imgui.input_text("##path", saving.name, flags)
    imgui.pop_item_width()
    saving.retype(name)
    if saving.taken:
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(said("{name} is there already.", name=Path(saving.name).name))
        imgui.pop_text_wrap_pos()
    label, original = "Replace it" if saving.taken else "Save", saving.original
    words: tuple[str, ...] = (label, "Cancel")
    if original is not None and not saving.taken:
        imgui.text_disabled(said("{name} was not written by you here.", name=original.name))
        words = (label, OVER, "Cancel")
    clicked = answer_row(words, ui_scale)
    if clicked == label or (entered and not saving.taken):
        saving.named(saving.name, replace=saving.taken)
    elif clicked == OVER:
        saving.ask_over()
    elif clicked == "Cancel":
        saving.cancel_name()
    if not saving.name:
        imgui.close_current_popup()


def _draw_lose(saving: Saving, state: EditorState, ui_scale: float) -> None:
    imgui.push_text_wrap_pos(0)
    name = state.edited.name
    imgui.text_unformatted(said("{name} has changes that are not saved.", name=name))
    for line in what_is_lost(state):
        imgui.text_unformatted(line)
    imgui.pop_text_wrap_pos()
    clicked = answer_row(("Save", LOSE, "Cancel"), ui_scale)
    if clicked:
        imgui.close_current_popup()
        saving.answer(clicked)
