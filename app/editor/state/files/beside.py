"""What lies beside a scene and belongs to it: NAME.marks.json and NAME.film.json, read, written."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import EditedFile, stamp_of
from shapeshift.app.editor.texts.table import said
from shapeshift.app.film.window.timeline import FilmKeys
from shapeshift.app.paths import is_bundled
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.film.film_path import film_beside, film_bytes, read_film_file
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    marks_bytes,
    marks_path,
    moved_marks,
    read_marks_file,
)

Found = TypeVar("Found")


def source_of(state: EditorState) -> Path | None:
    """The file beside which they lie; None: there is no one file."""
    if state.edited.path is not None:
        return state.edited.path
    return state.sources[0].path if len(state.sources) == 1 else None


def origin_of_source(state: EditorState) -> np.ndarray:
    """(3,) metres: where the shown world has its zero in that of the file."""
    return np.zeros(3) if state.edited.path is not None else state.origin


def open_beside(state: EditorState) -> None:
    """Takes marks and film over that lie beside what was opened; what cannot be read is said."""
    edited, source = state.edited, source_of(state)
    if source is None:
        return
    origin = origin_of_source(state)
    path = marks_path(source)
    if (marks := _read(state, path, read_marks_file)) is not None:
        edited.saved_marks = moved_marks(marks, -origin)
        edited.begin_with(marks=edited.saved_marks)
    path = film_beside(source)
    film = _read(state, path, lambda path: read_film_file(path, cameras=0))
    if film is not None:
        state.timeline.take_over(film, origin.tolist())
        state.timeline.did, edited.saved_film = "", state.timeline.keys
        edited.begin_with(film=edited.saved_film)


def _read(state: EditorState, path: Path, read: Callable[[Path], Found]) -> Found | None:
    """What a file holds, its stamp kept; None where there is none or, said, none that is right."""
    if not path.exists():
        return None
    try:
        found = read(path)
    except (BadFile, OSError) as error:
        state.problem = str(error)
        return None
    state.edited.stamps[path] = stamp_of(path)
    return found


@dataclass(frozen=True)
class Beside:
    """One of the files that lie beside a scene, as it would be written now."""

    path: Path
    changed: bool  # since it was read or written
    empty: bool
    content: Callable[[], bytes]

    def is_due(self, edited: EditedFile) -> bool:
        """Whether saving writes it: also in another place, where it says something."""
        known = self.path in edited.stamps
        return self.changed if known or self.empty else True

    def check(self, edited: EditedFile) -> None:
        """Raises BadFile where somebody else has written it, or it cannot be read."""
        if stamp_of(self.path) != edited.stamps.get(self.path, ()):
            raise BadFile(
                said(
                    "{name} was written by somebody else, or cannot be read; move it away, then "
                    "save",
                    name=self.path.name,
                )
            )


def files_beside(state: EditorState, scene: Path, origin: np.ndarray) -> list[Beside]:
    """What belongs beside `scene`, whose world has the shown world's zero at `origin` (3,)."""
    edited, keys, marks = state.edited, state.timeline.keys, state.edited.marks
    where, film_where = marks_path(scene), film_beside(scene)
    return [
        Beside(
            where, marks is not edited.saved_marks, marks == MarksFile(),
            lambda: marks_bytes(moved_marks(marks, origin)),
        ),
        Beside(
            film_where, film_unsaved(state), not (keys.cameras or keys.stops),
            lambda: film_bytes(keys.path(origin.tolist())),
        ),
    ]  # fmt: skip


def film_unsaved(state: EditorState) -> bool:
    saved = state.edited.saved_film
    return state.timeline.keys is not (saved if isinstance(saved, FilmKeys) else None)


def write_beside(state: EditorState, due: list[Beside]) -> list[Path]:
    """Writes them; returns where they are.  Raises OSError."""
    edited = state.edited
    for each in due:
        write_whole(each.path, each.content())
        edited.stamps[each.path] = stamp_of(each.path)
    edited.saved_marks, edited.saved_film = edited.marks, state.timeline.keys
    return [each.path for each in due]


def due_beside(
    state: EditorState, scene: Path, origin: np.ndarray, over: bool = False
) -> list[Beside]:
    """What is to be written beside `scene`; over: what is there belongs to a scene that goes.

    Raises BadFile, before anything is written.
    """
    found = files_beside(state, scene, origin)
    if over:
        return [each for each in found if each.is_due(state.edited) or each.path.exists()]
    due = [each for each in found if each.is_due(state.edited)]
    for each in due:
        each.check(state.edited)
    return due


def beside_alone(state: EditorState) -> Path | None:
    """The file beside which marks and film can be saved without the scene; None: there is none."""
    source = source_of(state)
    return None if source is None or is_bundled(source) or not source.exists() else source
