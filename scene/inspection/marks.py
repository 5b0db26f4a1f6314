"""Marks: spots, lines, circles and boxes that stand in the world, and what a view reads at them."""

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from shapeshift.scene.inspection.emissivity import LEAST_EMISSIVITY, Emission
from shapeshift.scene.inspection.laying import Figures, Laying
from shapeshift.scene.inspection.value_picture import (
    HIDDEN_M,
    HIDDEN_PART,
    ValuePicture,
    world_points,
)

PREFIX = {"spot": "Sp", "line": "Li", "circle": "Ci", "box": "Ar"}  # as thermographers number them
MOST_MARKS = 1000
MOST_POINTS = 1024  # of a line
LINE_POINTS = 256  # of one that is laid over a picture
FARTHEST = 1e7  # metres
SLACK = 0.01  # part of a box's depth, and of that depth itself: its own pixels stay inside
Kind = Literal["spot", "line", "circle", "box"]
KINDS: tuple[Kind, ...] = ("spot", "line", "circle", "box")
Bound = Literal["above", "below", "between"]
# Something stands before it; its surface is not there any more; it lies beside the picture.
BEHIND, GONE, OUTSIDE = HIDDEN = ("hidden", "surface gone", "outside the view")
# The corners of the six faces of a box: near ones 0 1 2 3 around, far ones 4 5 6 7 behind them.
FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


@dataclass(frozen=True, eq=False)
class Mark:
    """A place to be measured, metres in the world: every view that sees it finds it again.

    points (n, 3): of a spot itself; of a line where it lies on the surface, in order; of a circle
    the centre of the ball that it is; of a box its eight corners, the near four around, then the
    far four behind them.
    """

    name: str
    kind: Kind
    points: np.ndarray
    radius_m: float = 0.0  # of a circle
    note: str = ""
    emissivity: float | None = None  # of its surface; None: as the picture has it
    photo: bytes = b""  # a small JPEG of it, for reports
    laid: Laying | None = None  # what it read when it was laid: its value; None: as a view reads it

    def __post_init__(self) -> None:
        """Refuses what is none: ValueError, one sentence."""
        points = np.asarray(self.points, np.float64)
        least, most = {"spot": (1, 1), "line": (2, MOST_POINTS), "circle": (1, 1), "box": (8, 8)}[
            self.kind
        ]
        if points.ndim != 2 or points.shape[1] != 3 or not least <= len(points) <= most:
            wanted = f"{least} to {most}" if most > least else f"{least}"
            raise ValueError(
                f"the {self.kind} '{self.name}' wants {wanted} points of three metres."
            )
        if not (np.abs(points) <= FARTHEST).all():
            raise ValueError(
                f"the {self.kind} '{self.name}' has a point that is no place in metres."
            )
        if self.kind == "circle" and not 0 < self.radius_m <= FARTHEST:
            raise ValueError(
                f"the circle '{self.name}' has the radius {self.radius_m:.3g}; metres above 0 "
                "are wanted."
            )
        if self.emissivity is not None and not LEAST_EMISSIVITY <= self.emissivity <= 1:
            raise ValueError(
                f"the {self.kind} '{self.name}' has the emissivity {self.emissivity:.3g}; "
                f"{LEAST_EMISSIVITY:g} to 1 is wanted."
            )
        if self.kind == "box" and not _is_convex(points):
            raise ValueError(f"the box '{self.name}' has eight corners that are none of a box.")
        object.__setattr__(self, "points", points)

    @property
    def place(self) -> np.ndarray:
        """(3,) metres: its middle."""
        return self.points.mean(axis=0)

    def holds(self, points: np.ndarray) -> np.ndarray:
        """(...) bool: which world points (..., 3) lie in a circle or a box."""
        if self.kind == "circle":
            with np.errstate(invalid="ignore"):
                return np.linalg.norm(points - self.points[0], axis=-1) <= self.radius_m
        inside = np.ones(points.shape[:-1], bool)
        for normal, distance in _planes(self.points):
            with np.errstate(invalid="ignore"):
                inside &= points @ normal <= distance
        return inside


