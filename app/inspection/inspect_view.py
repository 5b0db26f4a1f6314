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
from shapeshift.scene.inspection.length_marks import LengthMark
from shapeshift.scene.inspection.marks import Isotherm, Mark, MarkReading, read_mark
from shapeshift.scene.inspection.marks_file import MarksFile
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

TABLE_DIGITS = 3  # of a value in a table for programs, more than for people
HERE = "this view"  # what it reads instead of a mark's value; empty: the same
COLUMNS = ("mark", "kind", "min", "mean", "max", HERE, "samples", "depth", "place")
OF_LAYING = ("laid", "min_here", "mean_here", "max_here", "here")  # columns of a table
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
) -> InspectedView:
    """The values of a view as photographed, and its photo where photo_stop names a stop; nothing
    is marked yet.
    """
    values = draw_values(renderer, measured, view)
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
    """The view with the values of surfaces as a file says, what it reads of all its marks,
    differences and isotherms, and its lengths; unit: of these.
    """
    values = file.of_surfaces(inspected.values)
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
    figures = (reading.least, reading.mean, reading.most)
    texts = [values.text(figure, reading.ends) for figure in figures]
    depth = f"{reading.depth_m:.3f} m" if np.isfinite(reading.depth_m) else "--"
    mark = reading.mark
    here = reading.hidden or now_text(reading, values)
    place = place_text(mark, origin)
    return (mark.name, mark.kind, *texts, here, str(reading.samples), depth, place)


def now_text(reading: MarkReading, values: ValuePicture) -> str:
    """What this view reads instead of the mark's value; "": the same, as people see it."""
    if reading.mark.laid is None or not reading.samples:
        return ""
    now = values.text(reading.value_now, reading.now.ends)
    return "" if now == values.text(reading.value, reading.ends) else now


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
    rows.writerow((*head, "note", "emissivity", *OF_LAYING))
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
                    number_cell(used_emissivity(reading)),
                    mark.laid.moment if mark.laid is not None else "",
                    *(number_cell(f, digits) for f in now_figures(reading)),
                    reading.hidden,
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
                    *("",) * len(OF_LAYING),
                )
            )
    return held.getvalue()


def readings_json(inspected: Sequence[InspectedView], file: MarksFile, origin: np.ndarray) -> dict:
    """All readings for programs: values as they are, null where nothing is known."""
    views = []
    for each in inspected:
        values = each.values
        (column, row), most = values.hottest() if values.known.any() else ((0.0, 0.0), math.nan)
        share = values.emissivity_at((column, row)) if np.isfinite(most) else None
        views.append(
            {
                "unit": values.unit,
                "marks": [_mark_json(reading, origin) for reading in each.readings],
                "differences": [
                    {"of": a, "less": b, "value": _known(v)} for a, b, v in each.differences
                ],
                "isotherms": [
                    {"is": alarm.isotherm.words(values.unit), "share": alarm.share,
                     "min": _known(alarm.least), "max": _known(alarm.most)}
                    for alarm in each.isotherms
                ],
                "hottest": {"value": _known(most), "pixel": [column, row], "emissivity": share},
            }
        )  # fmt: skip
    error = None if file.held_out is None else vars(file.held_out)
    return {"views": views, "held_out": error}


def _mark_json(reading: MarkReading, origin: np.ndarray) -> dict:
    mark, names = reading.mark, ("min", "mean", "max")
    figures = (reading.least, reading.mean, reading.most)
    return {
        "name": mark.name, "kind": mark.kind,
        **{name: _known(value) for name, value in zip(names, figures, strict=True)},
        "emissivity": _known(used_emissivity(reading)),
        "laid": mark.laid.moment if mark.laid is not None else None,
        "this_view": {n: _known(v) for n, v in zip(names, now_figures(reading), strict=True)}
        | {"samples": reading.samples, "hidden": reading.hidden},
        "place": [round(float(metres), 5) for metres in mark.place + origin], "note": mark.note,
    }  # fmt: skip


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def now_figures(reading: MarkReading) -> tuple[float, float, float]:
    """Least, mean and most of this view."""
    return reading.now.least, reading.now.mean, reading.now.most


def used_emissivity(reading: MarkReading) -> float:
    """By which a mark's largest value is read; NaN: it is as photographed, or nothing is known."""
    used = reading.emissivity if reading.emissivity is not None else reading.mark.emissivity
    return math.nan if used is None else used


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
