"""Marks as they are typed: [NAME=]numbers, by pixels of a view or by metres in the world."""

from collections.abc import Collection, Sequence

import numpy as np

from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.files.plain_text import name_line
from shapeshift.scene.inspection.marks import (
    PREFIX,
    Kind,
    Mark,
    box_around,
    box_at,
    circle_at,
    line_at,
    spot_at,
)
from shapeshift.scene.inspection.value_picture import ValuePicture

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
        raise UsageError(str(error)) from None
    centre, radius = bounds
    if not np.linalg.norm(mark.place - centre) <= OUTSIDE * radius:
        x, y, z = centre + origin
        raise UsageError(
            f"{kind} {name} lies outside of the scene, which is {radius:.3g} m about "
            f"{x:.3g},{y:.3g},{z:.3g}; move it."
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
