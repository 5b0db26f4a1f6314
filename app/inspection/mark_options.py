"""What options say about marks: those of a file, new ones, their notes and photos by name."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.inspect_view import InspectedView
from shapeshift.app.inspection.mark_texts import make_mark
from shapeshift.runtime_models.files.plain_text import name_line
from shapeshift.scene.inspection.mark_photos import MOST_OF_ALL, shrunk_photo
from shapeshift.scene.inspection.marks import KINDS, MOST_MARKS, Bound, Isotherm, Mark
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    marks_path,
    moved_marks,
    read_marks_file,
)


class MarkOptions(Protocol):
    """Those of a command's options that are read here; the marks of each of KINDS, too."""

    @property
    def scene(self) -> Path: ...
    @property
    def marks(self) -> Path | None: ...
    @property
    def save(self) -> bool: ...
    @property
    def forget(self) -> tuple[str, ...]: ...
    @property
    def difference(self) -> tuple[str, ...]: ...
    @property
    def above(self) -> float | None: ...
    @property
    def below(self) -> float | None: ...
    @property
    def between(self) -> tuple[float, float] | None: ...


def open_marks(options: MarkOptions) -> tuple[Path, MarksFile]:
    """Where the marks lie, and what is there, without those that --forget names.

    Raises BadFile, UsageError.
    """
    path = options.marks or marks_path(options.scene)
    if options.marks and not path.exists() and not options.save:
        raise UsageError(f"{path} does not exist; name a file of marks, or add --save to begin it.")
    file = read_marks_file(path) if path.exists() else MarksFile()
    names = [mark.name for mark in file.marks]
    for name in options.forget:
        if name not in names:
            raise UsageError(
                f"--forget: no mark is called '{name}'; there are {', '.join(names) or 'none'}."
            )
    kept = tuple(mark for mark in file.marks if mark.name not in options.forget)
    pairs = tuple(pair for pair in file.differences if not set(pair) & set(options.forget))
    return path, replace(file, marks=kept, differences=pairs)


def with_new_marks(
    options: MarkOptions, file: MarksFile, inspected: InspectedView, document: Document
) -> MarksFile:
    """The file's marks in the scene's own metres, with those of the options; one of the same name
    is replaced.  Raises UsageError.
    """
    marks = {mark.name: mark for mark in moved_marks(file, -document.origin).marks}
    bounds = document.bounds()
    for kind in KINDS:
        for text in getattr(options, kind):
            mark = make_mark(kind, text, marks, inspected.values, document.origin, bounds)
            marks[mark.name] = mark
    if len(marks) > MOST_MARKS:
        raise UsageError(f"{len(marks):,} marks are too many; at most {MOST_MARKS:,} fit one file.")
    pairs = list(file.differences)
    for text in options.difference:
        first, _, second = (word.strip() for word in text.partition(","))
        for name in (first, second):
            if name not in marks:
                known = ", ".join(marks) or "none"
                raise UsageError(
                    f"--difference is '{text}': no mark is called '{name}'; there are {known}."
                )
        pairs.append((first, second))
    isotherms = tuple(dict.fromkeys((*file.isotherms, *choose_isotherms(options))))
    pairs = list(dict.fromkeys(pairs))
    return replace(file, marks=tuple(marks.values()), differences=tuple(pairs), isotherms=isotherms)


def choose_isotherms(options: MarkOptions) -> list[Isotherm]:
    """Those of the options.  Raises UsageError."""
    asked: dict[Bound, dict[str, float]] = {}
    if options.above is not None:
        asked["above"] = {"low": options.above}
    if options.below is not None:
        asked["below"] = {"high": options.below}
    if options.between is not None:
        asked["between"] = {"low": options.between[0], "high": options.between[1]}
    found = []
    for kind, ends in asked.items():
        try:
            found.append(Isotherm(kind, **ends))
        except ValueError as error:
            raise UsageError(f"--{kind}: {error}") from None
    return found


def with_remarks(file: MarksFile, remarks: Sequence[str], photos: Sequence[str]) -> MarksFile:
    """The file with the notes and photos of NAME=TEXT and NAME=FILE; "NAME=" takes one away.

    Raises UsageError, BadFile, one sentence.
    """
    for text in remarks:
        mark, note = _of_mark(file, text, "--remark")
        file = _with(file, replace(mark, note=name_line(note.strip()) if note.strip() else ""))
    for text in photos:
        mark, name = _of_mark(file, text, "--mark-photo")
        file = _with(file, replace(mark, photo=shrunk_photo(Path(name)) if name else b""))
    size = sum(len(mark.photo) for mark in file.marks)
    if size > MOST_OF_ALL:
        raise UsageError(
            f"the photos of all marks have {size:,} bytes; {MOST_OF_ALL:,} fit one file: take some "
            "away with --mark-photo NAME="
        )
    return file


def _of_mark(file: MarksFile, text: str, option: str) -> tuple[Mark, str]:
    """The longest name of a mark before an equals sign, and what follows it."""
    names = [mark.name for mark in file.marks if text.startswith(f"{mark.name}=")]
    if not names:
        known = ", ".join(mark.name for mark in file.marks) or "none"
        raise UsageError(f"{option} {text}: NAME=... of a mark is wanted; there are {known}.")
    name = max(names, key=len)
    return file.named(name), text[len(name) + 1 :]


def _with(file: MarksFile, changed: Mark) -> MarksFile:
    marks = tuple(changed if mark.name == changed.name else mark for mark in file.marks)
    return replace(file, marks=marks)
