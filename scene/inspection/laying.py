"""The laying of a mark: what it read when it was laid, from where, and when.  This is its value.

Kept are values as photographed, so that emissivity and air may be said later: of up to GROUPS
samples each one, of more their means in groups of equal count, from the coldest to the hottest, and
the ends themselves; by object, since each has an emissivity of its own.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number
from shapeshift.runtime_models.files.plain_text import LONGEST_NAME
from shapeshift.scene.cameras.camera_list import CameraList, CameraReading, moved
from shapeshift.scene.cameras.own_cameras import own_rows, read_row
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

GROUPS = 64
MOST_OBJECTS = 256
MOST_SAMPLES = 1 << 30
MOMENT = re.compile(r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}")
DECIMALS = 6  # of values; a palette's step is a thousand times as much


@dataclass(frozen=True)
class MarkFigures:
    """What a view reads at a mark; NaN where nothing is seen of it."""

    least: float = np.nan
    mean: float = np.nan
    most: float = np.nan
    # What the ends of the photos' range stand for on the surfaces of the least and the most.
    ends: tuple[float, float] = (-np.inf, np.inf)


@dataclass(frozen=True, eq=False)
class LaidPart:
    """Of one object: samples in rising groups whose counts differ by one, the larger ones first."""

    object: str  # name; "": what belongs to none
    samples: int
    ends: tuple[float, float]
    means: np.ndarray  # (n,) as photographed, n at most GROUPS

    @staticmethod
    def of(name: str, values: np.ndarray) -> "LaidPart":
        """values (n,), one at least."""
        values = np.sort(values)
        groups = np.array_split(values, min(GROUPS, len(values)))
        means = np.array([group.mean() for group in groups])
        return LaidPart(name, len(values), (float(values[0]), float(values[-1])), means)

    @property
    def counts(self) -> np.ndarray:
        """(n,) samples of each group."""
        each, more = divmod(self.samples, len(self.means))
        return each + (np.arange(len(self.means)) < more)


@dataclass(frozen=True, eq=False)
class Laying:
    """When a mark was laid, in which view, and what was read there."""

    moment: str  # local time, 2026-11-29T14:05:00
    view: View
    stop: str  # that was measured
    unit: str
    value_range: tuple[float, float]  # of the stop
    parts: tuple[LaidPart, ...]

    @staticmethod
    def of(picture: ValuePicture, values: np.ndarray, owners: np.ndarray) -> "Laying | None":
        """Of samples (n,) as photographed and whose they are, (n,) places in `owner_names`; None:
        there are no samples.
        """
        if not len(values):
            return None
        names = picture.owner_names
        parts = tuple(
            LaidPart.of(names[owner] if owner >= 0 else "", values[owners == owner])
            for owner in np.unique(owners)
        )
        moment = datetime.now().isoformat(timespec="seconds")
        kept = picture.photographed_range or picture.value_range
        return Laying(moment, picture.view, picture.stop, picture.unit, kept, parts)

    def is_of(self, picture: ValuePicture) -> bool:
        """Whether its values are of what the picture measures."""
        kept = picture.photographed_range or picture.value_range
        mine = (self.stop, self.unit, self.value_range)
        return mine == (picture.stop, picture.unit, tuple(kept))

    def figures(
        self, picture: ValuePicture, emissivity: float | None
    ) -> tuple[MarkFigures, float | None]:
        """As the picture is corrected now, and by which emissivity its largest value is.

        emissivity: of the mark itself; None: that of the surface.
        """
        emission, unit = picture.emission, self.unit
        found: list[tuple[float, float, float, float, float | None]] = []
        total = counted = 0.0
        for part in self.parts:
            low, high = part.ends
            means, first, last = part.means, *self.value_range
            own: float | None = None
            if emission is not None:
                own = emissivity or picture.by_object.get(part.object, emission.surface.emissivity)
                numbers = np.array([low, high, first, last, *means])
                low, high, first, last, *rest = emission.corrected(numbers, unit, own)
                means = np.array(rest)
            known = np.isfinite(means)  # not where less arrives than is mirrored
            if not known.any():
                continue
            total += float(part.counts[known] @ means[known])
            counted += float(part.counts[known].sum())
            low = low if np.isfinite(low) else float(means[known].min())
            found.append((low, high, first, last, own))
        if not found:
            return MarkFigures(), emissivity
        coldest = min(found, key=lambda each: each[0])
        hottest = max(found, key=lambda each: each[1])
        first, mean = coldest[2], total / counted
        ends = (float(first) if np.isfinite(first) else -np.inf, float(hottest[3]))
        return MarkFigures(float(coldest[0]), mean, float(hottest[1]), ends), hottest[4]

    def of_objects(self, names: Mapping[str, str]) -> "Laying":
        """The same with objects under other names; itself where it has none of them."""
        if not any(part.object in names for part in self.parts):
            return self
        parts = (replace(part, object=names.get(part.object, part.object)) for part in self.parts)
        return replace(self, parts=tuple(parts))

    def words(self) -> str:
        """The moment for people: 2026-11-29 14:05."""
        return self.moment[:16].replace("T", " ")


def moved_laying(laying: Laying | None, by: np.ndarray) -> Laying | None:
    """The same in another world's zero."""
    return laying and replace(laying, view=moved([laying.view], np.asarray(by).tolist())[0])


# Of a file of marks.


def laying_row(laying: Laying) -> dict:
    """As JSON has it."""
    parts = [
        ({"object": part.object} if part.object else {})
        | {"samples": part.samples, "ends": _rounded(part.ends), "means": _rounded(part.means)}
        for part in laying.parts
    ]
    (view,) = own_rows(CameraList((laying.view,), ("",), ""))
    return {
        "moment": laying.moment, "stop": laying.stop,
        **({"unit": laying.unit} if laying.unit else {}),
        "range": list(laying.value_range), "view": view, "values": parts,
    }  # fmt: skip


def read_laying(row: Fields) -> Laying:
    """Raises BadFile, one sentence."""
    moment = row.text("moment")
    if not MOMENT.fullmatch(moment):
        raise row.error("moment", "a time such as 2026-11-29T14:05:00")
    stop, unit, value_range = row.line("stop"), row.line("unit", ""), row.pair("range")
    camera = row.object("view")
    view = read_row(camera, CameraReading())
    parts = tuple(_part(each) for each in row.rows("values", MOST_OBJECTS, "part"))
    if not parts:
        raise row.error("values", "a list of what was read, of each object,")
    row.refuse_unknown_keys()
    return Laying(moment, view, stop, unit, value_range, parts)


def _part(row: Fields) -> LaidPart:
    name = row.line("object", "")
    samples = row.count("samples", 1, MOST_SAMPLES)
    low, high = row.numbers("ends", 2)
    means = row.value("means")
    count = min(GROUPS, samples)
    if not (isinstance(means, list) and len(means) == count and all(map(is_number, means))):
        raise row.error("means", f"a list of {count} finite numbers")
    if not (low <= high and len(name) <= LONGEST_NAME):
        raise row.error("ends", "[lowest, highest]")
    row.refuse_unknown_keys()
    return LaidPart(name, samples, (low, high), np.array(means, np.float64))


def _rounded(numbers: Sequence[float] | np.ndarray) -> list[float]:
    return [round(float(number), DECIMALS) for number in numbers]
