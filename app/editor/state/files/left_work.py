"""What a window that was killed has left: read, offered, and taken back into the scene."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shapeshift.app.editor.state.arrange import go_to
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import ModelKey, stamp_of
from shapeshift.app.editor.state.files.journal import key_of_scene, stem_of, sum_of
from shapeshift.app.editor.state.files.journal_file import JournalFile, journals_of
from shapeshift.app.editor.state.files.journal_rows import RowReader
from shapeshift.app.editor.state.files.opened import Progress, Source
from shapeshift.app.editor.state.parts.piece import Piece
from shapeshift.app.editor.texts.table import said
from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.scene.document.edits import History, HistoryStep
from shapeshift.scene.document.scene_file import SceneFile, SceneItem, read_models

MOST_NUMBER = 1 << 40


@dataclass
class LeftWork:
    """A journal of a window that is gone, taken up: nobody else has it meanwhile."""

    file: JournalFile
    head: dict[str, Any]
    steps: dict[int, dict[str, Any]]  # by number
    rows: dict[int, Any]
    at: int
    torn: int  # bytes at the end
    saving: dict[Path, str] = field(default_factory=dict)  # sums of what was being saved at the end

    @property
    def name(self) -> str:
        return str(self.head.get("name", ""))

    @property
    def stamp(self) -> tuple:
        """Of the scene file when the journal was begun; (): there was none."""
        found = self.head.get("stamp")
        return tuple(found) if isinstance(found, list) else ()

    def has_written(self, path: Path) -> bool:
        """Whether what lies there is exactly what its window was saving when it ended."""
        wanted = self.saving.get(path.absolute())
        try:
            return wanted is not None and sum_of(path.read_bytes()) == wanted
        except OSError:
            return False

    @property
    def is_saved(self) -> bool:
        """Whether all that was being saved lies there."""
        return bool(self.saving) and all(map(self.has_written, self.saving))

    @property
    def deeds(self) -> list[str]:
        """What was done up to now, the newest first, in English."""
        done = [self.steps[n].get("what") for n in sorted(self.steps, reverse=True) if n <= self.at]
        return [what for what in done if isinstance(what, str) and what]


def left_work(state: EditorState, folder: Path, problems: list[str]) -> LeftWork | None:
    """The newest that windows have left of the scene that is open; `problems` gets a sentence for
    each that cannot be read, which is put aside.
    """
    found: list[LeftWork] = []
    for path in journals_of(folder, stem_of(state)):
        work = take_up(path, problems)
        if work is not None and work.head.get("scene") == key_of_scene(state):
            found.append(work)
        elif work is not None:
            work.file.close()
    found.sort(key=lambda work: work.file.modified_s)
    for work in found[:-1]:
        work.file.close()
    return found[-1] if found else None


def take_up(path: Path, problems: list[str]) -> LeftWork | None:
    """None: its window lives, nothing is in it, or it was put aside."""
    file = JournalFile.take_up(path)
    if file is None:
        return None
    try:
        entries, torn = file.read()
        work = replay(file, entries, torn)
    except (BadFile, OSError, MemoryError) as error:
        place = file.set_aside()
        why = str(error).rstrip(".") or said("there is not memory enough")
        problems.append(
            said(
                "Unsaved work of an earlier start cannot be read: {why}. It was put aside: {path}",
                why=why,
                path=place,
            )
        )
        return None
    if work is None:
        file.remove()
    return work


def replay(file: JournalFile, entries: Sequence[Mapping[str, Any]], torn: int) -> LeftWork | None:
    """What entries come to; None: nothing was done.  Raises BadFile."""
    if len(entries) < 2:
        return None
    work = LeftWork(file, dict(entries[0]), {}, {}, -1, torn)
    for entry in entries[1:]:
        fields = Fields(entry, "an entry")
        work.at = fields.count("step" if "step" in entry else "at", 0, MOST_NUMBER)
        last = fields.count("last", 0, MOST_NUMBER)
        for number, row in fields.typed("rows", dict, {}).items():
            work.rows[int(number) if number.isdecimal() else -1] = row
        sums = fields.typed("saving", dict, {})
        work.saving = {Path(path): each for path, each in sums.items() if isinstance(each, str)}
        if "step" in entry:
            work.steps[work.at] = dict(entry)
        work.steps = {n: step for n, step in work.steps.items() if n <= last}
    if work.at not in work.steps:
        raise BadFile("its last step is not in it")
    return work


class Restoring:
    """The steps of a journal for the scene that is open; what cannot be so is left out, but for the
    step of now: then BadFile.
    """

    def __init__(self, state: EditorState, work: LeftWork) -> None:
        """Raises BadFile."""
        self._state, self._work = state, work
        self._reader = RowReader(work.rows, state.edited)
        self._folder = state.edited.saved.folder
        self._steps: dict[int, HistoryStep] = {}
        for number in sorted(work.steps):
            try:
                self._steps[number] = self._reader.step(work.steps[number], self._folder)
            except BadFile:
                if number == work.at:
                    raise

    def wanted(self) -> set[ModelKey]:
        """Models that are to be read before."""
        keys = [self._reader.models_wanted(step) for step in self._steps.values()]
        return set[ModelKey]().union(*keys) - self._state.edited.sources.keys()

    def read(self, wanted: set[ModelKey], progress: Progress) -> dict[ModelKey, Source]:
        """Those that can be read; runs in a thread.  Raises BadFile where the step of now has one
        that cannot.
        """
        needed = self._reader.models_wanted(self._steps[self._work.at])
        found = {}
        for key in wanted:
            try:
                found[key] = read_source(key, self._folder, progress)
            except (BadFile, OSError):
                if key in needed:
                    raise
        return found

    def take_back(self, sources: Mapping[ModelKey, Source]) -> None:
        """The window has what was left.  Raises BadFile, with all as it was."""
        state, edited, work = self._state, self._state.edited, self._work
        known = edited.sources | dict(sources)
        pieces: dict[str, Piece] = {}
        steps = {}
        for number, step in self._steps.items():
            try:
                pieces |= self._pieces_of(step, known, pieces)
                steps[number] = step
            except (BadFile, KeyError) as error:
                if number == work.at:
                    raise BadFile(str(error)) from None
        edited.sources, edited.pieces = known, edited.pieces | pieces
        numbers = sorted(steps)
        history = History(tuple(steps[n] for n in numbers), numbers.index(work.at))
        go_to(state, history)
        path = edited.path
        if work.stamp != edited.stamp and not (path and work.has_written(path)):
            edited.stamp = work.stamp  # saving asks, as over what somebody else has written
        stamps = Fields(work.head, "its head").typed("stamps", dict, {})
        before = {Path(path): tuple(stamp) for path, stamp in stamps.items()}
        edited.stamps |= {
            p: stamp
            for p, stamp in before.items()
            if stamp != stamp_of(p) and not work.has_written(p)
        }

    def _pieces_of(
        self, step: HistoryStep, sources: Mapping[ModelKey, Source], made: Mapping[str, Piece]
    ) -> dict[str, Piece]:
        names = [i.model for i in step.file.all_items if i.model in self._reader.pieces]
        found = {n: made[n] if n in made else self._reader.piece(n, sources) for n in names}
        if missing := self._reader.models_wanted(step) - sources.keys():
            raise BadFile(f"{next(iter(missing))[0]} is not there any more.")
        return found


def read_source(key: ModelKey, folder: Path, progress: Progress) -> Source:
    """A model by the words of a scene file.  Raises BadFile, OSError."""
    model, mode, up, flip, part = key
    item = SceneItem(name="object", model=model, mode=mode, up=up, flip=flip, part=part)
    file, models = read_models(SceneFile(folder=folder, items=(item,)), Reading(progress=progress))
    path, found = file.path(model), models[item.name]
    return Source(path, found, describe(found, path), Reading(mode, up, flip))


def left_names(state: EditorState, folder: Path) -> list[str]:
    """Paths of other scenes of which windows that are gone have left something."""
    own, found = stem_of(state), []
    for path in journals_of(folder):
        if path in journals_of(folder, own):
            continue
        file = JournalFile.take_up(path)
        if file is None:
            continue
        head = file.head()
        file.close()
        paths = str(head.get("scene", "")).splitlines()
        if paths and all(Path(each).exists() for each in paths):
            found.append(", ".join(paths))
        elif head and not paths:
            found.append(said("a scene without a file (New)"))
    return list(dict.fromkeys(found))
