"""What options say about marks that are there: notes and photos, by name."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.files.plain_text import name_line
from shapeshift.scene.inspection.mark_photos import MOST_OF_ALL, shrunk_photo
from shapeshift.scene.inspection.marks import Mark
from shapeshift.scene.inspection.marks_file import MarksFile


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