@dataclass(frozen=True, eq=False)
class MarkReading:
    """A mark's value, in the picture's unit, and what one view reads there.

    least, mean, most are those of the laying where the mark has one, else this view's; NaN where
    nothing is known.
    """

    mark: Mark
    least: float = math.nan
    mean: float = math.nan
    most: float = math.nan
    samples: int = 0  # of this view: pixels, of a line points
    depth_m: float = math.nan  # of its middle, along the view
    hottest: tuple[float, float] | None = None  # column, row of the largest value
    profile: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))  # (n, 2) metres, value
    now: Figures = field(default_factory=Figures)  # of this view
    ends: tuple[float, float] = (-math.inf, math.inf)  # of what photos showed, at least and most
    emissivity: float | None = None  # of its largest value; None: as photographed, or not known
    hidden: str = ""  # why this view reads nothing: one of HIDDEN; "": it does, or it cannot know

    @property
    def value(self) -> float:
        """The one that stands beside its name: of a spot its own, else the largest."""
        return self.mean if self.mark.kind == "spot" else self.most

    @property
    def value_now(self) -> float:
        """The same as this view reads it."""
        return self.now.mean if self.mark.kind == "spot" else self.now.most


@dataclass(frozen=True)
class Isotherm:
    """An alarm: all that is above, below or between values of the scene's unit."""

    kind: Bound
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        """Refuses what bounds nothing: ValueError, one sentence."""
        if not self.low < self.high:
            raise ValueError(
                f"an isotherm goes from {self.low:g} to {self.high:g}; two numbers are wanted, the "
                "lower value first."
            )

    def holds(self, values: np.ndarray) -> np.ndarray:
        """(...) bool of values (...); what is not known is never in it."""
        with np.errstate(invalid="ignore"):
            if self.kind == "above":
                return values > self.low
            if self.kind == "below":
                return values < self.high
            return (values >= self.low) & (values <= self.high)

    def words(self, unit: str) -> str:
        """Such as "above 60 °C"."""
        if self.kind == "between":
            return f"{self.low:g} to {self.high:g} {unit}".rstrip()
        return f"{self.kind} {self.low if self.kind == 'above' else self.high:g} {unit}".rstrip()


def read_mark(mark: Mark, picture: ValuePicture) -> MarkReading:
    """The value of a mark, and what a view reads there.

    A spot is read between the nearest pixels.  A circle or box has all pixels whose surface lies in
    it: what stands before or behind it does not count.  A mark with an emissivity of its own is
    read at that (nothing is, where the values are no temperatures), another one at its surface's.
    """
    if mark.emissivity is None:
        picture = picture.beneath or picture
    else:
        if not picture.is_temperature:
            return MarkReading(mark)
        corrected = picture.corrected(picture.emission or Emission(), mark.emissivity)
        picture = replace(corrected, by_object=picture.by_object)
    read = _read_now(mark, picture)
    if not read.samples:
        read = replace(read, hidden=_why_hidden(mark, picture))
    if mark.laid is None or not mark.laid.is_of(picture):
        return read
    laid, share = mark.laid.figures(picture, mark.emissivity)
    return replace(
        read, least=laid.least, mean=laid.mean, most=laid.most, ends=laid.ends, emissivity=share
    )


def _read_now(mark: Mark, picture: ValuePicture) -> MarkReading:
    depth = float(picture.pixel_of(mark.place[None])[1][0])
    if mark.kind == "spot":
        value = float(picture.values_at(mark.points)[0])
        if not np.isfinite(value):
            return MarkReading(mark, depth_m=depth)
        pixel = tuple(picture.pixel_of(mark.points)[0][0])
        now = Figures(value, value, value, picture.ends_at(pixel))
        return _reading_of(mark, picture, now, 1, depth, pixel)
    if mark.kind == "line":
        return _read_line(mark, picture, depth)
    rows, columns = pixels_inside(mark, picture)
    if not len(rows):
        return MarkReading(mark, depth_m=depth)
    values = picture.values[rows, columns]
    depth = float(np.median(picture.depth_m[rows, columns]))
    pixels = np.stack([columns, rows], axis=1) + 0.5
    coldest, hottest = (tuple(pixels[int(f(values))]) for f in (np.argmin, np.argmax))
    ends = (picture.ends_at(coldest)[0], picture.ends_at(hottest)[1])
    now = Figures(float(values.min()), float(values.mean()), float(values.max()), ends)
    return _reading_of(mark, picture, now, len(values), depth, hottest)


