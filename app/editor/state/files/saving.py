"""Saving the scene that is open, and asking before something is lost."""

from collections.abc import Callable
from pathlib import Path

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import beside, stamp_of, with_regions
from shapeshift.app.editor.state.parts.write_pieces import with_written_pieces
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.editor.texts.table import said
from shapeshift.app.paths import is_bundled, plain
from shapeshift.scene.document.scene_file import ENDING, FAR_M, SceneFile
from shapeshift.scene.document.write_scene_file import write_scene_file

LONGEST_PATH = 1000  # letters


class Saving:
    """What is asked now, and what is done once it has been answered."""

    def __init__(
        self, state: EditorState, own: OwnFiles, folder: Path, remember: Callable[[Path], None]
    ) -> None:
        """`folder`: of scenes without a file; `remember` hears of every file that was written."""
        self._state, self._own, self._folder, self._remember = state, own, folder, remember
        self.name = ""  # as it is typed; "" = the box is not open
        self.taken = False  # a file of that name is there, and nobody has said to replace it
        self.then: Callable[[], None] | None = None  # what waits for an answer

    @property
    def asking(self) -> bool:
        return bool(self.name) or self.then is not None

    @property
    def in_place(self) -> bool:
        """Whether saving writes at once: over a file that this person has saved before."""
        edited = self._state.edited
        if edited.path is None or is_bundled(edited.path):
            return False
        return self._own.has(edited.path, edited.stamp)

    def save(self) -> bool:
        """Writes over what was saved before, else asks for a name; True when it did."""
        edited = self._state.edited
        if edited.path is None or not self.in_place:
            self.ask_name()
            return False
        if edited.stamp != stamp_of(edited.path):  # somebody else has written it since
            self.name, self.taken = str(edited.path), True
            return False
        return self.write(edited.path)

    def ask_name(self) -> None:
        """Opens the box that asks for a name; nothing that is there is replaced unasked."""
        edited = self._state.edited
        path = edited.path if self.in_place else None
        path = path or free_path(self._folder / edited.name)
        self.name, self.taken = str(path.absolute()), False

    @property
    def original(self) -> Path | None:
        """The file that was opened and that somebody else has made, where it may be replaced."""
        path = self._state.edited.path
        return None if path is None or self.in_place or is_bundled(path) else path

    def named(self, text: str, replace: bool = False) -> bool:
        """Saves under a name that was typed; a file that is there is asked about first."""
        path = plain(text.strip())
        if not path.name:
            return False
        if not path.name.lower().endswith(ENDING):
            path = path.with_name(path.name.removesuffix(".json") + ENDING)
        if is_bundled(path):
            self._state.messages.fail(
                said(
                    "{name} came with the program; choose another folder for yours.",
                    name=path.name,
                )
            )
            return False
        untouched = self._own.has(path, stamp_of(path)) and self._is_open(path)
        if path.exists() and not untouched and not replace:
            self.name, self.taken = str(path), True
            return False
        return self.write(path)

    def ask_over(self) -> None:
        """The file that was opened is meant: that is asked once more."""
        if self.original is not None:
            self.name, self.taken = str(self.original.absolute()), True

    def retype(self, text: str) -> None:
        """Another name is in the box, which stays open."""
        if text != self.name:
            self.name, self.taken = text[:LONGEST_PATH] or " ", False

    def _is_open(self, path: Path) -> bool:
        edited = self._state.edited
        return edited.path is not None and edited.path.absolute() == path.absolute()

    def write(self, path: Path) -> bool:
        """Writes the file; what is wrong is said."""
        state = self._state
        edited = state.edited
        try:
            pieces = with_written_pieces(edited, checked(edited.file), path.absolute())
            file = filed(pieces, state, path)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_scene_file(file, path)
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error).rstrip(".")
            state.problem = said("{name} cannot be saved: {why}.", name=path.name, why=reason)
            return False
        self.name = ""
        path = path.absolute()
        edited.path, edited.stamp = path, stamp_of(path)
        try:
            self._own.wrote(path, edited.stamp)
        except OSError as error:
            why = error.strerror or error
            self._state.messages.fail(
                said("That this file is yours cannot be remembered: {why}.", why=why)
            )
        edited.saved, edited.saved_regions = edited.file, state.regions.kept
        self._remember(path)
        self._state.say(said("Saved {path}", path=path))
        self._go_on()
        return True

    def before_losing(self, then: Callable[[], None]) -> None:
        """Does it at once, or after a question where changes would be lost."""
        if unsaved(self._state):
            self.then = then
        else:
            then()

    def answer(self, word: str) -> None:
        """One of Save, Discard, Cancel."""
        if word == "Save":
            self.save()
        elif word == "Discard":
            self._go_on()
        else:
            self.then = None

    def _go_on(self) -> None:
        then, self.then = self.then, None
        if then is not None:
            then()

    def cancel_name(self) -> None:
        self.name, self.then = "", None


def free_path(path: Path) -> Path:
    """The path, with the next free number where something is there."""
    stem, count = path.name.removesuffix(ENDING), 1
    while path.exists():
        count += 1
        path = path.with_name(f"{stem} {count}{ENDING}")
    return path


def unsaved(state: EditorState) -> bool:
    """Whether something would be lost: edits, regions, paint; not a lens, nor where x stands."""
    return state.edited.unsaved or state.regions.kept != state.edited.saved_regions


def checked(file: SceneFile) -> SceneFile:
    """The file; ValueError for what could not be read again."""
    for item in file.all_items:
        if not all(abs(metres) <= FAR_M for metres in item.position):
            raise ValueError(
                f"'{item.name}' stands farther than {FAR_M:g} m from the first; save them alone"
            )
        if "\\" in item.model:
            raise ValueError(f"a path with a backslash ({item.model}) is no path everywhere")
    return file


def filed(file: SceneFile, state: EditorState, path: Path) -> SceneFile:
    """What is written: with the regions, and with paths from the folder that it goes to."""
    view = state.first_view((640, 360))
    selectors = [state.regions.selectors(index, view) for index in range(len(file.all_items))]
    return beside(with_regions(file, selectors), path.parent)
