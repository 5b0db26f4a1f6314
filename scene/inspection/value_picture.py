"""What a stop of values measures in a view: value and depth of each pixel, before any palette."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from shapeshift.scene.inspection.emissivity import KELVINS, Emission
from shapeshift.scene.inspection.lengths import Point
from shapeshift.scene.pose import View

HIDDEN_M, HIDDEN_PART = 0.01, 0.02  # metres and part of the depth: farther behind it is not seen
# One standard deviation of a depth, as a part of it: the demo against its ray tracer
# (docs/thermal.md) has 71 % of its pixels within it.
DEPTH_ERROR = 0.006
PATCH = 2  # pixels to each side, over which a surface is taken for a plane
SATURATED = 0.002  # of the range: as near to an end of it a value may lie beyond


@dataclass(frozen=True, eq=False)
class ValuePicture:
    """NaN where less than half of a pixel is covered: nothing is known there."""

    view: View
    values: np.ndarray  # (H, W) float64, in `unit`
    depth_m: np.ndarray  # (H, W) float64 metres along the view
    unit: str = ""
    value_range: tuple[float, float] = (0.0, 1.0)  # what the photos could show
    # How far 95 of 100 pixels are from the colours in which values were looked up, at most, as a
    # distance in sRGB; None: the scene has values.
    off_palette: float | None = None
    emission: Emission | None = None  # by which values were corrected; None: as photographed
    photographed: np.ndarray | None = None  # (H, W) float64: values before that
    photographed_range: tuple[float, float] | None = None
    is_heat: bool = True  # its words: hottest and coldest, of others highest and lowest
    digits: int = 1  # of a value behind the decimal point, for people
    may_exceed: bool = False  # whether values lie beyond the range, which then is the palette's
    stop: str = ""  # name of what is measured
    owner_names: tuple[str, ...] = ()  # of objects
    owners: np.ndarray | None = None  # (H, W) int: which of them is seen, -1 none; None: not known
    # What `corrected` was given: (H, W) emissivity, NaN where it is that of `emission`; by object.
    own_emissivity: np.ndarray | None = None
    by_object: Mapping[str, float] = field(default_factory=dict)
    beneath: "ValuePicture | None" = None  # without what single marks say; None: they say nothing

    @property
    def is_temperature(self) -> bool:
        """Whether its unit is one of temperature, so that it can be corrected; a formula's values
        are none, whatever their unit.
        """
        return self.unit in KELVINS and not self.may_exceed

    @property
    def known(self) -> np.ndarray:
        """(H, W) bool: where there is a value."""
        return np.isfinite(self.values) & np.isfinite(self.depth_m)

    @cached_property
    def points(self) -> np.ndarray:
        """(H, W, 3) metres in the world, of the surface under the middle of each pixel."""
        height, width = self.depth_m.shape
        rows, columns = np.mgrid[:height, :width] + 0.5
        return world_points(self.view, np.stack([columns, rows], axis=2), self.depth_m)

    def pixel_of(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 2) column and row, and (N,) metres along the view, of world points (N, 3).

        NaN behind the eye.
        """
        camera_from_world, fx, fy, cx, cy = self.view.pinhole()
        x, y, z = _in_camera(points, camera_from_world)
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.where(z > 0, z, np.nan)
            return np.stack([fx * x / z + cx, fy * y / z + cy], axis=1), z

    def at(self, field: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """(N,) of a field (H, W) at pixels (N, 2), between the four nearest middles of pixels that
        know it; NaN outside of the picture and where the pixel itself knows nothing.
        """
        height, width = field.shape
        inside = np.all((pixels >= 0) & (pixels < (width, height)), axis=1)  # NaN is not
        held = np.where(inside[:, None], pixels, 0.5)
        own = field[held[:, 1].astype(int), held[:, 0].astype(int)]
        low = np.floor(held - 0.5)
        part = held - 0.5 - low
        total, weight = np.zeros(len(held)), np.zeros(len(held))
        for dx in (0, 1):
            for dy in (0, 1):
                column = np.clip(low[:, 0] + dx, 0, width - 1).astype(int)
                row = np.clip(low[:, 1] + dy, 0, height - 1).astype(int)
                near = field[row, column]
                share = np.abs(1 - dx - part[:, 0]) * np.abs(1 - dy - part[:, 1])
                share = np.where(np.isfinite(near), share, 0)
                total += share * np.where(np.isfinite(near), near, 0)
                weight += share
        with np.errstate(invalid="ignore"):
            found = total / np.where(weight > 0, weight, np.nan)
        return np.where(inside & np.isfinite(own), found, np.nan)

    def sees(self, points: np.ndarray) -> np.ndarray:
        """(N,) bool: which world points (N, 3) lie on what this view sees, not behind it."""
        pixels, depth = self.pixel_of(points)
        with np.errstate(invalid="ignore"):
            shown = self.at(self.depth_m, pixels)
            return np.abs(shown - depth) <= HIDDEN_M + HIDDEN_PART * depth

    def values_at(self, points: np.ndarray) -> np.ndarray:
        """(N,) values of world points (N, 3); NaN for what is hidden or not covered."""
        pixels, _ = self.pixel_of(points)
        return np.where(self.sees(points), self.at(self.values, pixels), np.nan)

    def pick(self, pixel: tuple[float, float]) -> np.ndarray:
        """(3,) metres, world: the surface under a pixel (column, row); NaN where nothing is."""
        pixels = np.array([pixel], np.float64)
        return world_points(self.view, pixels, self.at(self.depth_m, pixels))[0]

    def picked(self, pixel: tuple[float, float]) -> Point:
        """The same with its uncertainty."""
        return Point(self.pick(pixel), self.spread(pixel))

    def spread(self, pixel: tuple[float, float]) -> np.ndarray:
        """(3, 3) covariance in metres squared of what `pick` gives: along the ray the depth error
        of DEPTH_ERROR and what the surface around it departs from a plane, across it half a pixel.
        """
        column, row = int(pixel[0]), int(pixel[1])
        depth = float(self.at(self.depth_m, np.array([pixel], np.float64))[0])
        rows, columns = np.mgrid[row - PATCH : row + PATCH + 1, column - PATCH : column + PATCH + 1]
        height, width = self.depth_m.shape
        inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        around = self.depth_m[rows[inside], columns[inside]]
        known = np.isfinite(around)
        rough = 0.0
        if known.sum() > 3:
            plane = np.stack([columns[inside], rows[inside], np.ones(inside.sum())], axis=1)[known]
            fit = np.linalg.lstsq(plane, around[known], rcond=None)[0]
            rough = float(np.std(around[known] - plane @ fit))
        _, fx, fy, _, _ = self.view.pinhole()
        across = 0.5 * depth * max(1 / fx, 1 / fy)
        along = np.hypot(DEPTH_ERROR * depth, rough)
        ray = self.pick(pixel) - self.view.world_from_eye.position
        ray = ray / np.linalg.norm(ray)
        return across**2 * np.eye(3) + (along**2 - across**2) * np.outer(ray, ray)

    def corrected(
        self, emission: Emission, emissivity: float | np.ndarray | None = None
    ) -> "ValuePicture":
        """The same with the temperatures of surfaces; `emissivity`: of a surface of its own, or of
        each pixel, (H, W), NaN where the emission says it.

        The range is what the photos' range stands for, of pixels by the emission's emissivity.
        ValueError: values are no temperatures.
        """
        before = self.values if self.photographed is None else self.photographed
        map_of = emissivity if isinstance(emissivity, np.ndarray) else None
        share = emissivity
        if map_of is not None:
            share = np.where(np.isfinite(map_of), map_of, emission.surface.emissivity)
        values = emission.corrected(before, self.unit, share)
        known = values[np.isfinite(values)]
        kept = self.photographed_range or self.value_range
        of_range = None if isinstance(emissivity, np.ndarray) else emissivity
        low, high = emission.corrected(np.array(kept), self.unit, of_range)
        low = low if np.isfinite(low) else known.min(initial=high)  # colder than what is mirrored
        return replace(
            self, values=values, value_range=(float(low), float(high)), emission=emission,
            photographed=before, photographed_range=kept, own_emissivity=map_of,
        )  # fmt: skip

    def emissivity_at(self, pixel: tuple[float, float]) -> float | None:
        """By which the value at a pixel (column, row) was made; None: it is as photographed."""
        if self.emission is None:
            return None
        own = self.own_emissivity
        share = np.nan if own is None else float(own[int(pixel[1]), int(pixel[0])])
        return share if np.isfinite(share) else self.emission.surface.emissivity

    def ends_at(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """What the ends of the photos' range stand for on the surface at a pixel."""
        share, kept = self.emissivity_at(pixel), self.photographed_range
        if self.own_emissivity is None or self.emission is None or kept is None:
            return self.value_range
        low, high = self.emission.corrected(np.array(kept), self.unit, share)
        return (float(low) if np.isfinite(low) else -np.inf), float(high)

    def owner_at(self, pixels: np.ndarray) -> np.ndarray:
        """(N,) places in `owner_names` of what is seen at pixels (N, 2) of the picture; -1: none
        that is known.
        """
        if self.owners is None:
            return np.full(len(pixels), -1)
        rows, columns = pixels[:, 1].astype(int), pixels[:, 0].astype(int)
        return self.owners[rows, columns]

    def as_photographed(self) -> "ValuePicture":
        """The same without a correction."""
        if self.photographed is None:
            return self
        kept = self.photographed_range or self.value_range
        return replace(
            self, values=self.photographed, value_range=kept, emission=None, photographed=None,
            photographed_range=None, own_emissivity=None, by_object={}, beneath=None,
        )  # fmt: skip

    def text(self, value: float, ends: tuple[float, float] | None = None) -> str:
        """A value of it for people; ends: of what photos showed, at which it has < or >."""
        return value_text(value, self.unit, None if self.may_exceed else ends, self.digits)

    def lowest(self) -> tuple[tuple[float, float], float]:
        """The pixel (column, row) with the least value, and that; ValueError: none is known."""
        row, column = np.unravel_index(int(np.nanargmin(self.values)), self.values.shape)
        return (float(column) + 0.5, float(row) + 0.5), float(self.values[row, column])

    def hottest(self) -> tuple[tuple[float, float], float]:
        """The pixel (column, row) with the largest value, and that; ValueError: none is known."""
        row, column = np.unravel_index(int(np.nanargmax(self.values)), self.values.shape)
        return (float(column) + 0.5, float(row) + 0.5), float(self.values[row, column])


def _in_camera(points: np.ndarray, camera_from_world: np.ndarray) -> np.ndarray:
    """(3, N) metres: right, down, forward."""
    points = np.asarray(points, np.float64)
    return camera_from_world[:3, :3] @ points.T + camera_from_world[:3, 3:]


def world_points(view: View, pixels: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
    """(..., 3) metres of pixels (..., 2) column and row, at depths (...) along the view."""
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    x = (pixels[..., 0] - cx) / fx * depth_m
    y = (pixels[..., 1] - cy) / fy * depth_m
    world_from_camera = np.linalg.inv(camera_from_world)
    in_camera = np.stack([x, y, depth_m], axis=-1)
    return in_camera @ world_from_camera[:3, :3].T + world_from_camera[:3, 3]


def value_text(
    value: float, unit: str, value_range: tuple[float, float] | None = None, digits: int = 1
) -> str:
    """A value for people, `--` where it is not known, < or > at the range's ends."""
    if not np.isfinite(value):
        return "--"
    sign = ""
    if value_range is not None:
        low, high = value_range
        near = SATURATED * (high - low) if np.isfinite(high - low) else 0.0
        sign = ">" if value >= high - near else "<" if value <= low + near else ""
    return f"{sign}{value:.{digits}f} {unit}".rstrip()
