"""What options say about marks: those of a file, new ones, their notes and photos by name."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.inspect_view import InspectedView
from shapeshift.runtime_models.files.plain_text import name_line
from shapeshift.scene.inspection.mark_photos import MOST_OF_ALL, shrunk_photo
from shapeshift.scene.inspection.marks import (
    KINDS,
    MOST_MARKS,
    PREFIX,
    Bound,
    Isotherm,
    Kind,
    Mark,
    box_around,
    box_at,
    circle_at,
    line_at,
    spot_at,
)
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    laid,
    marks_path,
    moved_marks,
    read_marks_file,
)
from shapeshift.scene.inspection.value_picture import ValuePicture


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
) -> tuple[MarksFile, dict[str, str]]:
    """The file's marks in the scene's own metres, with those of the options, laid in this view; one
    of the same name is replaced.  And by name, why marks of the options lie nowhere: they are left
    out.  Raises UsageError: all of them do, or one is no mark.
    """
    marks = {mark.name: mark for mark in moved_marks(file, -document.origin).marks}
    bounds, left_out, asked = document.bounds(), {}, 0
    for kind in KINDS:
        for text in getattr(options, kind):
            asked += 1
            taken = (*marks, *left_out)
            try:
                mark = make_mark(kind, text, taken, inspected.values, document.origin, bounds)
            except NowhereError as error:
                left_out[error.name] = str(error)
                continue
            marks[mark.name] = laid(mark, inspected.values)
    if left_out and len(left_out) == asked:
        raise UsageError(" ".join(left_out.values()))
    if len(marks) > MOST_MARKS:
        raise UsageError(f"{len(marks):,} marks are too many; at most {MOST_MARKS:,} fit one file.")
    pairs = list(file.differences)
    for text in options.difference:
        first, _, second = (word.strip() for word in text.partition(","))
        if first in left_out or second in left_out:
            continue
        for name in (first, second):
            if name not in marks:
                known = ", ".join(marks) or "none"
                raise UsageError(
                    f"--difference is '{text}': no mark is called '{name}'; there are {known}."
                )
        pairs.append((first, second))
    isotherms = tuple(dict.fromkeys((*file.isotherms, *choose_isotherms(options))))
    pairs = list(dict.fromkeys(pairs))
    found = tuple(marks.values())
    return replace(file, marks=found, differences=tuple(pairs), isotherms=isotherms), left_out


class NowhereError(UsageError):
    """A mark that lies where nothing of the scene is."""

    def __init__(self, name: str, sentence: str) -> None:
        super().__init__(sentence)
        self.name = name


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


def with_remarks(
    file: MarksFile, remarks: Sequence[str], photos: Sequence[str], left_out: Collection[str] = ()
) -> MarksFile:
    """The file with the notes and photos of NAME=TEXT and NAME=FILE; "NAME=" takes one away.

    left_out: names of marks that could not be laid.  Raises UsageError, BadFile, one sentence.
    """
    remarks, photos = (
        [text for text in texts if not text.startswith(tuple(f"{name}=" for name in left_out))]
        for texts in (remarks, photos)
    )
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


# Marks as they are typed: [NAME=]numbers, by pixels of a view or by metres in the world.

# kind: (numbers by pixels, how, numbers by the world, how)
FORMS: dict[str, tuple[int, str, int, str]] = {
    "spot": (2, "column,row", 3, "x,y,z"),
    "circle": (3, "column,row,pixels", 4, "x,y,z,metres"),
    "line": (4, "column,row,column,row", 6, "x,y,z,x,y,z"),
    "box": (4, "column,row,column,row", 6, "x,y,z,hx,hy,hz"),
}
OUTSIDE = 3.0  # times the scene's radius from its centre: no mark is meant to be there


def free_name(kind: Kind, taken: Collection[str]) -> str:
    """Sp1, Sp2, ...: the first that no mark has."""
    number = 1
    while f"{PREFIX[kind]}{number}" in taken:
        number += 1
    return f"{PREFIX[kind]}{number}"


def parse_numbers(text: str, said: str) -> list[float]:
    """The numbers between commas, all finite.  Raises UsageError."""
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = [np.nan]
    if not np.isfinite(numbers).all():
        raise UsageError(f"{said} is '{name_line(text)}', expected numbers with commas between.")
    return numbers


def split_name(text: str) -> tuple[str, str]:
    """(name or "", numbers) of [NAME=]numbers.  Raises UsageError."""
    name, sign, numbers = text.rpartition("=")
    name = name.strip()
    if sign and not (name and name == name_line(name)):
        raise UsageError(
            f"a mark is called '{name_line(name)}'; one line of 1 to 80 letters is wanted."
        )
    return name, numbers


def make_mark(
    kind: Kind,
    text: str,
    taken: Collection[str],
    picture: ValuePicture,
    origin: np.ndarray,
    bounds: tuple[np.ndarray, float],
) -> Mark:
    """The mark that a text like `motor=120,80` means in a view.  Raises UsageError, one sentence.

    origin (3,): where the scene's zero lies in the world that is typed; bounds: of the scene.
    """
    name, text = split_name(text)
    name = name or free_name(kind, taken)
    numbers = parse_numbers(text, f"{kind} {name}")
    by_pixels, how, by_world, how_world = FORMS[kind]
    if len(numbers) not in (by_pixels, by_world):
        raise UsageError(
            f"{kind} {name} has {len(numbers)} numbers; write {how} in pixels, or {how_world} in "
            "metres."
        )
    try:
        if len(numbers) == by_pixels:
            return _in_pixels(kind, name, numbers, picture)
        mark = _in_metres(kind, name, np.array(numbers), picture, origin)
    except ValueError as error:
        raise NowhereError(name, str(error)) from None
    centre, radius = bounds
    if not np.linalg.norm(mark.place - centre) <= OUTSIDE * radius:
        x, y, z = centre + origin
        raise NowhereError(
            name,
            f"{kind} {name} lies outside of the scene, which is {radius:.3g} m about "
            f"{x:.3g},{y:.3g},{z:.3g}; move it.",
        )
    return mark


def _in_pixels(kind: Kind, name: str, numbers: Sequence[float], picture: ValuePicture) -> Mark:
    if kind == "spot":
        return spot_at(name, picture, (numbers[0], numbers[1]))
    if kind == "circle":
        return circle_at(name, picture, (numbers[0], numbers[1]), numbers[2])
    ends = np.array(numbers).reshape(2, 2)
    if kind == "line":
        return line_at(name, picture, ends)
    return box_at(name, picture, (ends[0, 0], ends[0, 1]), (ends[1, 0], ends[1, 1]))


def _in_metres(
    kind: Kind, name: str, numbers: np.ndarray, picture: ValuePicture, origin: np.ndarray
) -> Mark:
    first = numbers[:3] - origin
    if kind == "spot":
        return Mark(name, "spot", first[None])
    if kind == "circle":
        return Mark(name, "circle", first[None], float(numbers[3]))
    if kind == "box":
        return box_around(name, first, numbers[3:])
    ends = np.stack([first, numbers[3:] - origin])
    if not np.isfinite(picture.pixel_of(ends)[0]).all():
        raise ValueError(f"line {name} has an end behind the camera; choose another --camera.")
    return line_at(name, picture, picture.pixel_of(ends)[0])
