"""NAME.marks.json beside a scene: marks, differences and isotherms, strictly read."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, cast

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number, read_json
from shapeshift.runtime_models.files.plain_text import LONGEST_NAME, json_text, name_line
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.air import NO_AIR, Air
from shapeshift.scene.inspection.emissivity import (
    LEAST_C,
    LEAST_EMISSIVITY,
    MOST_C,
    Emission,
    SurfaceRadiation,
)
from shapeshift.scene.inspection.laying import Laying, laying_row, moved_laying, read_laying
from shapeshift.scene.inspection.length_marks import (
    MOST_LENGTHS,
    LengthMark,
    length_row,
    read_length,
)
from shapeshift.scene.inspection.lengths import Scale
from shapeshift.scene.inspection.mark_photos import photo_text, read_photo
from shapeshift.scene.inspection.marks import (
    FARTHEST,
    KINDS,
    MOST_MARKS,
    MOST_POINTS,
    Isotherm,
    Mark,
    pixels_inside,
    read_pixels,
)
from shapeshift.scene.inspection.value_picture import ValuePicture

MARK = "shapeshift_marks"
VERSION = 1
ENDING = ".marks.json"
MOST_BYTES = 8 << 20
DECIMALS = 5  # of metres: a hundredth of a millimetre
ADVICE = "see docs/formats.md"
MOST_VALUE = 1e6  # of an isotherm
SHARE_WANTED = f"a number from {LEAST_EMISSIVITY:g} to 1"
BOUNDS: dict[str, tuple[str, ...]] = {
    "above": ("low",),
    "below": ("high",),
    "between": ("low", "high"),
}


@dataclass(frozen=True)
class HeldOutError:
    """How far values are from photos that no training has seen."""

    mean: float
    percentile_95: float
    photos: int

    def words(self, unit: str, digits: int = 1) -> str:
        """One sentence; digits: of values for people, an error has one more."""
        mean, most = (
            f"{e:.{digits + 1}f} {unit}".rstrip() for e in (self.mean, self.percentile_95)
        )
        return (
            f"on {self.photos} held-out photos {mean} in the mean, 95 of 100 pixels within {most}"
        )


@dataclass(frozen=True)
class MarksFile:
    """What is measured in a scene; metres of the world of its file."""

    marks: tuple[Mark, ...] = ()
    differences: tuple[tuple[str, str], ...] = ()  # names: the first less the second
    isotherms: tuple[Isotherm, ...] = ()
    metres_per_unit: float = 1.0  # what a length of the scene is multiplied by
    held_out: HeldOutError | None = None  # as it was measured last
    emission: Emission | None = None  # by which values are corrected; None: as photographed
    lengths: tuple[LengthMark, ...] = ()
    scale_error: float = 0.0  # one standard deviation of the scale, as a part of it
    objects: tuple[tuple[str, float], ...] = ()  # names of objects with emissivities of their own

    def of_surfaces(self, picture: ValuePicture) -> ValuePicture:
        """A picture's values with all that is said of emissivity: the one way to what is shown."""
        return surface_picture(picture, self.emission, self.marks, dict(self.objects))

    @property
    def scale(self) -> Scale:
        """Of its lengths."""
        return Scale(self.metres_per_unit, self.scale_error)

    def named(self, name: str) -> Mark:
        """The mark of that name.  KeyError: there is none."""
        return {mark.name: mark for mark in self.marks}[name]


def surface_picture(
    picture: ValuePicture, emission: Emission | None, marks: Sequence[Mark] = (),
    objects: Mapping[str, float] = {},
) -> ValuePicture:  # fmt: skip
    """What all doors read: values with each surface's own emissivity, which is a mark's where it
    has one (a later mark lies above), else the object's (objects: by name), else the emission's.

    Where nothing is said of emissivity, or values are no temperatures, they are as photographed.
    """
    plain = picture.as_photographed()
    own = [mark for mark in marks if mark.emissivity is not None]
    if not plain.is_temperature or (emission is None and not own and not objects):
        return plain
    known, share = emission or Emission(), np.full(plain.values.shape, np.nan)  # (H, W)
    for number, name in enumerate(plain.owner_names):
        if name in objects and plain.owners is not None:
            share[plain.owners == number] = objects[name]
    beneath = plain.corrected(known, share.copy() if np.isfinite(share).any() else None)
    beneath = replace(beneath, by_object=dict(objects))
    if not own:
        return beneath
    for mark in own:
        columns, rows = read_pixels(mark, plain).T
        share[rows, columns] = mark.emissivity
    corrected = plain.corrected(known, share)
    return replace(corrected, by_object=beneath.by_object, beneath=beneath)


