"""The history of what is open, kept on the disk as it grows, so that nothing is lost by a crash.

The file is there exactly while something is not saved: each edit, undo and redo is an entry at
once, a drag twice a second.  The next start offers it; saving or refusing all removes it.
"""

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import compared
from shapeshift.app.editor.state.files.journal_file import JournalFile, entry_line
from shapeshift.app.editor.state.files.journal_rows import (
    RowWriter,
    step_row,
    things_of,
)
from shapeshift.app.editor.state.files.saving import unsaved
from shapeshift.app.editor.texts.table import said
from shapeshift.app.paths import file_name
from shapeshift.scene.document.edits import History, HistoryStep
from shapeshift.scene.document.scene_file import SceneFile

DRAG_S = 0.4  # between two entries of one drag
RETRY_S = 2.0  # between two trials to write where that was refused
MOST_BEFORE = 50  # steps before the one of now that a new file begins with
LARGEST = 64 << 20  # bytes; then a new file begins
STEM = 40  # letters of a scene's name in that of its file


class Journal:
    """Follows the history of a state; `words` say why nothing is kept, "": all is."""

    def __init__(
        self, state: EditorState, folder: Path,
        stands: Callable[[], SceneFile | None] = lambda: None,
    ) -> None:  # fmt: skip
        """stands: the scene as it stands, where hands have moved things that no edit did; the same
        object until they move again.
        """
        self._state, self.folder, self._stands = state, folder, stands
        self._stood: tuple[History, SceneFile, History] | None = None
        self.words = ""
        self.file: JournalFile | None = None
        self._left: list[JournalFile] = []  # that could not be written any more, until one can
        self._begin_anew()
        self._stem = ""
        self._tried_s = -RETRY_S
        self._refused: History | None = None

    def _begin_anew(self) -> None:
        self._rows, self._written = RowWriter(), set[int]()
        self._seen: History | None = None  # as it was written last
        self._numbers: dict[int, tuple[HistoryStep, int]] = {}  # by id of the step
        self._now = (-1, -1)  # numbers of the step of now and of the last one, as written
        self._wrote_s = -DRAG_S

    # ---- writing

    def opened(self) -> None:
        """Another scene is there: its own file, from its next edit on."""
        self._remove()
        self._stem = stem_of(self._state)
        self._refused = None

    def _history(self) -> History:
        """What is kept: the history, and one step more for what hands have moved."""
        history, file = self._state.edited.history, self._stands()
        if file is None:
            self._stood = None
            return history
        known = self._stood
        if known is None or known[0] is not history or known[1] is not file:
            known = (history, file, history.record(file, "keep as it stands"))
            self._stood = known
        return known[2]

    @property
    def _unsaved(self) -> bool:
        return self._stood is not None or unsaved(self._state)

    def begin_saving(self, files: Mapping[Path, bytes]) -> None:
        """What is about to be written: after a kill amid that it is known as this window's."""
        history = self._history()
        if history is self._refused or not self._unsaved:
            return
        try:
            if history is not self._seen:
                self._write_or_begin(history)
                self._seen = history
            if self.file is not None:
                sums = {str(path): sum_of(content) for path, content in files.items()}
                self._append([{"at": self._now[0], "last": self._now[1], "saving": sums}])
        except OSError as error:
            self._fail(error, time.perf_counter())

    def refuse(self) -> None:
        """Nobody wants to save what there is now."""
        self._refused = self._history()
        self._remove()

    def close(self) -> None:
        """The window goes: what is neither saved nor refused is offered at the next start."""
        history = self._history()
        if not self._unsaved or self._refused is history:
            self._remove()
        for file in (self.file, *self._left):
            if file is not None:
                file.close()
        self.file, self._left = None, []

    def _remove(self) -> None:
        for file in (self.file, *self._left):
            if file is not None:
                file.remove()
        self.file, self._left = None, []
        self._begin_anew()

    def follow(self, now_s: float) -> bool:
        """Writes what was edited since the last call; True while a drag waits to be written."""
        history = self._history()
        if not self._unsaved:
            if self.file is not None or self._left:
                self._remove()
            self.words, self._seen = "", None
            return False
        if history is self._seen or history is self._refused:
            return False
        if history.steps[history.at].together and now_s - self._wrote_s < DRAG_S:
            return True
        if self.words and now_s - self._tried_s < RETRY_S:
            return False
        try:
            self._write_or_begin(history)
        except OSError as error:
            self._fail(error, now_s)
            return False
        self._seen, self._wrote_s, self.words = history, now_s, ""
        return False

    def _write_or_begin(self, history: History) -> None:
        """Raises OSError."""
        try:
            self._write(history)
        except FileNotFoundError:  # somebody has taken the folder, or the file
            if self.file is None:
                raise
            self._set_left()
            self._write(history)
            self._state.say(said("Unsaved work was gone from its folder; it is kept anew."))

    def _set_left(self) -> None:
        """What there is stays on the disk until something newer is there."""
        if self.file is not None:
            self._left.append(self.file)
        self.file = None
        self._begin_anew()

    def _fail(self, error: OSError, now_s: float) -> None:
        """Said at once, and in the lowest line until it is over; work goes on."""
        why = error.strerror or str(error)
        words = said("unsaved work is not kept: {why}", why=why)
        self._set_left()
        self._tried_s = now_s
        if not self.words:
            folder = self.folder
            self._state.problem = said(
                "Unsaved work cannot be kept for a next start in {folder}: {why}. Save often "
                "(Ctrl+S).",
                folder=folder, why=why,
            )  # fmt: skip
        self.words = words

    def _write(self, history: History) -> None:
        """Raises OSError."""
        if self.file is not None and self.file.size > LARGEST:
            self._set_left()
        begins = self.file is None
        numbers, entries = self._number_steps(history), []
        last = numbers[id(history.steps[-1])][1]
        for index, step in enumerate(history.steps):
            number = numbers[id(step)][1]
            old = id(step) in self._numbers or (begins and index < history.at - MOST_BEFORE)
            if old and index != history.at:
                continue
            if number in self._written and (old or self._is_same(step, number)):
                continue
            row = step_row(self._rows, self._state.edited, step)
            fresh, self._rows.fresh = self._rows.fresh, {}
            entries.append({"step": number, "last": last, "rows": fresh} | row)
            self._written.add(number)
            self._now = (number, last)
        if self._now != (now := (numbers[id(history.steps[history.at])][1], last)):
            entries.append({"at": now[0], "last": last})
            self._now = now
        if entries:
            self._append([header(self._state)] * begins + entries)
        self._numbers = numbers
        if self._rows.is_large:
            steps = history.steps
            self._rows.forget_but(
                set[int]().union(*(things_of(self._state.edited, s) for s in steps))
            )
        for file in self._left:
            file.remove()
        self._left = []

    def _append(self, entries: Sequence[Mapping[str, Any]]) -> None:
        file = self.file = self.file or JournalFile.begin(self.folder, self._stem)
        file.append(b"".join(entry_line(dict(entry)) for entry in entries))

    def _number_steps(self, history: History) -> dict[int, tuple[HistoryStep, int]]:
        """One a step, rising; a step that was amended has the number that it had."""
        steps, known = history.steps, self._numbers
        first = next((i for i, step in enumerate(steps) if id(step) in known), None)
        number = known[id(steps[first])][1] - first if first is not None else 0
        if first is None and self._numbers:  # all amended: the one of now is where it was
            number = self._now[0] - history.at
        found = {}
        for step in steps:
            number = known[id(step)][1] if id(step) in known else number
            found[id(step)] = (step, number)
            number += 1
        return found

    def _is_same(self, step: HistoryStep, number: int) -> bool:
        """Whether the step of that number says the same, but for where sliders stand."""
        for before, known in self._numbers.values():
            if known == number:
                same = step.film is before.film and step.marks is before.marks
                looks = not compared(before.file, step.file)[1]
                return same and looks and step.regions == before.regions
        return False


def sum_of(content: bytes) -> str:
    """By which a file's content is known again."""
    return hashlib.sha256(content).hexdigest()


def key_of_scene(state: EditorState) -> str:
    """What makes two windows have the same scene open: the paths of what was opened."""
    edited = state.edited
    paths = [edited.path] if edited.path is not None else [each.path for each in state.sources]
    return "\n".join(str(path.absolute()) for path in paths)


def stem_of(state: EditorState) -> str:
    """The name of its files, without number and ending."""
    key = key_of_scene(state)
    mark = hashlib.sha256(key.encode("utf-8", "surrogateescape")).hexdigest()[:12]
    name = file_name(state.edited.name.removesuffix(".scene.json"))[:STEM].strip(" .")
    return f"{name or 'scene'}-{mark}"


def header(state: EditorState) -> dict[str, Any]:
    """The first entry: of what it is, and as what that lay on the disk."""
    edited = state.edited
    stamps = {str(path): list(stamp) for path, stamp in edited.stamps.items()}
    return {
        "scene": key_of_scene(state), "name": edited.name, "folder": str(edited.file.folder),
        "stamp": list(edited.stamp), "stamps": stamps,
    }  # fmt: skip