def _reading_of(
    mark: Mark, picture: ValuePicture, now: Figures, samples: int, depth_m: float,
    hottest: tuple[float, float],
) -> MarkReading:  # fmt: skip
    share = mark.emissivity or picture.emissivity_at(hottest)
    return MarkReading(
        mark, now.least, now.mean, now.most, samples, depth_m, hottest, now=now, ends=now.ends,
        emissivity=share,
    )  # fmt: skip


def pixels_inside(mark: Mark, picture: ValuePicture) -> tuple[np.ndarray, np.ndarray]:
    """(n,) rows and columns of what is known of a circle or a box."""
    rows, columns = _pixels_of(mark, picture)
    known = np.isfinite(picture.values[rows, columns] + picture.depth_m[rows, columns])
    inside = mark.holds(picture.points[rows, columns]) & known
    down, across = np.nonzero(inside)
    return down + rows.start, across + columns.start


def read_pixels(mark: Mark, picture: ValuePicture) -> np.ndarray:
    """(n, 2) int columns and rows of all that a mark is read from."""
    if mark.kind in ("circle", "box"):
        return np.stack(pixels_inside(mark, picture)[::-1], axis=1)
    height, width = picture.values.shape
    places = picture.pixel_of(mark.points)[0][picture.sees(mark.points)]
    around = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    low = np.floor(places - 0.5).astype(int)
    return np.clip(low[:, None] + around, 0, (width - 1, height - 1)).reshape(-1, 2)


def _why_hidden(mark: Mark, picture: ValuePicture) -> str:
    """One of HIDDEN; "": its surface is there, with nothing known of it."""
    corners = mark.points
    if mark.kind == "circle":
        corners = box_around("", corners[0], np.full(3, mark.radius_m)).points
    pixels, depths = picture.pixel_of(corners)
    height, width = picture.values.shape
    with np.errstate(invalid="ignore"):
        within = np.all((pixels >= 0) & (pixels < (width, height)), axis=1)
    if mark.kind in ("spot", "line"):
        shown, near = picture.at(picture.depth_m, pixels)[within], depths[within]
        far = near
    else:
        rows, columns = _pixels_of(mark, picture)
        shown = picture.depth_m[rows, columns].ravel()
        near, far = np.nanmin(depths, initial=np.inf), np.nanmax(depths, initial=-np.inf)
    if not shown.size or not np.isfinite(depths).any():
        return OUTSIDE
    with np.errstate(invalid="ignore"):
        before = shown < near * (1 - HIDDEN_PART) - HIDDEN_M
        after = ~(shown <= far * (1 + HIDDEN_PART) + HIDDEN_M)
    if not (before | after).any():
        return ""
    return BEHIND if before.sum() >= after.sum() else GONE


def _pixels_of(mark: Mark, picture: ValuePicture) -> tuple[slice, slice]:
    """Rows and columns outside of which no pixel can lie in a circle or a box: of its corners, a
    ball's being those of a cube around it.  All, where one of them is behind the eye.
    """
    corners = mark.points
    if mark.kind == "circle":
        corners = box_around("", corners[0], np.full(3, mark.radius_m)).points
    pixels, _ = picture.pixel_of(corners)
    height, width = picture.values.shape
    if not np.isfinite(pixels).all():
        return slice(0, height), slice(0, width)
    low = np.clip(np.floor(pixels.min(axis=0)) - 1, 0, (width, height)).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 1, 0, (width, height)).astype(int)
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def _read_line(mark: Mark, picture: ValuePicture, depth: float) -> MarkReading:
    steps = np.linalg.norm(np.diff(mark.points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])  # (n,) metres along the line
    values = picture.values_at(mark.points)
    profile = np.stack([way, values], axis=1)
    known = np.isfinite(values)
    if not known.any():
        return MarkReading(mark, depth_m=depth, profile=profile)
    ends = mark.points[[int(np.nanargmin(values)), int(np.nanargmax(values))]]
    low, mean, high = (float(f(values)) for f in (np.nanmin, np.nanmean, np.nanmax))
    coldest, hottest = (tuple(pixel) for pixel in picture.pixel_of(ends)[0])
    bounds = (picture.ends_at(coldest)[0], picture.ends_at(hottest)[1])
    now = Figures(low, mean, high, bounds)
    found = _reading_of(mark, picture, now, int(known.sum()), depth, hottest)
    return replace(found, profile=profile)


# ---- Marks that are made in a picture: ValueError, one sentence, where nothing is under them.


