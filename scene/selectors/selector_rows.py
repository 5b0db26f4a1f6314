"""Selectors as rows of a JSON file, both ways: {"kind": "sphere", "centre": [...], ...}."""

from collections.abc import Callable
from dataclasses import MISSING, fields
from typing import TypeVar

from shapeshift.runtime_models.files.json_fields import Fields, control_row
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.selectors.selector import (
    SPACES,
    Box,
    HalfSpace,
    Lens,
    Painted,
    Selector,
    Sphere,
)

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
