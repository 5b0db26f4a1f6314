"""Selectors as text, for commands: sphere:0,1,0:0.5:1:0.1 and the like."""

import math
from collections.abc import Callable, Sequence
from dataclasses import MISSING, fields
from typing import TypeVar

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, control_row
from shapeshift.runtime_models.model import BadFile, Stop, one_line
from shapeshift.runtime_models.shapes import four, three
from shapeshift.scene.pose import Pose
from shapeshift.scene.selectors.selector import (
    SPACES,
    Box,
    HalfSpace,
    Lens,
    Painted,
    Selector,
    Sphere,
)

LONGEST = 120  # letters of a selector that are quoted
FORMS = {
    "sphere": "sphere:x,y,z:radius:X[:border]",
    "box": "box:x,y,z:hx,hy,hz:X[:border]",
    "half": "half:x,y,z:nx,ny,nz:X[:border]",
    "lens": "lens:degrees:X[:border]",
}


def read_selector(text: str, stops: Sequence[Stop] = (), eye: Pose | None = None) -> Selector:
    """A selector of the text; ValueError, one sentence, for what is none.

    X is a control value from 0 to 1 or the name of a stop; places are metres in the object's
    frame.  A lens is the cone about what `eye` looks at, half its opening in degrees.
    """
    said = _quoted(text)
    kind, *parts = text.split(":")
    if kind not in FORMS:
        raise ValueError(f"{said} begins with {_quoted(kind)}; {', '.join(FORMS)} are known.")
    form = FORMS[kind]
    least = form.split("[")[0].count(":")
    if not least <= len(parts) <= least + 1:
        raise ValueError(f"{said} has {len(parts)} parts after '{kind}'; write {form}.")
    try:
        border = float(parts[least]) if len(parts) > least else 0.0
        shape = [tuple(float(n) for n in part.split(",")) for part in parts[: least - 1]]
    except ValueError as error:
        raise ValueError(f"{said}: {one_line(str(error))[:80]}; write {form}.") from None
    common = {"x": _control(parts[least - 1], stops, said), "border": border}
    try:
        return _made(kind, shape, common, eye)
    except ValueError as error:
        raise ValueError(f"{said}: {error}") from None


def _made(kind: str, shape: list[tuple], common: dict, eye: Pose | None) -> Selector:
    if kind == "sphere":
        return Sphere(centre=shape[0], radius=_single(shape[1], "radius"), **common)
    if kind == "box":
        return Box(centre=shape[0], half=shape[1], **common)
    if kind == "half":
        return HalfSpace(point=shape[0], normal=shape[1], **common)
    angle = math.radians(_single(shape[0], "angle"))
    pose = eye or Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
    return Lens(position=three(pose.position), wxyz=four(pose.wxyz), half_angle=angle, **common)


def _single(numbers: tuple[float, ...], what: str) -> float:
    if len(numbers) != 1:
        raise ValueError(f"the {what} is {len(numbers)} numbers; one is wanted.")
    return numbers[0]


def _quoted(text: str) -> str:
    """One line of what was typed, cut where it is longer than any selector."""
    line = one_line(text)
    return f"'{line}'" if len(line) <= LONGEST else f"'{line[:LONGEST]}\u2026'"


def _control(text: str, stops: Sequence[Stop], said: str) -> float:
    """x of a number or of a stop's name."""
    for stop in stops:
        if stop.name.lower() == text.lower():
            return stop.x
    try:
        return float(text)
    except ValueError:
        names = ", ".join(stop.name for stop in stops) or "none"
        raise ValueError(
            f"{said}: X is {_quoted(text)}; a number from 0 to 1 or a stop ({names}) is wanted."
        ) from None


# Selectors as rows of a JSON file, both ways: {"kind": "sphere", "centre": [...], ...}.

Made = TypeVar("Made")
KINDS: dict[str, type[Selector]] = {
    "box": Box,
    "sphere": Sphere,
    "half": HalfSpace,
    "lens": Lens,
    "painted": Painted,
}
COUNTS = {"centre": 3, "half": 3, "wxyz": 4, "point": 3, "normal": 3, "position": 3, "tangents": 4}


def read_selector_row(row: Fields) -> Selector:
    """Its keys are the fields of the selector's class.  Raises BadFile."""
    kind = KINDS[row.line("kind", known=tuple(KINDS))]
    values = {}
    for field in fields(kind):
        default = None if field.default is MISSING else field.default
        if default is None and field.default is MISSING and field.name not in row.data:
            raise BadFile(f"{row.where}: '{field.name}' is missing.")
        if field.name in COUNTS:
            values[field.name] = row.numbers(field.name, COUNTS[field.name], default)
        elif field.name == "space":
            values[field.name] = row.line("space", default, SPACES)
        elif field.name == "x":
            values["x"] = row.control("x")
        elif field.name == "weight":
            values[field.name] = row.numbers("weight", len(as_list(row.data["weight"])))
        else:
            values[field.name] = row.number(field.name, default, "a finite number")
    row.refuse_unknown_keys()
    make: Callable[..., Selector] = kind
    return build(make, values, row.where)


def as_list(value: object) -> list:
    return value if isinstance(value, list) else [None]


def build(kind: Callable[..., Made], values: dict, where: str) -> Made:
    """An instance whose own refusal is the file's."""
    try:
        return kind(**values)
    except ValueError as error:
        raise BadFile(f"{where}: {error}") from None


def selector_row(selector: Selector) -> dict:
    """The inverse of read_selector_row."""
    kind = next(name for name, its_class in KINDS.items() if type(selector) is its_class)
    row: dict[str, object] = {"kind": kind}
    for field in fields(selector):
        value = getattr(selector, field.name)
        if field.name == "weight":
            row["weight"] = value.tolist()
        elif field.name == "x":
            row["x"] = control_row(value)
        elif value is not None and (field.default is MISSING or value != field.default):
            row[field.name] = list(value) if isinstance(value, tuple) else value
    return row
