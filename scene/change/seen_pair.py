"""What two visits show in one view, and where one sees through what the other has."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shapeshift.scene.inspection.value_picture import world_points
from shapeshift.scene.pose import View

SOLID, OPEN = 0.5, 0.25  # coverage from which something is there, and below which nothing is
JUMP = 0.03  # part of the depth that a neighbour lies nearer or farther: a pixel of an edge
GRAZING = 0.25  # cosine between surface and ray below which a depth says little


@dataclass(frozen=True, eq=False)
class SeenSide:
    """One visit in a view.  Depths are metres of A's world along the view."""

    color: np.ndarray  # (H, W, 3) display sRGB, divided by the coverage
    coverage: np.ndarray  # (H, W) 0..1
    depth_m: np.ndarray  # (H, W) NaN where less than half is covered
    value: np.ndarray | None = None  # (H, W) of the value stop, NaN: not known


@dataclass(frozen=True, eq=False)
class SeenPair:
    """Both visits in a view of A's world."""

    view: View
    before: SeenSide
    after: SeenSide

    @cached_property
    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """(H, W) bool of before and after: pixels at an edge of what they show."""
        return edge_pixels(self.before.depth_m), edge_pixels(self.after.depth_m)


def edge_pixels(depth_m: np.ndarray) -> np.ndarray:
    """(H, W) bool: a neighbour is nearer or farther, or not there."""
    padded = np.pad(depth_m, 1, mode="edge")
    out = ~np.isfinite(depth_m)
    for rows, columns in ((0, 1), (2, 1), (1, 0), (1, 2)):
        near = padded[rows : rows + depth_m.shape[0], columns : columns + depth_m.shape[1]]
        with np.errstate(invalid="ignore"):
            out |= ~(np.abs(near - depth_m) <= JUMP * depth_m)
    return out


@dataclass(frozen=True, eq=False)
class Samples:
    """Pixels of one visit's surfaces, and what the other visit shows there."""

    points: np.ndarray  # (n, 3) metres, A's world
    view: np.ndarray  # (n,) which pair
    through: np.ndarray  # (n,) 1: the other sees through it, 0: it has it too, NaN: hides it
    color: np.ndarray  # (n, 3) own
    color_other: np.ndarray  # (n, 3) NaN where through is not 0
    value: np.ndarray  # (n,) own, NaN: not known
    value_other: np.ndarray  # (n,)


def samples_of(pairs: list[SeenPair], after: bool, least_m: float) -> Samples:
    """All surfaces of one visit that are seen well.  least_m: depths that differ by less agree."""
    parts = []
    for number, pair in enumerate(pairs):
        own, other = (pair.after, pair.before) if after else (pair.before, pair.after)
        edge, edge_other = pair.edges[::-1] if after else pair.edges
        height, width = own.depth_m.shape
        rows, columns = np.mgrid[:height, :width] + 0.5
        points = world_points(pair.view, np.stack([columns, rows], axis=2), own.depth_m)
        good = ~edge & (facing_cosine(points, pair.view) >= GRAZING)
        with np.errstate(invalid="ignore"):
            behind = other.depth_m > own.depth_m + least_m
            hidden = other.depth_m < own.depth_m - least_m
        nothing = other.coverage < OPEN
        unknown = hidden | ((edge_other | ~np.isfinite(other.depth_m)) & ~nothing)
        through = np.where(unknown, np.nan, (behind | nothing).astype(float))
        same = (through == 0)[..., None]
        none = np.full(own.depth_m.shape, np.nan)
        fields = (
            points, np.full((height, width), number), through, own.color,
            np.where(same, other.color, np.nan), none if own.value is None else own.value,
            none if other.value is None else np.where(same[..., 0], other.value, np.nan),
        )  # fmt: skip
        parts.append([field[good] for field in fields])
    return Samples(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def facing_cosine(points: np.ndarray, view: View) -> np.ndarray:
    """(H, W) cosine between the surface under a pixel and its ray; 0 where it is not known."""
    across = np.gradient(points, axis=1)
    down = np.gradient(points, axis=0)
    normal = np.cross(across, down)
    ray = points - view.world_from_eye.position
    size = np.linalg.norm(normal, axis=2) * np.linalg.norm(ray, axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.abs((normal * ray).sum(axis=2)) / size
    return np.nan_to_num(cosine)
