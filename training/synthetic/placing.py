"""Where solids go, how open they lie, and patterns on them: frames, pipes, bolts, wood, noise."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from shapeshift.training.synthetic.solids import Ball, Cuboid, Cylinder, Disc, Ring, length
from shapeshift.training.synthetic.tracer import Hits, Material, Place, Solid

Place3 = tuple[float, float, float] | np.ndarray  # (3,) metres
# world_from_local rotations that lay a shape's own +Y along a world axis
ALONG = {
    "x": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    "y": np.eye(3),
    "z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
}


# How much sky a point sees, from the distance to the nearest object a little above it.
#
# The distances are computed once, on a grid; a walk of a few steps along the normal reads them.

FAR = 0.15  # metres at scale 1; more free space than this makes no difference
STEPS = ((0.012, 0.3), (0.03, 0.3), (0.07, 0.25), (0.14, 0.15))  # metres above at 1, weight


def corner_weight(f: np.ndarray, corner: tuple[int, int, int]) -> np.ndarray:
    """(n,) trilinear weight of one corner of a cell, f (n, 3) the place in the cell."""
    x, y, z = (f[:, i] if one else 1 - f[:, i] for i, one in enumerate(corner))
    return x * y * z


@dataclass(frozen=True)
class Clearance:
    """Distances to the nearest surface on a regular grid."""

    low: np.ndarray  # (3,) metres
    cell: float  # metres
    grid: np.ndarray  # (X, Y, Z) metres, at most FAR * scale
    scale: float = 1.0  # of FAR and STEPS: larger for larger things

    @staticmethod
    def of(
        place: Place, low: tuple, high: tuple, cell: float = 0.01, scale: float = 1.0
    ) -> "Clearance":
        corner, far = np.asarray(low, float), FAR * scale
        shape = np.ceil((high - corner) / cell).astype(int) + 1
        grid = np.full(shape, far)
        for solid in place.solids:
            # Only cells that are nearer than `far` to the ball round the solid can change.
            around = solid.shape.reach + far
            first = np.clip(np.floor((solid.centre - around - corner) / cell), 0, shape).astype(int)
            last = np.clip(np.ceil((solid.centre + around - corner) / cell) + 1, 0, shape).astype(
                int
            )
            block = grid[tuple(map(slice, first, last))]
            cells = np.stack(np.meshgrid(*map(np.arange, first, last), indexing="ij"), -1)
            points = corner + cell * cells.reshape(-1, 3)
            bound = length(points - solid.centre) - solid.shape.reach
            close = np.flatnonzero(bound < block.ravel())
            nearest = block.ravel()
            nearest[close] = np.minimum(nearest[close], solid.distance(points[close]))
            block[...] = nearest.reshape(block.shape)
        return Clearance(corner, cell, grid, scale)

    def at(self, points: np.ndarray) -> np.ndarray:
        """(n,) metres, trilinear; outside the grid as at its border."""
        limit = np.array(self.grid.shape) - 1.001
        q = np.clip((points - self.low) / self.cell, 0, limit)
        cell = q.astype(int)
        f = q - cell
        total = np.zeros(len(points))
        for corner in np.ndindex(2, 2, 2):
            weight = corner_weight(f, corner)
            total += weight * self.grid[tuple((cell + corner).T)]
        return total

    def openness(self, hits: Hits) -> np.ndarray:
        """(n,) 0..1; 1 under a free sky.  Zero where nothing was hit."""
        here = np.flatnonzero(hits.index >= 0)
        out = np.zeros(len(hits.index))
        for above_at_1, weight in STEPS:
            above = above_at_1 * self.scale
            free = self.at(hits.points[here] + above * hits.normals[here])
            out[here] += weight * np.clip(free / above, 0, 1)
        return out


def frame(position: Place3, rotation: np.ndarray | None = None) -> np.ndarray:
    """(4, 4) parent_from_local."""
    out = np.eye(4)
    out[:3, :3] = np.eye(3) if rotation is None else rotation
    out[:3, 3] = position
    return out


def turned(axis: str, degrees: float) -> np.ndarray:
    """(3, 3) right-handed rotation about a world axis."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    out = np.eye(3)
    out[i, i], out[i, j], out[j, i], out[j, j] = c, -s, s, c
    return out


def inside(parent: np.ndarray, solids: list[Solid]) -> list[Solid]:
    """Solids given in a part's frame, moved to the frame's parent."""
    return [replace(s, world_from_local=parent @ s.world_from_local) for s in solids]