def laid(mark: Mark, picture: ValuePicture) -> Mark:
    """The mark with what this picture reads as its value."""
    plain = picture.as_photographed()
    if mark.kind in ("spot", "line"):
        pixels, values = plain.pixel_of(mark.points)[0], plain.values_at(mark.points)
    else:
        rows, columns = pixels_inside(mark, plain)
        pixels, values = np.stack([columns, rows], axis=1) + 0.5, plain.values[rows, columns]
    known = np.isfinite(values)
    owners = plain.owner_at(pixels[known])
    return replace(mark, laid=Laying.of(plain, values[known], owners))


def marks_path(scene: Path) -> Path:
    """Where the marks of a scene lie: beside it."""
    name = (
        scene.name.removesuffix(".scene.json") if scene.name.endswith(".scene.json") else scene.stem
    )
    return scene.with_name(f"{name or scene.name}{ENDING}")


def kept_scale(scene: Path) -> Scale:
    """What lengths of a scene are multiplied by, as the marks beside it say; 1: there are none.

    Raises BadFile, one sentence.
    """
    path = marks_path(scene)
    return read_marks_file(path).scale if path.exists() else Scale()


def read_marks_file(path: Path) -> MarksFile:
    """Raises BadFile, one sentence."""
    return marks_of(read_json(path, most_bytes=MOST_BYTES, unique=True), path.name)


def marks_of(data: object, name: str) -> MarksFile:
    """What such a file holds, of what JSON gives; name: for messages.  Raises BadFile."""
    fields = Fields(data, name, ADVICE)
    fields.count(MARK, VERSION, VERSION)
    scale = fields.number("metres_per_unit", 1.0, "a number from 1e-6 to 1e6", 1e-6, 1e6)
    scale_error = fields.number("scale_error", 0.0, "a number from 0 to 1", 0, 1)
    marks = tuple(_mark(row) for row in fields.rows("marks", MOST_MARKS, "mark"))
    lengths = tuple(read_length(row) for row in fields.rows("lengths", MOST_LENGTHS, "length"))
    names = [mark.name for mark in marks]
    for what, taken in (("marks", names), ("lengths", [each.name for each in lengths])):
        twice = next((each for each, count in Counter(taken).items() if count > 1), None)
        if twice is not None:
            raise BadFile(f"{name}: two {what} are called '{twice}'; rename one, {ADVICE}.")
    pairs = tuple(_pair(row, names) for row in fields.rows("differences", MOST_MARKS, "difference"))
    isotherms = tuple(_isotherm(row) for row in fields.rows("isotherms", MOST_MARKS, "isotherm"))
    error = fields.optional_object("held_out")
    held_out = None if error is None else _held_out(error)
    emission = fields.optional_object("emission")
    corrected = None if emission is None else _emission(emission)
    objects = tuple(_object(row) for row in fields.rows("objects", MOST_MARKS, "object"))
    fields.refuse_unknown_keys()
    return MarksFile(
        marks, pairs, isotherms, scale, held_out, corrected, lengths, scale_error, objects
    )


def _mark(row: Fields) -> Mark:
    name = row.line("name")
    if name != name_line(name):
        raise row.error("name", f"one line of 1 to {LONGEST_NAME} letters")
    kind = row.text("kind")
    if kind not in KINDS:
        raise row.error("kind", f"one of {', '.join(KINDS)}")
    points = row.value("points")
    good = isinstance(points, list) and len(points) <= MOST_POINTS
    good = good and all(
        isinstance(p, list) and len(p) == 3 and all(map(is_number, p)) for p in points
    )
    if not good:
        raise row.error("points", f"a list of [x, y, z] in metres, at most {MOST_POINTS:,},")
    radius = row.number("radius", 0.0, "metres above 0", 0.0, FARTHEST) if kind == "circle" else 0.0
    note = row.line("note", "")
    photo = read_photo(row)
    share = row.number("emissivity", None, SHARE_WANTED, LEAST_EMISSIVITY, 1)
    when = row.optional_object("laid")
    laid = None if when is None else read_laying(when)
    row.refuse_unknown_keys()
    try:
        return Mark(name, kind, np.array(points, np.float64), radius, note, share, photo, laid)
    except ValueError as error:
        raise BadFile(f"{row.where}: {error}") from None


def _object(row: Fields) -> tuple[str, float]:
    name = row.line("name")
    share = row.number("emissivity", wanted=SHARE_WANTED, low=LEAST_EMISSIVITY, high=1)
    row.refuse_unknown_keys()
    return name, share


def _pair(row: Fields, names: list[str]) -> tuple[str, str]:
    pair = (row.text("of"), row.text("less"))
    for key, name in zip(("of", "less"), pair, strict=True):
        if name not in names:
            raise row.error(key, "the name of a mark of this file")
    row.refuse_unknown_keys()
    return pair