def spot_at(name: str, picture: ValuePicture, pixel: tuple[float, float]) -> Mark:
    """The spot under a pixel (column, row)."""
    point = picture.pick(pixel)
    if not np.isfinite(point).all():
        raise ValueError(
            f"{name} lies at pixel {pixel[0]:g},{pixel[1]:g}, {_nothing_at(picture, pixel)}"
        )
    return Mark(name, "spot", point[None])


def circle_at(
    name: str, picture: ValuePicture, pixel: tuple[float, float], radius_px: float
) -> Mark:
    """All within a radius of the place under a pixel; radius_px: in pixels at its depth."""
    centre = spot_at(name, picture, pixel).points
    _, fx, _, _, _ = picture.view.pinhole()
    depth = float(picture.pixel_of(centre)[1][0])
    return Mark(name, "circle", centre, radius_px * depth / fx)


def line_at(name: str, picture: ValuePicture, ends: np.ndarray) -> Mark:
    """The line between two pixels, ends (2, 2) column and row, laid onto the surface."""
    count = int(np.clip(np.ceil(np.linalg.norm(ends[1] - ends[0])) + 1, 2, LINE_POINTS))
    pixels = ends[0] + np.linspace(0, 1, count)[:, None] * (ends[1] - ends[0])
    points = world_points(picture.view, pixels, picture.at(picture.depth_m, pixels))
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 2:
        raise ValueError(f"{name} goes over nothing that the scene covers by a half; move it.")
    return Mark(name, "line", points)


def box_at(
    name: str, picture: ValuePicture, low: tuple[float, float], high: tuple[float, float]
) -> Mark:
    """All that a rectangle of pixels from `low` to `high` (column, row) sees of the scene."""
    columns, rows = np.sort([low[0], high[0]]), np.sort([low[1], high[1]])
    height, width = picture.values.shape
    down, across = np.mgrid[:height, :width] + 0.5
    inside = (across >= columns[0]) & (across <= columns[1]) & (down >= rows[0]) & (down <= rows[1])
    inside &= picture.known
    if not inside.any():
        raise ValueError(f"{name} holds no pixel that the scene covers by a half; move it.")
    depth = picture.depth_m[inside]
    near, far = float(depth.min()), float(depth.max())
    thick = SLACK * (near + far - near)
    corners = np.array(
        [(columns[0], rows[0]), (columns[1], rows[0]), (columns[1], rows[1]), (columns[0], rows[1])]
    )
    planes = [
        world_points(picture.view, corners, np.full(4, z)) for z in (near - thick, far + thick)
    ]
    return Mark(name, "box", np.concatenate(planes))


def box_around(name: str, centre: np.ndarray, half: np.ndarray) -> Mark:
    """The box with its faces along the world's axes; half (3,) metres from the centre to them."""
    around = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    signs = np.concatenate([np.c_[around, np.full(4, z)] for z in (1, -1)])
    return Mark(name, "box", np.asarray(centre, np.float64) + signs * np.asarray(half, np.float64))


def _nothing_at(picture: ValuePicture, pixel: tuple[float, float]) -> str:
    width, height = picture.view.size
    if not (0 <= pixel[0] < width and 0 <= pixel[1] < height):
        return f"outside of the picture of {width}x{height} pixels; move it."
    return "where the scene covers less than half of it; move it."


def _planes(corners: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """(normal outwards, distance) of the six faces of a box of corners (8, 3)."""
    middle = corners.mean(axis=0)
    out = []
    for face in FACES:
        a, b, c, d = corners[list(face)]
        normal = np.cross(
            c - a, d - b
        )  # of the diagonals: as good where corners are four of a plane
        normal = normal / max(float(np.linalg.norm(normal)), 1e-300)
        distance = float(normal @ (a + b + c + d) / 4)
        flip = 1.0 if distance >= normal @ middle else -1.0
        out.append((flip * normal, flip * distance))
    return out


def _is_convex(corners: np.ndarray) -> bool:
    """Whether all corners lie within all faces, and it has a volume."""
    size = float(np.ptp(corners, axis=0).max())
    planes = _planes(corners)
    middle = corners.mean(axis=0)
    within = all((corners @ normal <= distance + 1e-3 * size).all() for normal, distance in planes)
    return (
        size > 0
        and within
        and all(distance - normal @ middle > 1e-6 * size for normal, distance in planes)
    )
