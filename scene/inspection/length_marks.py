"""Measured lengths, angles and areas that stay with a scene: their points, and how sure these are.

A point that was picked on a surface keeps its covariance, so that another scale, or another day,
has the same uncertainty.
"""

from dataclasses import dataclass, field

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number
from shapeshift.runtime_models.files.plain_text import LONGEST_NAME, name_line
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.lengths import KINDS, Measurement, Point, Scale, measure
from shapeshift.scene.inspection.marks import FARTHEST

LENGTH_PREFIX = {"distance": "L", "polyline": "Way", "angle": "Angle", "area": "Area"}
MOST_LENGTHS = 1000
MOST_CORNERS = 1000  # of one
DECIMALS = 5  # of metres: a hundredth of a millimetre
DIGITS = 4  # of variances
UPPER = np.triu_indices(3)


@dataclass(frozen=True, eq=False)
class LengthMark:
    """What was measured between points, metres in the world before any scale."""

    name: str
    kind: str  # of lengths.KINDS
    points: np.ndarray  # (n, 3) metres
    covariances: np.ndarray = field(default_factory=lambda: np.zeros((0, 3, 3)))  # (n, 3, 3) m²
    note: str = ""

    def __post_init__(self) -> None:
        """Refuses what is none: ValueError, one sentence."""
        if self.kind not in KINDS:
            raise ValueError(f"there is no measurement '{self.kind}'; known: {', '.join(KINDS)}.")
        points = np.asarray(self.points, np.float64)
        _, least, most, _, _ = KINDS[self.kind]
        if points.ndim != 2 or points.shape[1] != 3 or not least <= len(points) <= most:
            wanted = str(least) if least == most else f"{least} to {most:,}"
            raise ValueError(
                f"the {self.kind} '{self.name}' wants {wanted} points of three metres."
            )
        if not (np.abs(points) <= FARTHEST).all():
            raise ValueError(f"the {self.kind} '{self.name}' has a point that is no place.")
        spread = np.asarray(self.covariances, np.float64)
        spread = spread if len(spread) else np.zeros((len(points), 3, 3))
        good = spread.shape == (len(points), 3, 3) and (np.abs(spread) <= FARTHEST).all()
        if not (good and (np.diagonal(spread, axis1=1, axis2=2) >= 0).all()):
            raise ValueError(f"the {self.kind} '{self.name}' has an uncertainty that is none.")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "covariances", spread)

    def measured(self, scale: Scale) -> Measurement:
        """Its value with one standard deviation."""
        pairs = zip(self.points, self.covariances, strict=True)
        return measure(self.kind, [Point(metres, spread) for metres, spread in pairs], scale)


def length_of(name: str, kind: str, points: list[Point]) -> LengthMark:
    """What lies between picked points.  Raises ValueError, one sentence."""
    places = np.array([point.metres for point in points], np.float64).reshape(-1, 3)
    spread = np.array([point.covariance for point in points], np.float64).reshape(-1, 3, 3)
    return LengthMark(name, kind, places, spread)


def free_length_name(kind: str, taken: list[str]) -> str:
    """L1, L2, Way1, ...: the first that none has."""
    number = 1
    while f"{LENGTH_PREFIX[kind]}{number}" in taken:
        number += 1
    return f"{LENGTH_PREFIX[kind]}{number}"


def read_length(row: Fields) -> LengthMark:
    """One of a file of marks.  Raises BadFile, one sentence."""
    name = row.line("name")
    if name != name_line(name):
        raise row.error("name", f"one line of 1 to {LONGEST_NAME} letters")
    kind = row.text("kind")
    if kind not in KINDS:
        raise row.error("kind", f"one of {', '.join(KINDS)}")
    points = _table(row, "points", 3)
    spread = _table(row, "covariances", 6) if row.has("covariances") else np.zeros((0, 6))
    if len(spread) not in (0, len(points)):
        raise row.error("covariances", "six numbers for each point")
    note = row.line("note", "")
    row.refuse_unknown_keys()
    full = np.zeros((len(spread), 3, 3))
    full[:, UPPER[0], UPPER[1]] = spread
    full[:, UPPER[1], UPPER[0]] = spread
    try:
        return LengthMark(name, kind, points, full, note)
    except ValueError as error:
        raise BadFile(f"{row.where}: {error}") from None


def _table(row: Fields, key: str, columns: int) -> np.ndarray:
    found = row.value(key)
    good = isinstance(found, list) and len(found) <= MOST_CORNERS
    good = good and all(
        isinstance(each, list) and len(each) == columns and all(map(is_number, each))
        for each in found
    )
    if not good:
        raise row.error(key, f"a list of {columns} numbers each, at most {MOST_CORNERS:,},")
    return np.array(found, np.float64).reshape(-1, columns)


def length_row(each: LengthMark) -> dict:
    """As JSON has it; the upper triangle of each point's covariance."""
    row: dict = {"name": each.name, "kind": each.kind}
    row["points"] = (np.round(each.points, DECIMALS) + 0.0).tolist()
    if each.covariances.any():
        upper = each.covariances[:, UPPER[0], UPPER[1]]
        row["covariances"] = [[float(f"{v:.{DIGITS}g}") for v in point] for point in upper]
    return row | ({"note": each.note} if each.note else {})
