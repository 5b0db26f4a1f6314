"""Saving the scene that is open, and asking before something is lost: the two boxes for that."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.question_box import answer_row, question_box
from shapeshift.app.editor.state.files.document import beside, stamp_of, with_regions
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.paths import is_bundled, plain
from shapeshift.scene.document.scene_file import ENDING, FAR_M, SceneFile
from shapeshift.scene.document.write_scene_file import write_scene_file

if TYPE_CHECKING:
    from shapeshift.app.editor.state.editor_state import EditorState
    from shapeshift.app.editor.window.viewer import Viewer

Vec = imgui.ImVec2
OVER = "Over it"  # writes over the file that was opened
SAVE, LOSE = "Save the scene", "Changes are not saved"
LONGEST_PATH = 1000


class Saving:
    """What is asked now, and what is done once it has been answered."""

    def __init__(self, viewer: "Viewer", own: OwnFiles) -> None:
        self._viewer, self._own = viewer, own
        self._name = ""  # as it is typed; "" = the box is not open
        self._taken = False  # a file of that name is there, and nobody has said to replace it
        self._then: Callable[[], None] | None = None  # what waits for an answer

    @property
    def asking(self) -> bool:
        return bool(self._name) or self._then is not None

    @property
    def in_place(self) -> bool:
        """Whether saving writes at once: over a file that this person has saved before."""
        document = self._viewer.state.document
        if document.path is None or is_bundled(document.path):
            return False
        return self._own.has(document.path, document.stamp)

    def save(self) -> bool:
        """Writes over what was saved before, else asks for a name; True when it did."""
        document = self._viewer.state.document
        if not self.in_place:
            self.ask_name()
            return False
        if document.stamp != stamp_of(document.path):  # somebody else has written it since
            self._name, self._taken = str(document.path), True
            return False
        return self.write(document.path)

    def ask_name(self) -> None:
        """Opens the box that asks for a name; nothing that is there is replaced unasked."""
        document = self._viewer.state.document
        folder = self._viewer.folders.scenes
        path = document.path if self.in_place else free_path(folder / document.name)
        self._name, self._taken = str(path.absolute()), False

    @property
    def original(self) -> Path | None:
        """The file that was opened and that somebody else has made, where it may be replaced."""
        path = self._viewer.state.document.path
        return None if path is None or self.in_place or is_bundled(path) else path

    def named(self, text: str, replace: bool = False) -> bool:
        """Saves under a name that was typed; a file that is there is asked about first."""
        path = plain(text.strip())
        if not path.name:
            return False
        if not path.name.lower().endswith(ENDING):
            path = path.with_name(path.name.removesuffix(".json") + ENDING)
        if is_bundled(path):
            sentence = f"{path.name} came with the program; choose another folder for yours."
            self._viewer.messages.fail(sentence)
            return False
        untouched = self._own.has(path, stamp_of(path)) and self._is_open(path)
        if path.exists() and not untouched and not replace:
            self._name, self._taken = str(path), True
            return False
        return self.write(path)

    def _is_open(self, path: Path) -> bool:
        document = self._viewer.state.document
        return document.path is not None and document.path.absolute() == path.absolute()

    def write(self, path: Path) -> bool:
        """Writes the file; what is wrong is said."""
        state = self._viewer.state
        document = state.document
        try:
            file = filed(document.file, state, path)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_scene_file(file, path)
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            state.problem = f"{path.name} cannot be saved: {reason}."
            return False
        self._name = ""
        path = path.absolute()
        document.path, document.stamp = path, stamp_of(path)
        try:
            self._own.wrote(path, document.stamp)
        except OSError as error:
            self._viewer.messages.fail(
                f"That this file is yours cannot be remembered: {error.strerror or error}."
            )
        document.saved, document.saved_regions = document.file, state.regions.kept
        self._viewer.files.remember(path)
        self._viewer.say(f"Saved {path}")
        self._go_on()
        return True

    def before_losing(self, then: Callable[[], None]) -> None:
        """Does it at once, or after a question where changes would be lost."""
        if unsaved(self._viewer.state):
            self._then = then
        else:
            then()

    def answer(self, word: str) -> None:
        """One of Save, Discard, Cancel."""
        if word == "Save":
            self.save()
        elif word == "Discard":
            self._go_on()
        else:
            self._then = None

    def _go_on(self) -> None:
        then, self._then = self._then, None
        if then is not None:
            then()

    def cancel_name(self) -> None:
        self._name, self._then = "", None

    # ---- the boxes

    def draw(self, ui_scale: float) -> None:
        """Whichever box is open."""
        if self._name:
            if question_box(SAVE, ui_scale):
                self._draw_name(ui_scale)
                imgui.end_popup()
        elif self._then is not None and question_box(LOSE, ui_scale):
            self._draw_lose(ui_scale)
            imgui.end_popup()

    def _draw_name(self, ui_scale: float) -> None:
        imgui.push_item_width(-1)
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, name = imgui.input_text("##path", self._name, flags)
        imgui.pop_item_width()
        if name != self._name:
            self._name, self._taken = name[:LONGEST_PATH] or " ", False
        if self._taken:
            imgui.push_text_wrap_pos(0)
            imgui.text_unformatted(f"{Path(self._name).name} is there already.")
            imgui.pop_text_wrap_pos()
        label, original = "Replace it" if self._taken else "Save", self.original
        words = (label, "Cancel")
        if original is not None and not self._taken:
            imgui.text_disabled(f"{original.name} was not written by you here.")
            words = (label, OVER, "Cancel")
        clicked = answer_row(words, ui_scale)
        if clicked == label or (entered and not self._taken):
            self.named(self._name, replace=self._taken)
        elif clicked == OVER:
            self._name, self._taken = str(original.absolute()), True  # asked once more
        elif clicked == "Cancel":
            self.cancel_name()
        if not self._name:
            imgui.close_current_popup()

    def _draw_lose(self, ui_scale: float) -> None:
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(
            f"{self._viewer.state.document.name} has changes that are not saved."
        )
        imgui.pop_text_wrap_pos()
        clicked = answer_row(("Save", "Discard", "Cancel"), ui_scale)
        if clicked:
            imgui.close_current_popup()
            self.answer(clicked)


def free_path(path: Path) -> Path:
    """The path, with the next free number where something is there."""
    stem, count = path.name.removesuffix(ENDING), 1
    while path.exists():
        count += 1
        path = path.with_name(f"{stem} {count}{ENDING}")
    return path


def unsaved(state: "EditorState") -> bool:
    """Whether something would be lost: edits, regions, paint; not a lens, nor where x stands."""
    return state.document.unsaved or state.regions.kept != state.document.saved_regions


def filed(file: SceneFile, state: "EditorState", path: Path) -> SceneFile:
    """What is written: with the regions, and with paths from the folder that it goes to.

    ValueError for what could not be read again.
    """
    for item in file.all_items:
        if not all(abs(metres) <= FAR_M for metres in item.position):
            raise ValueError(
                f"'{item.name}' stands farther than {FAR_M:g} m from the first; save them alone"
            )
        if "\\" in item.model:
            raise ValueError(f"a path with a backslash ({item.model}) is no path everywhere")
    view = state.first_view((640, 360))
    selectors = [state.regions.selectors(index, view) for index in range(len(file.all_items))]
    return beside(with_regions(file, selectors), path.parent)
