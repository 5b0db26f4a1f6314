"""What a case of `launch.py stability` finds: figures with their bounds, and panels to look at."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

MOST_DB = 200.0  # for pictures that are equal: a table has no infinity
ALPHA_SLACK = 2e-3  # of a coverage summed in half floats: two steps of theirs below 1


@dataclass(frozen=True)
class CaseFinding:
    """One row of the table."""

    figure: str  # what was measured, with its unit
    measured: float
    bound: str  # ">= 40", "<= 2"; "" where the case says nothing about this scene
    holds: bool
    reason: str  # why the bound is where it is

    @property
    def verdict(self) -> str:
        if not self.bound:
            return "does not apply"
        return "holds" if self.holds else "FAILS"

    @property
    def headroom(self) -> float:
        """How far inside its bound, as a part of it; below 0 where it fails, NaN the furthest."""
        if not self.bound:
            return math.inf
        sign, limit = self.bound.split()
        inside = (self.measured - float(limit)) * (1 if sign == ">=" else -1)
        return -math.inf if math.isnan(inside) else inside / max(abs(float(limit)), 1e-9)


@dataclass(frozen=True)
class Panel:
    """A picture with its caption; the first of a case is its worst frame."""

    caption: str
    image: np.ndarray  # (H, W, 3) display sRGB


class ComparedPicture(NamedTuple):
    """A picture and what it was held against; a case shows its worst one."""

    db: float
    what: str
    image: np.ndarray  # (H, W, 4)
    wanted: np.ndarray  # (H, W, 4)


def worst_of(comparisons: Iterable[ComparedPicture]) -> ComparedPicture:
    """The one of the fewest decibels; of equal ones the first."""
    return min(comparisons, key=lambda comparison: comparison.db)


@dataclass(frozen=True)
class Result:
    findings: list[CaseFinding]
    panels: list[Panel]


def at_least(figure: str, measured: float, least: float, reason: str) -> CaseFinding:
    return CaseFinding(figure, float(measured), f">= {least:.4g}", bool(measured >= least), reason)


def at_most(figure: str, measured: float, most: float, reason: str) -> CaseFinding:
    return CaseFinding(figure, float(measured), f"<= {most:.4g}", bool(measured <= most), reason)


def not_here(figure: str, reason: str) -> CaseFinding:
    """The row of a figure that this scene or this machine does not have."""
    return CaseFinding(figure, math.nan, "", True, reason)


def decibels(image: np.ndarray, reference: np.ndarray) -> float:
    """PSNR against a peak of 1, MOST_DB where both are equal; NaN in a picture gives NaN."""
    error = float(np.mean((np.asarray(image, np.float64) - reference) ** 2))
    return MOST_DB if error == 0 else min(-10 * math.log10(error), MOST_DB)


def broken_pixels(*images: np.ndarray) -> int:
    """How many pixels of (H, W, 4) images hold NaN, Inf, or a coverage that is none."""
    return sum(
        int(np.count_nonzero(~(np.isfinite(image).all(axis=2) & covered(image[..., 3]))))
        for image in images
    )


def covered(alpha: np.ndarray) -> np.ndarray:
    return (alpha >= 0) & (alpha <= 1 + ALPHA_SLACK)


def clean(*images: np.ndarray) -> CaseFinding:
    """No pixel that is no colour; every case asks for it."""
    return at_most(
        "broken pixels (not finite, or not covered 0 to 1)", broken_pixels(*images), 0,
        "a NaN stays in a float target for good, and coverage is 0 to 1 (half floats: +0.002)",
    )  # fmt: skip
