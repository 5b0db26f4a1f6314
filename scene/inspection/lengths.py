"""Lengths, angles and areas between points, each with its uncertainty."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

STEP = 1e-6  # metres, of the differences that stand for derivatives
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}  # metres
MOST_DIGITS = 6  # behind the point


@dataclass(frozen=True, eq=False)
class Point:
    """A point in the world."""

    metres: np.ndarray  # (3,)
    covariance: np.ndarray  # (3, 3) metres squared; zeros: exact


@dataclass(frozen=True)
class Measurement:
    """One standard deviation beside the value."""

    kind: str
    value: float
    uncertainty: float
    unit: str  # m, degrees, m²

    def __str__(self) -> str:
        digits = 1 if self.unit == "degrees" else 4
        return f"{self.value:.{digits}f} ± {self.uncertainty:.{digits}f} {self.unit}"

    def words(self, unit: str) -> str:
        """In one of UNITS or its square, with the two digits that are uncertain; degrees stay."""
        power = {"m": 1, "m²": 2}.get(self.unit, 0)
        factor = UNITS[unit] ** power
        value, error = self.value / factor, self.uncertainty / factor
        sure = error if error > 0 else abs(value) / 1000 or 1.0
        digits = min(max(1 - math.floor(math.log10(sure)), 0), MOST_DIGITS)
        name = {0: "°", 1: f" {unit}", 2: f" {unit}²"}[power]
        shown = f"{value:.{digits}f}"
        return f"{shown} ± {error:.{digits}f}{name}" if error > 0 else f"{shown}{name}"


def length(points: np.ndarray) -> float:
    """Metres along points (n, 3)."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def angle(points: np.ndarray) -> float:
    """Degrees at the second of points (3, 3)."""
    a, b = points[0] - points[1], points[2] - points[1]
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def area(points: np.ndarray) -> float:
    """Square metres of the polygon (n, 3); of one that is not flat, of its shadow on the plane on
    which that is largest (half the length of the sum of cross products).
    """
    shifted = points - points.mean(axis=0)
    return float(np.linalg.norm(np.cross(shifted, np.roll(shifted, -1, axis=0)).sum(axis=0)) / 2)


# kind: (function, least points, most points, unit, power of the scale)
KINDS: dict[str, tuple[Callable[[np.ndarray], float], int, int, str, int]] = {
    "distance": (length, 2, 2, "m", 1),
    "polyline": (length, 2, 1000, "m", 1),
    "angle": (angle, 3, 3, "degrees", 0),
    "area": (area, 3, 1000, "m²", 2),
}


@dataclass(frozen=True)
class Scale:
    """What lengths of the scene are multiplied by, and its standard deviation as a part of it."""

    factor: float = 1.0
    error: float = 0.0

    @staticmethod
    def of_known(points: list[Point], metres: float) -> "Scale":
        """The scale that makes a length between two points what it is known to be.

        Raises ValueError, one sentence.
        """
        measured = measure("distance", points)
        if not (np.isfinite(metres) and metres > 0):
            raise ValueError(f"the known length is {metres:g}; metres above 0 are wanted.")
        if not measured.value > 0:
            raise ValueError(
                "the two points of the known length are one; choose two that are apart."
            )
        return Scale(metres / measured.value, measured.uncertainty / measured.value)


def measure(kind: str, points: list[Point], scale: Scale = Scale()) -> Measurement:
    """What is between points.  The points' errors are independent of each other and of the scale's,
    and small: to first order.  Raises ValueError, one sentence.
    """
    if kind not in KINDS:
        raise ValueError(f"there is no measurement '{kind}'; known are {', '.join(KINDS)}.")
    function, least, most, unit, power = KINDS[kind]
    if not least <= len(points) <= most:
        wanted = str(least) if least == most else f"{least} or more"
        raise ValueError(f"{kind} has {len(points)} points, {wanted} are wanted.")
    places = np.array([point.metres for point in points], np.float64)  # (n, 3)
    if not np.isfinite(places).all():
        raise ValueError(
            f"{kind} has a point where the scene covers less than half of a pixel; move it."
        )
    value, variance = function(places), 0.0
    for i, point in enumerate(points):
        slope = np.zeros(3)
        for axis in range(3):
            moved = [places.copy(), places.copy()]
            moved[0][i, axis] += STEP
            moved[1][i, axis] -= STEP
            slope[axis] = (function(moved[0]) - function(moved[1])) / (2 * STEP)
        variance += float(slope @ point.covariance @ slope)
    factor = scale.factor**power
    error = np.hypot(np.sqrt(max(variance, 0.0)) * factor, power * scale.error * value * factor)
    return Measurement(kind, value * factor, float(error), unit)
