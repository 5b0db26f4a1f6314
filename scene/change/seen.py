"""What a visit shows from where it was photographed, and what that says of points in space."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shapeshift.scene.change.similarity import Similarity
from shapeshift.scene.inspection.value_picture import world_points
from shapeshift.scene.pose import View

OPEN = 0.25  # coverage below which nothing is there
JUMP = 0.03  # part of the depth that a neighbour lies nearer or farther: a pixel of an edge
GRAZING = 0.25  # cosine between surface and ray below which a depth says little
UNKNOWN, SURFACE, NOTHING = 0, 1, 2  # what a pixel tells
CHUNK = 20_000  # points that are asked at once
FARTHEST = 1 << 20  # cells from zero: farther points are not kept


@dataclass(frozen=True, eq=False)
class SeenSide:
    """One picture of a visit."""

    color: np.ndarray  # (H, W, 3) display sRGB, divided by the coverage
    coverage: np.ndarray  # (H, W) 0..1
    depth_m: np.ndarray  # (H, W) along the view, NaN where less than half is covered
    value: np.ndarray | None = None  # (H, W) of the value stop, NaN: not known


@dataclass(frozen=True, eq=False)
class SeenVisit:
    """A visit from its own cameras: their pictures hold no fog that lies before other cameras, and
    what none of them saw says nothing.
    """

    views: list[View]  # its own world
    sides: list[SeenSide]  # depths in its own metres
    a_from_own: Similarity
    photographed: bool  # whether it was photographed from these views; else they are guesses

    def points(self, number: int) -> np.ndarray:
        """(H, W, 3) metres, own world, under each pixel; NaN where nothing is."""
        depth = self.sides[number].depth_m
        rows, columns = np.mgrid[: depth.shape[0], : depth.shape[1]] + 0.5
        return world_points(self.views[number], np.stack([columns, rows], axis=2), depth)

    @cached_property
    def evidence(self) -> list[np.ndarray]:
        """(H, W) of each picture: UNKNOWN, SURFACE or NOTHING."""
        return [
            evidence_of(side, self.points(i), self.views[i]) for i, side in enumerate(self.sides)
        ]


def evidence_of(side: SeenSide, points: np.ndarray, view: View) -> np.ndarray:
    """(H, W) int8: what pixels tell; edges and grazing surfaces tell nothing."""
    surface = ~edge_pixels(side.depth_m) & (facing_cosine(points, view) >= GRAZING)
    return np.where(side.coverage < OPEN, NOTHING, np.where(surface, SURFACE, UNKNOWN)).astype(
        np.int8
    )


def edge_pixels(depth_m: np.ndarray) -> np.ndarray:
    """(H, W) bool: a neighbour is nearer or farther, or not there."""
    padded = np.pad(depth_m, 1, mode="edge")
    out = ~np.isfinite(depth_m)
    for rows, columns in ((0, 1), (2, 1), (1, 0), (1, 2)):
        near = padded[rows : rows + depth_m.shape[0], columns : columns + depth_m.shape[1]]
        with np.errstate(invalid="ignore"):
            out |= ~(np.abs(near - depth_m) <= JUMP * depth_m)
    return out


def facing_cosine(points: np.ndarray, view: View) -> np.ndarray:
    """(H, W) cosine between the surface under a pixel and its ray; 0 where it is not known."""
    if min(points.shape[:2]) < 2:
        return np.zeros(points.shape[:2])
    across = np.gradient(points, axis=1)
    down = np.gradient(points, axis=0)
    normal = np.cross(across, down)
    ray = points - view.world_from_eye.position
    size = np.linalg.norm(normal, axis=2) * np.linalg.norm(ray, axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.abs((normal * ray).sum(axis=2)) / size
    return np.nan_to_num(cosine)


def surface_cells(seen: SeenVisit, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Middles (m, 3), A's metres, of what is seen in each cube of side cell_m, and (m,) in how many
    views.
    """
    keys, sums = [np.zeros(0, np.int64)], [np.zeros((0, 4))]
    for i, told in enumerate(seen.evidence):
        points = seen.a_from_own.apply(seen.points(i)[told == SURFACE])
        cube = np.floor(points / cell_m)
        near = (np.abs(cube) < FARTHEST).all(axis=1)
        packed = (cube[near].astype(np.int64) + FARTHEST) @ (1 << np.array([42, 21, 0]))
        key, row = np.unique(packed, return_inverse=True)
        weights = (np.ones(np.count_nonzero(near)), *points[near].T)
        keys.append(key)
        rows = [np.bincount(row, w, minlength=len(key)).astype(np.float64) for w in weights]
        sums.append(np.stack(rows, axis=1))
    key, row = np.unique(np.concatenate(keys), return_inverse=True)
    total = np.stack([np.bincount(row, w, minlength=len(key)) for w in np.concatenate(sums).T])
    return (total[1:] / total[0]).T.reshape(-1, 3), np.bincount(row, minlength=len(key))