def box(centre: tuple, half: tuple, surface: Material, bevel: float = 0.003, **more) -> Solid:
    return Solid(
        Cuboid(half, bevel), surface, frame(centre, more.get("rotation")), more.get("keep")
    )


def bar(start: Place3, end: Place3, radius: float, surface: Material, **more: Any) -> Solid:
    """A cylinder from one point to another; top_radius, bevel, capped, keep as in Cylinder."""
    first, last = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(last - first))
    up = (last - first) / length
    side = np.cross(up, (0.0, 0.0, 1.0) if abs(up[2]) < 0.9 else (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    keep = more.pop("keep", None)
    settings: dict[str, Any] = {"bevel": 0.002} | more
    shape = Cylinder(radius, length / 2, **settings)
    rotation = np.stack([side, up, np.cross(side, up)], axis=1)
    return Solid(shape, surface, frame((first + last) / 2, rotation), keep)


def ball(centre: tuple, radius: float, surface: Material) -> Solid:
    return Solid(Ball(radius), surface, frame(centre))


def ring(centre: tuple, axis: str, major: float, minor: float, surface: Material, **more) -> Solid:
    return Solid(Ring(major, minor), surface, frame(centre, ALONG[axis]), more.get("keep"))


def disc(centre: tuple, axis: str, radius: float, surface: Material, **more) -> Solid:
    return Solid(Disc(radius), surface, frame(centre, ALONG[axis]), more.get("keep"))


def elbow(
    corner: Place3, first: Place3, second: Place3, bend: float, radius: float, surface: Material
) -> Solid:
    """The quarter bend of a pipe at `corner` between unit directions that leave the corner."""
    one, other = np.asarray(first, float), np.asarray(second, float)
    middle = -(one + other) / np.sqrt(2)  # local +X: from the bend's centre to the corner
    normal = np.cross(one, other)
    rotation = np.stack([middle, normal, np.cross(middle, normal)], axis=1)
    centre = np.asarray(corner, float) + bend * (one + other)
    return Solid(Ring(bend, radius, np.pi / 4), surface, frame(centre, rotation))


def run_of_pipe(corners: list[tuple], bend: float, radius: float, surface: Material) -> list[Solid]:
    """Straight pipes through the corners, with quarter bends between them."""
    points = [np.asarray(c, float) for c in corners]
    units = [(b - a) / np.linalg.norm(b - a) for a, b in pairwise(points)]
    out = []
    for i, along in enumerate(units):
        start = points[i] + along * (bend if i else 0)
        end = points[i + 1] - along * (bend if i < len(units) - 1 else 0)
        out.append(bar(start, end, radius, surface))
        if i:
            out.append(elbow(points[i], -units[i - 1], along, bend, radius, surface))
    return out


def bolt_circle(
    centre: tuple, axis: str, radius: float, count: int, surface: Material
) -> list[Solid]:
    """Bolt heads of 6 mm round a flange whose axis is `axis`."""
    out = []
    for k in range(count):
        angle = 2 * np.pi * (k + 0.5) / count
        spoke = ALONG[axis] @ np.array([np.cos(angle), 0, np.sin(angle)])
        along = ALONG[axis] @ np.array([0.0, 1, 0])
        middle = np.asarray(centre) + radius * spoke
        out.append(bar(middle - 0.012 * along, middle + 0.012 * along, 0.006, surface))
    return out


def noise(p: np.ndarray, cells_per_m: float) -> np.ndarray:
    """(n,) smooth value noise 0..1 on a grid of `cells_per_m`."""
    q = p * cells_per_m
    cell = np.floor(q)
    f = q - cell
    f = f * f * (3 - 2 * f)
    total = np.zeros(len(p))
    for corner in np.ndindex(2, 2, 2):
        at = cell + corner
        hashed = np.sin(at @ (127.1, 311.7, 74.7)) * 43758.5453
        weight = corner_weight(f, corner)
        total += weight * (hashed - np.floor(hashed))
    return total


def mix(low: tuple, high: tuple, share: np.ndarray) -> np.ndarray:
    share = np.clip(share, 0, 1)[:, None]
    return np.asarray(low) * (1 - share) + np.asarray(high) * share


def bump(p: np.ndarray, centre: tuple, width: float) -> np.ndarray:
    """(n,) a round hill of height 1 at a point: hot spots."""
    return np.exp(-((p - np.asarray(centre)) ** 2).sum(1) / (2 * width**2))