def _isotherm(row: Fields) -> Isotherm:
    kind = row.text("kind")
    if kind not in BOUNDS:
        raise row.error("kind", f"one of {', '.join(BOUNDS)}")
    ends = {
        key: row.number(key, wanted="a value", low=-MOST_VALUE, high=MOST_VALUE)
        for key in BOUNDS[kind]
    }
    row.refuse_unknown_keys()
    try:
        return Isotherm(cast(Literal["above", "below", "between"], kind), **ends)
    except ValueError as error:
        raise BadFile(f"{row.where}: {error}") from None


def _held_out(row: Fields) -> HeldOutError:
    mean, high = (row.number(key, wanted="0 or more", low=0) for key in ("mean", "percentile_95"))
    photos = row.count("photos", 1, 1_000_000)
    row.refuse_unknown_keys()
    return HeldOutError(mean, high, photos)


def _emission(row: Fields) -> Emission:
    taken = row.optional_object("taken")
    surface, air = _surface(row), _air(row)
    row.refuse_unknown_keys()
    if taken is None:
        return Emission(surface, air=air)
    camera, camera_air = _surface(taken), _air(taken)
    taken.refuse_unknown_keys()
    return Emission(surface, camera, air, camera_air)


def _air(row: Fields) -> Air:
    """'air': metres, per cent and °C; none where it is not there."""
    if not row.has("air"):
        return NO_AIR
    try:
        return Air(*row.numbers("air", 3))
    except ValueError as error:
        raise BadFile(f"{row.where}: {error}") from None


def _emission_row(emission: Emission) -> dict:
    surface, taken = (
        vars(radiation) | ({"air": list(vars(air).values())} if air.distance_m > 0 else {})
        for radiation, air in (
            (emission.surface, emission.air), (emission.taken, emission.taken_air)
        )
    )  # fmt: skip
    return surface | {"taken": taken}


def _surface(row: Fields) -> SurfaceRadiation:
    share = row.number("emissivity", 1.0, SHARE_WANTED, LEAST_EMISSIVITY, 1)
    mirrored = row.number(
        "reflected", 20.0, f"a value from {LEAST_C:g} to {MOST_C:g}", LEAST_C, MOST_C
    )
    return SurfaceRadiation(share, mirrored)


def moved_marks(file: MarksFile, by: np.ndarray) -> MarksFile:
    """The same with every mark moved by (3,) metres: into another world's zero."""
    marks = tuple(
        replace(mark, points=mark.points + by, laid=moved_laying(mark.laid, by))
        for mark in file.marks
    )
    lengths = tuple(replace(each, points=each.points + by) for each in file.lengths)
    return replace(file, marks=marks, lengths=lengths)


def marks_rows(file: MarksFile) -> dict:
    """The file as JSON has it."""
    marks = []
    for mark in file.marks:
        row: dict = {"name": mark.name, "kind": mark.kind}
        row["points"] = (np.round(mark.points, DECIMALS) + 0.0).tolist()
        row |= {"radius": round(float(mark.radius_m), 7)} if mark.kind == "circle" else {}
        row |= {"note": mark.note} if mark.note else {}
        row |= {"photo": photo_text(mark.photo)} if mark.photo else {}
        row |= {"laid": laying_row(mark.laid)} if mark.laid is not None else {}
        marks.append(row | ({} if mark.emissivity is None else {"emissivity": mark.emissivity}))
    rows: dict = {MARK: VERSION, "marks": marks}
    rows["differences"] = [{"of": a, "less": b} for a, b in file.differences]
    rows["isotherms"] = [
        {"kind": each.kind} | {key: float(getattr(each, key)) for key in BOUNDS[each.kind]}
        for each in file.isotherms
    ]
    if file.metres_per_unit != 1:
        rows["metres_per_unit"] = float(file.metres_per_unit)
    if file.scale_error > 0:
        rows["scale_error"] = float(file.scale_error)
    if file.held_out is not None:
        rows["held_out"] = vars(file.held_out)
    if file.emission is not None:
        rows["emission"] = _emission_row(file.emission)
    if file.objects:
        rows["objects"] = [{"name": name, "emissivity": share} for name, share in file.objects]
    if file.lengths:
        rows["lengths"] = [length_row(each) for each in file.lengths]
    return rows


def write_marks_file(file: MarksFile, path: Path) -> None:
    """Whole or not at all."""
    write_whole(path, marks_bytes(file))


def marks_bytes(file: MarksFile) -> bytes:
    """What is written."""
    return (json_text(marks_rows(file)) + "\n").encode()