@dataclass(frozen=True, eq=False)
class PointEvidence:
    """What a visit's views say of points (m, 3): how many show a surface there, see through it and
    hide it; medians of those that show it, and of what they see through it.
    """

    same: np.ndarray  # (m,)
    through: np.ndarray  # (m,)
    hidden: np.ndarray  # (m,)
    color: np.ndarray  # (m, 3) display sRGB, NaN: none shows it
    behind: np.ndarray  # (m, 3) the same of what lies behind, NaN: nothing does
    value: np.ndarray  # (m,) NaN: not known


def evidence_at(points: np.ndarray, seen: SeenVisit, least_m: float) -> PointEvidence:
    """points (m, 3): A's metres.  least_m: depths that differ by less agree."""
    parts = [_evidence(points[i : i + CHUNK], seen, least_m)
             for i in range(0, max(len(points), 1), CHUNK)]  # fmt: skip
    return PointEvidence(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _evidence(points: np.ndarray, seen: SeenVisit, least_m: float) -> tuple[np.ndarray, ...]:
    own = seen.a_from_own.inverse.apply(points)
    least = least_m / seen.a_from_own.scale
    counts = np.zeros((3, len(points)), int)
    colors = np.full((2, len(seen.views), len(points), 3), np.nan, np.float32)
    values = np.full((len(seen.views), len(points)), np.nan)
    for i, (view, side, told) in enumerate(zip(seen.views, seen.sides, seen.evidence, strict=True)):
        rows, at, depth = pixels_of(own, view)
        kind, shown = told[at], side.depth_m[at]
        with np.errstate(invalid="ignore"):
            behind = (kind == NOTHING) | ((kind == SURFACE) & (shown > depth + least))
            same = (kind == SURFACE) & (np.abs(shown - depth) <= least)
            before = (kind == SURFACE) & (shown < depth - least)
        for count, mask in zip(counts, (same, behind, before), strict=True):
            count[rows[mask]] += 1
        colors[0, i, rows[same]] = side.color[at][same]
        farther = behind & (kind == SURFACE)
        colors[1, i, rows[farther]] = side.color[at][farther]
        if side.value is not None:
            values[i, rows[same]] = side.value[at][same]
    return *counts, *map(median_of_views, colors), median_of_views(values)


def pixels_of(
    points: np.ndarray, view: View
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Rows of those points (m, 3) that lie in the picture, their pixels (rows, columns), metres
    along the view.
    """
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    x, y, z = camera_from_world[:3, :3] @ points.T + camera_from_world[:3, 3:]
    width, height = view.size
    with np.errstate(divide="ignore", invalid="ignore"):
        column, row = fx * x / z + cx, fy * y / z + cy
        inside = (z > view.near) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    rows = np.flatnonzero(inside)
    return rows, (row[rows].astype(int), column[rows].astype(int)), z[rows]


def median_of_views(stack: np.ndarray) -> np.ndarray:
    """(...) float64 of (V, ...): the median of what is finite, NaN where nothing is."""
    if not len(stack):
        return np.full(stack.shape[1:], np.nan)
    ordered = np.sort(stack, axis=0)  # NaN come last
    count = np.isfinite(ordered).sum(axis=0)
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    high = np.minimum(high, len(stack) - 1)
    ends = [np.take_along_axis(ordered, i[None], axis=0)[0].astype(float) for i in (low, high)]
    return np.where(count > 0, (ends[0] + ends[1]) / 2, np.nan)
