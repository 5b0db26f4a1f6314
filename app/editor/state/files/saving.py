"""Saving the scene that is open, and asking before something is lost."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.beside import (
    beside_alone,
    due_beside,
    film_unsaved,
    origin_of_source,
    write_beside,
)
from shapeshift.app.editor.state.files.edited_file import beside, stamp_of, with_regions
from shapeshift.app.editor.state.parts.write_pieces import with_written_pieces
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.editor.texts.table import THE_SCENE, said
from shapeshift.app.paths import is_bundled, plain
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import ENDING, FAR_M, SceneFile
from shapeshift.scene.document.write_scene_file import scene_bytes

LONGEST_PATH = 1000  # letters
MOST_NAMES = 8  # of one kind of what would be lost
LOSE = "Do not save"


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
        self.refused: Callable[[], None] = lambda: None  # hears that nothing is to be saved
        # Hears what is about to be written, all of it:
        self.begins: Callable[[Mapping[Path, bytes]], None] = lambda files: None

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
        """Writes over what was saved before, else asks for a name; True when it did.

        Marks and a film alone go beside what was opened.
        """
        edited, state = self._state.edited, self._state
        if unsaved(state) and not scene_unsaved(state):
            source = beside_alone(state)
            if source is not None:
                return self._save_beside(source)
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
        untouched = self._own.has(path, stamp := stamp_of(path)) and self._is_open(path)
        untouched = untouched and stamp == self._state.edited.stamp
        if path.exists() and not untouched and not replace:
            self.name, self.taken = str(path), True
            return False
        return self.write(path, over=replace)

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

    def _save_beside(self, source: Path) -> bool:
        """Marks and film, of a scene that has not changed."""
        state = self._state
        try:
            due = due_beside(state, source, origin_of_source(state))
            self.begins({each.path: each.content() for each in due})
            written = write_beside(state, due)
        except (OSError, ValueError) as error:
            self._say_failed(source, error)
            return False
        state.say(said("Saved {path}", path=", ".join(map(str, written))))
        self._go_on()
        return True

    def _say_failed(self, path: Path, error: OSError | ValueError) -> None:
        reason = error.strerror if isinstance(error, OSError) else str(error).rstrip(".")
        why = {"name": path.name, "why": reason}
        self._state.problem = said("{name} cannot be saved: {why}.", **why)

    def write(self, path: Path, over: bool = False) -> bool:
        """Writes the file and what belongs beside it; what is wrong is said.

        over: a scene that is there goes, with what lies beside it.
        """
        state = self._state
        edited = state.edited
        try:
            due = due_beside(state, path.absolute(), np.zeros(3), over)
            pieces = with_written_pieces(edited, checked(edited.file), path.absolute())
            file = filed(pieces, state, path)
            path.parent.mkdir(parents=True, exist_ok=True)
            content = scene_bytes(file, path.parent)
            beside_it = {each.path: each.content() for each in due}
            self.begins({path.absolute(): content} | beside_it)
            write_whole(path, content)
        except (OSError, ValueError) as error:
            self._say_failed(path, error)
            return False
        self.name = ""
        path = path.absolute()
        edited.path, edited.stamp = path, stamp_of(path)
        self.own(path)
        edited.saved, edited.saved_regions = edited.file, state.regions.kept
        self._remember(path)
        try:
            written = write_beside(state, due)
        except OSError as error:
            self._say_failed(path, error)
            return False
        names = ", ".join([str(path), *(each.name for each in written)])
        self._state.say(said("Saved {path}", path=names))
        self._go_on()
        return True

    def own(self, path: Path) -> None:
        """Remembers that this person has saved what lies there now."""
        try:
            self._own.wrote(path, stamp_of(path))
        except OSError as error:
            why = error.strerror or error
            self._state.messages.fail(
                said("That this file is yours cannot be remembered: {why}.", why=why)
            )

    def before_losing(self, then: Callable[[], None]) -> None:
        """Does it at once, or after a question where changes would be lost."""
        if unsaved(self._state):
            self.then = then
        else:
            then()

    def answer(self, word: str) -> None:
        """One of Save, Do not save, Cancel."""
        if word == "Save":
            self.save()
        elif word == LOSE:
            self.refused()
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
    """Whether something would be lost: edits, regions, paint, marks, lengths, a film; not a lens,
    nor where x stands.
    """
    edited = state.edited
    return scene_unsaved(state) or edited.marks is not edited.saved_marks or film_unsaved(state)


def scene_unsaved(state: EditorState) -> bool:
    """The same of what the scene file says."""
    return state.edited.unsaved or state.regions.kept != state.edited.saved_regions


def what_is_lost(state: EditorState) -> list[str]:
    """A line for each kind of what would be lost, by name."""
    edited, lines = state.edited, []
    changed = edits.changes(edited.saved, edited.file)
    changed = [change for change in changed if change.fields != {"x"}]
    items = [change.after or change.before for change in changed]
    names = [item.name for item in items if item is not None]
    if edited.unsaved and not names:
        names = [said(THE_SCENE)]
    if names:
        lines.append(said("Objects: {names}", names=_listed(names)))
    regions = _other(edited.saved_regions, state.regions.kept)
    if regions:
        lines.append(said("Regions: {names}", names=_listed(regions)))
    before, now = edited.saved_marks, edited.marks
    if now is not before:
        names = _other(before.marks, now.marks) + _other(before.lengths, now.lengths)
        names = names or [said("values")]
        lines.append(said("Marks and lengths: {names}", names=_listed(names)))
    if film_unsaved(state):
        keys = state.timeline.keys
        count = len(keys.cameras) + len(keys.stops)
        lines.append(said("Film: {count} keys", count=count))
    return lines


def _other(before: Sequence, now: Sequence) -> list[str]:
    """Names of what is not the same in both."""
    old, new = {id(each) for each in before}, {id(each) for each in now}
    rows = [each for each in now if id(each) not in old]
    rows += [each for each in before if id(each) not in new]
    return list(dict.fromkeys(each.name for each in rows))


def _listed(names: Sequence[str]) -> str:
    more = [said("{count} more", count=len(names) - MOST_NAMES)] * (len(names) > MOST_NAMES)
    return ", ".join([*names[:MOST_NAMES], *more])


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
