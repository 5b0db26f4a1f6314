"""One view of an inspection: its values, its photo, what every mark reads, what isotherms hold."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.inspection.draw_values import MeasuredScene, draw_values
from shapeshift.scene.inspection.emissivity import Emission
from shapeshift.scene.inspection.length_marks import LengthMark
from shapeshift.scene.inspection.marks import Isotherm, Mark, MarkReading, read_mark
from shapeshift.scene.inspection.marks_file import MarksFile
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

TABLE_DIGITS = 3  # of a value in a table for programs, more than for people
COLUMNS = ("mark", "kind", "min", "mean", "max", "samples", "depth", "place")
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet would compute what begins so


@dataclass(frozen=True)
class IsothermReading:
    """What of a view an isotherm holds."""

    isotherm: Isotherm
    share: float  # of the pixels that are known, 0..1
    least: float
    most: float


@dataclass(frozen=True, eq=False)
class InspectedView:
    """A view with all that is measured in it."""

    values: ValuePicture
    photo: np.ndarray | None  # (H, W, 3) display sRGB
    photo_name: str
    readings: tuple[MarkReading, ...]
    differences: tuple[tuple[str, str, float], ...]  # first, second, mean less mean
    isotherms: tuple[IsothermReading, ...]
    lengths: tuple[tuple[LengthMark, str], ...] = ()  # and what they come to, in words
    stop_name: str = "Thermal"  # of its values


def inspect_view(
    renderer: "Renderer",
    document: Document,
    measured: MeasuredScene,
    photo_stop: str,
    view: View,
    emission: Emission | None = None,
) -> InspectedView:
    """The values of a view, and its photo where photo_stop names a stop; nothing is marked yet.
    emission: what corrects values, which are temperatures then.
    """
    values = draw_values(renderer, measured, view)
    if emission is not None:
        values = values.corrected(emission)
    photo = None
    if photo_stop:
        renderer.update(document.placed(photo_stop, "the photo's stop").scene)
        renderer.draw([view])
        photo = renderer.resolved(0).copy()
    return InspectedView(values, photo, photo_stop, (), (), (), stop_name=measured.stop.name)


def first_photo(document: Document, measured: MeasuredScene) -> str:
    """The stop that is shown beside the heat: the first that shows no values; "": there is none."""
    stops = (stop for model in document.models for stop in model.stops)
    others = (s.name for s in stops if not s.is_measured and s.name != measured.stop.name)
    return next(others, "")


def with_readings(inspected: InspectedView, file: MarksFile, unit: str = "m") -> InspectedView:
    """The view with what it reads of all marks, differences and isotherms of a file, and with its
    lengths; unit: of these.
    """
    values = inspected.values
    readings = {mark.name: read_mark(mark, values) for mark in file.marks}
    differences = tuple((a, b, readings[a].mean - readings[b].mean) for a, b in file.differences)
    isotherms = tuple(_isotherm(each, values) for each in file.isotherms)
    return InspectedView(
        values, inspected.photo, inspected.photo_name, tuple(readings.values()), differences,
        isotherms, length_words(file, unit), inspected.stop_name,
    )  # fmt: skip


def length_words(file: MarksFile, unit: str) -> tuple[tuple[LengthMark, str], ...]:
    """All lengths of a file with their values in a unit of lengths.UNITS."""
    return tuple((each, each.measured(file.scale).words(unit)) for each in file.lengths)


def _isotherm(each: Isotherm, values: ValuePicture) -> IsothermReading:
    inside = each.holds(values.values) & values.known
    known = int(values.known.sum())
    if not inside.any():
        return IsothermReading(each, 0.0, math.nan, math.nan)
    held = values.values[inside]
    share = float(inside.sum() / known)
    return IsothermReading(each, share, float(held.min()), float(held.max()))


def place_text(mark: Mark, origin: np.ndarray) -> str:
    """The middle of a mark, metres in the world of the scene's file."""
    return ",".join(f"{number + 0.0:.3f}" for number in np.round(mark.place + origin, 3))


def reading_row(reading: MarkReading, values: ValuePicture, origin: np.ndarray) -> tuple[str, ...]:
    """The cells of COLUMNS."""
    texts = list(map(values.text, (reading.least, reading.mean, reading.most)))
    depth = f"{reading.depth_m:.3f} m" if np.isfinite(reading.depth_m) else "--"
    mark = reading.mark
    return (mark.name, mark.kind, *texts, str(reading.samples), depth, place_text(mark, origin))


def csv_text(inspected: Sequence[InspectedView], origin: np.ndarray) -> str:
    """All readings as a table: a row a mark and view, empty cells where nothing is known."""
    held = io.StringIO()
    rows = csv.writer(held, lineterminator="\n")
    head = (
        "view",
        "mark",
        "kind",
        "unit",
        "min",
        "mean",
        "max",
        "samples",
        "depth_m",
        "x_m",
        "y_m",
        "z_m",
    )
    rows.writerow((*head, "note", "emissivity"))
    for number, each in enumerate(inspected):
        for reading in each.readings:
            mark = reading.mark
            figures = (reading.least, reading.mean, reading.most)
            digits = TABLE_DIGITS + each.values.digits
            rows.writerow(
                (
                    number,
                    cell(mark.name),
                    mark.kind,
                    cell(each.values.unit),
                    *(number_cell(figure, digits) for figure in figures),
                    reading.samples,
                    number_cell(reading.depth_m),
                    *map(number_cell, mark.place + origin),
                    cell(mark.note),
                    number_cell(used_emissivity(mark, each.values)),
                )
            )
        for a, b, value in each.differences:
            name = cell(f"{a} - {b}")
            gone = ("",) * 6
            rows.writerow(
                (
                    number,
                    name,
                    "difference",
                    cell(each.values.unit),
                    "",
                    number_cell(value, TABLE_DIGITS + each.values.digits),
                    *gone,
                    "",
                    "",
                )
            )
    return held.getvalue()


def used_emissivity(mark: Mark, values: ValuePicture) -> float:
    """By which a mark is read; NaN: its values are as photographed."""
    if mark.emissivity is not None:
        return mark.emissivity
    return math.nan if values.emission is None else values.emission.surface.emissivity


def profile_csv(reading: MarkReading, unit: str, digits: int = 1) -> str:
    """The profile of a line: metres along it, and the value."""
    lines = [f"metres,{cell(unit) or 'value'}"]
    lines += [
        f"{way:.5f},{number_cell(value, TABLE_DIGITS + digits)}" for way, value in reading.profile
    ]
    return "\n".join(lines) + "\n"


def number_cell(value: float, digits: int = 4) -> str:
    """A figure of a table; empty where it is not known."""
    return f"{value + 0.0:.{digits}f}" if np.isfinite(value) else ""


def cell(text: str) -> str:
    """A text of a table that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text
