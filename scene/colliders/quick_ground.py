"""What carries things until the exact body of a background is there, made at once.

A height map of what is solid as seen from above: in each column of a grid the height at which the
splats have stopped enough of the light, which neither fog nor a floater does.  It is solid below,
so that nothing thin can be passed.  Where a thing stands it is one plane, which goes on under it.
What is above a thing, a shelf, is left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel, Model, SplatLayers
from shapeshift.runtime_models.rotation import normalize, rotation_matrices
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.colliders.collider import Collider, box_around
from shapeshift.scene.colliders.convex_parts import hull_volume
from shapeshift.scene.colliders.standing import Plane, pressed
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.pose import Pose

REACH = 10.0  # sizes of a thing, around it, that are looked at
NEAR = 2.0  # sizes around it of which all splats count
SPLATS = (6_000, 8_000)  # near ones, and others, at most
CELLS, MOST_CELLS = 6.0, 96  # columns along the largest thing, along the grid's longer side at most
LEVELS = 3.0  # a cell, of height
MOST_LEVELS = 256
OPAQUE = 0.3  # optical depth from above at which something is solid
FAINT, WIDEST = 0.02, 1.0  # opacity, and sizes of a thing; fainter and wider splats are fog
GAP = 3  # cells on either side of a gap that is closed: half a thing, which cannot fall through
RING = np.array([[0, 0], *([np.cos(a), np.sin(a)] for a in np.arange(4) * np.pi / 2 + np.pi / 4)])
SIGMAS = 1.2  # from a splat's centre to four other points of it
DEEP = 100.0  # sizes below the lowest: what has nothing under it falls
# Where a thing stands: cells around it that tell its plane, how far that may lie above and below
# its foot, how near to it counts as on it, all in cells; the share of those around that must.
AROUND, HIGH, ON, LEAST_SHARE = 3, 2.0, 0.5, 0.3
FEWEST = 8  # cells
STEEP = 0.7  # least height of a plane's unit normal: nothing stands on a steeper one


class NearSplats(NamedTuple):
    """Of a background, in its own frame."""

    means: np.ndarray  # (N, 3) metres
    scales: np.ndarray  # (N, 3) one sigma
    wxyz: np.ndarray  # (N, 4)
    opacity: np.ndarray  # (N,) 0..1
    times: np.ndarray  # (N,) how many others each stands for, itself too


@dataclass(frozen=True)
class QuickGround:
    mesh: TriangleMesh | None  # watertight, world metres; None: nothing is solid there
    stands: tuple[Plane | None, ...]  # of each thing; None: it hangs, or floats


@dataclass
class HeightMap:
    """Heights over a grid in x and z."""

    low: np.ndarray  # (2,) metres, world: its corner in x and z
    cell_m: float
    height: np.ndarray  # (X, Z) metres, world; NaN: nothing is there

    def places(self) -> np.ndarray:
        """(X * Z, 3) metres, world: the middle of each column at its height."""
        flat = np.moveaxis(np.indices(self.height.shape), 0, 2).reshape(-1, 2)
        x, z = (self.low + (flat + 0.5) * self.cell_m).T
        return np.stack([x, self.height.reshape(-1), z], 1)

    def box(self, thing: np.ndarray, around: int) -> tuple[slice, slice]:
        """The columns that a thing (V, 3) is over, and so many around it."""
        ends = (np.stack([thing.min(0), thing.max(0)])[:, [0, 2]] - self.low) / self.cell_m
        ends = np.floor(ends).astype(int) + np.array([[-around], [around + 1]])
        x, z = ends.T.clip(0, np.array(self.height.shape)[:, None])
        return slice(x[0], x[1]), slice(z[0], z[1])


def ground_of_model(
    model: Model, x: Control, pose: Pose, things: Sequence[np.ndarray]
) -> tuple[Collider | None, tuple[Plane | None, ...]]:
    """A rough collider of a background at control value x, in its own frame, for things (V, 3)
    metres, world; None where nothing near them is solid, or it depends on the eye.
    """
    world_from_object = pose.matrix()
    if not things or not isinstance(model, AnchorModel | SplatLayers):
        return None, (None,) * len(things)
    object_from_world = np.linalg.inv(world_from_object)
    own = [each @ object_from_world[:3, :3].T + object_from_world[:3, 3] for each in things]
    places = model.anchors if isinstance(model, AnchorModel) else model.means
    each = model.splat_count // max(len(places), 1)
    rows, times = rows_near(places, own, each)
    few = model.with_anchors(rows) if isinstance(model, AnchorModel) else model.with_rows(rows)
    means, scales, wxyz, opacity = (np.asarray(column) for column in Evaluator(few).geometry(x))
    near = NearSplats(means, scales, wxyz, opacity, np.repeat(times, each))
    made = quick_ground(near, world_from_object, things)
    if made.mesh is None:
        return None, made.stands
    vertices = made.mesh.vertices @ object_from_world[:3, :3].T + object_from_world[:3, 3]
    mesh = TriangleMesh(vertices.astype(np.float32), made.mesh.faces)
    return Collider((box_around(mesh.vertices).vertices,), mesh, rough=True), made.stands


def rows_near(
    places: np.ndarray, things: Sequence[np.ndarray], each: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of anchors or splats at places (A, 3) that matter to things (V, 3) of the same frame,
    (M,), and how many each stands for; `each`: splats of a row.
    """
    away = np.full(len(places), np.inf)
    for thing in things:
        size = np.ptp(thing, axis=0).max()
        off = places - (thing.min(0) + thing.max(0)) / 2
        away = np.fmin(away, np.einsum("ni,ni->n", off, off) / size**2)  # NaN is nowhere
    rows, times = [], []
    for low, high, most in ((-1.0, NEAR, SPLATS[0]), (NEAR, REACH, SPLATS[1])):
        here = np.flatnonzero((away > np.copysign(low**2, low)) & (away <= high**2))
        step = max(-(-len(here) * each // most), 1)
        rows.append(here[::step])
        times.append(np.full(len(rows[-1]), step))
    return np.concatenate(rows), np.concatenate(times)


def stood(collider: Collider, world_from_object: np.ndarray, plane: Plane) -> Collider:
    """With nothing below the plane that it stands on, and a base that carries it: its splats reach
    into what is there, and a body would be thrown out of that.
    """
    turn, at = world_from_object[:3, :3], world_from_object[:3, 3]
    own = Plane(turn.T @ plane.normal, plane.offset - float(plane.normal @ at))
    parts = tuple(part for part in pressed(collider.parts, own) if hull_volume(part) > 0)
    return replace(collider, parts=parts) if parts else collider


def mended(
    columns: Sequence[np.ndarray], pose: Pose, stood_on: Sequence[tuple[np.ndarray, Plane]]
) -> tuple[np.ndarray, ...]:
    """NearSplats of a background whose planes go on under the things (V, 3) metres, world, on them:
    without the ghosts that training hides inside a thing, and closed where nothing was seen.
    """
    means, scales, wxyz, opacity = columns
    world_from_object = pose.matrix()
    turn, at = world_from_object[:3, :3], world_from_object[:3, 3]
    for thing, plane in stood_on:
        corners = (thing - at) @ turn
        own = Plane(turn.T @ plane.normal, plane.offset - float(plane.normal @ at))
        size = float(np.ptp(thing, axis=0).max())
        step, axes = size / (2 * CELLS), own.axes()
        outline = planes_of(corners @ axes.T)
        if outline is None:
            continue
        height = own.height(means)
        inside = within(outline, means @ axes.T, step)
        gone = inside & (height > -step) & (height < own.height(corners).max())
        low, high = (corners @ axes.T).min(0) - step, (corners @ axes.T).max(0) + step
        places = np.moveaxis(np.mgrid[low[0] : high[0] : step, low[1] : high[1] : step], 0, 2)
        places = places.reshape(-1, 2)
        places = places[within(outline, places, step / 2)]
        count = len(places)
        added = (
            places @ axes + own.offset * own.normal,
            np.tile([step, step, 0.01 * step], (count, 1)),
            np.tile(facing(own.normal), (count, 1)),
            np.full(count, 0.95),
        )
        means, scales, wxyz, opacity = (
            np.concatenate([old[~gone], new.astype(np.float32)])
            for old, new in zip((means, scales, wxyz, opacity), added, strict=True)
        )
    return means, scales, wxyz, opacity


def planes_of(points: np.ndarray) -> np.ndarray | None:
    """(E, 3) outward sides of the hull of points (V, 2); None where they lie on a line."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points).equations
    except (QhullError, ValueError):
        return None


def within(outline: np.ndarray, points: np.ndarray, margin: float) -> np.ndarray:
    """(N,) bool: points (N, 2) no farther than that outside of an outline's sides (E, 3)."""
    return (points @ outline[:, :2].T + outline[:, 2]).max(axis=1) <= margin


def facing(normal: np.ndarray) -> np.ndarray:
    """(4,) quaternion wxyz that turns +Z to a unit normal (3,)."""
    if normal[2] < -1 + 1e-9:
        return np.array([0.0, 1.0, 0.0, 0.0])
    wxyz = np.array([1 + normal[2], -normal[1], normal[0], 0.0])
    return wxyz / np.linalg.norm(wxyz)


def quick_ground(
    splats: NearSplats, world_from_object: np.ndarray, things: Sequence[np.ndarray]
) -> QuickGround:
    """What is solid under things (V, 3) metres, world, one or more; (4, 4) of the background."""
    size = max(float(np.ptp(each, axis=0).max()) for each in things)
    columns = columns_of(splats, world_from_object, things, size)
    if columns is None:
        return QuickGround(None, (None,) * len(things))
    stands = tuple(stand_of(columns, thing) for thing in things)
    close_gaps(columns.height)
    for thing, stand in zip(things, stands, strict=True):
        if stand is not None:
            flatten(columns, thing, stand)
    if np.isnan(columns.height).all():
        return QuickGround(None, stands)
    return QuickGround(block(columns, DEEP * size), stands)


def columns_of(
    splats: NearSplats, world_from_object: np.ndarray, things: Sequence[np.ndarray], size: float
) -> HeightMap | None:
    """The height in each column at which light from above is stopped; None of no splats."""
    points, depth = scattered(splats, world_from_object, WIDEST * size)
    if not len(depth):
        return None
    low, high = points.min(axis=1).astype(np.float64), points.max(axis=1).astype(np.float64)
    cell_m = max(size / CELLS, float((high - low)[[0, 2]].max()) / MOST_CELLS)
    level_m = max(cell_m / LEVELS, float(high[1] - low[1]) / MOST_LEVELS)
    x, z = (((points[i] - low[i]) / cell_m).astype(np.int32) for i in (0, 2))
    down = ((high[1] - points[1]) / level_m).astype(np.int32)
    shape = (int(x.max()) + 1, int(z.max()) + 1, int(down.max()) + 1)
    at, total = (x * shape[1] + z) * shape[2] + down, int(np.prod(shape))
    light = np.bincount(at, depth / cell_m**2, total)
    stops = light.reshape(shape).astype(np.float32)
    columns = HeightMap(low[[0, 2]], cell_m, np.full(stops.shape[:2], np.nan))
    found = surface(stops, 0)
    for thing in things:
        top, foot = ((high[1] - end) / level_m for end in (thing[:, 1].max(), thing[:, 1].min()))
        here = columns.box(thing, AROUND * int(CELLS))
        under = surface(stops[here], top)
        free = under >= foot - HIGH * cell_m / level_m  # beside it nothing stands in the way
        found[here] = np.where(free, under, found[here])
        here = columns.box(thing, 0)
        found[here] = surface(stops[here], foot - ON * cell_m / level_m)
    known = found < shape[2]
    level = np.flatnonzero(known) * shape[2] + found[known]
    below = np.bincount(at, depth * (high[1] - points[1]), total)[level] / cell_m**2
    columns.height[known] = high[1] - below / light[level]
    return columns


def scattered(
    splats: NearSplats, world_from_object: np.ndarray, widest_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Points (3, M) metres, world, on the discs of splats, and the light (M,) that each stops:
    optical depth times square metres.
    """
    means, scales, wxyz, opacity, times = splats
    order = np.argsort(scales, axis=1)
    sizes = np.take_along_axis(scales, order[:, 1:], 1)  # (N, 2) the two wide ones
    with np.errstate(invalid="ignore"):
        stops = -np.log1p(-np.clip(opacity, 0, 0.99)) * (2 * np.pi * sizes.prod(axis=1)) * times
        known = (opacity >= FAINT) & (sizes[:, 1] <= widest_m) & (stops > 0)
    known &= np.isfinite(means.sum(axis=1) + wxyz.sum(axis=1))
    rows = np.flatnonzero(known)
    turn = rotation_matrices(normalize(wxyz[rows].astype(np.float64))).astype(np.float32)
    axes = np.take_along_axis(turn, order[rows, None, 1:], 2) * sizes[rows, None, :]  # (n, 3, 2)
    spread = axes @ (SIGMAS * RING.T).astype(np.float32)  # (n, 3, 5)
    points = means[rows, :, None].astype(np.float32) + spread
    points = np.ascontiguousarray(points.swapaxes(0, 1).reshape(3, -1))
    world = world_from_object.astype(np.float32)
    points = world[:3, :3] @ points + world[:3, 3:]
    return points, np.repeat(stops[rows] / len(RING), len(RING))


def surface(stops: np.ndarray, start: float) -> np.ndarray:
    """(X, Z) level from the top at which the optical depth from `start` on reaches OPAQUE, of what
    stops light in each (X, Z, levels); the number of levels where it never does.
    """
    first = int(np.clip(np.ceil(start), 0, stops.shape[2]))
    total = np.cumsum(stops[:, :, first:], axis=2)
    return first + (total < OPAQUE).sum(axis=2)


def stand_of(columns: HeightMap, thing: np.ndarray) -> Plane | None:
    """The plane around the foot of a thing (V, 3); None where too little lies on one."""
    outer, inner = columns.box(thing, AROUND), columns.box(thing, 0)
    ring = np.zeros(columns.height.shape, bool)
    ring[outer] = True
    ring[inner] = False
    foot = thing[:, 1].min()
    points = columns.places()[ring.reshape(-1)]
    points = points[np.abs(points[:, 1] - foot) <= HIGH * columns.cell_m]  # NaN is not
    if not len(points):
        return None
    rows = np.c_[points[:, [0, 2]], np.ones(len(points))]
    fit = np.array([0.0, 0.0, np.median(points[:, 1])])
    for most in (2 * ON, ON, ON, ON):
        near = np.abs(points[:, 1] - rows @ fit) <= most * columns.cell_m
        if near.sum() < max(FEWEST, LEAST_SHARE * ring.sum()):
            return None
        fit = np.linalg.lstsq(rows[near], points[near, 1], rcond=None)[0]
    up = np.array([-fit[0], 1.0, -fit[1]]) / np.sqrt(1 + fit[:2] @ fit[:2])
    return Plane(up, float(fit[2] * up[1])) if up[1] >= STEEP else None


def heights(plane: Plane, points: np.ndarray) -> np.ndarray:
    """(N,) metres: of the plane below or above points (N, 3)."""
    return points[:, 1] - plane.height(points) / plane.normal[1]


def close_gaps(height: np.ndarray) -> None:
    """Gives gaps of at most 2 GAP columns the heights around them, in place."""
    from scipy import ndimage

    gaps = np.isnan(height)
    known = np.pad(~gaps, GAP)
    closed = ndimage.binary_closing(known, np.ones((3, 3)), GAP)[GAP:-GAP, GAP:-GAP] & gaps
    for _ in range(GAP):
        rows = closed & np.isnan(height)
        if not rows.any():
            return
        sure = np.isfinite(height).astype(float)
        total = ndimage.uniform_filter(np.nan_to_num(height), 3, mode="constant")
        share = ndimage.uniform_filter(sure, 3, mode="constant")
        fill = rows & (share > 0.05)
        height[fill] = total[fill] / share[fill]


def flatten(columns: HeightMap, thing: np.ndarray, stand: Plane) -> None:
    """Under a thing lies its plane, and around it where the heights are nearly on that."""
    outer, inner = columns.box(thing, AROUND), columns.box(thing, 1)
    under = heights(stand, columns.places()).reshape(columns.height.shape)
    height = columns.height
    near = np.abs(height[outer] - under[outer]) <= ON * columns.cell_m
    height[outer] = np.where(near, under[outer], height[outer])
    height[inner] = under[inner]


def block(columns: HeightMap, deep_m: float) -> TriangleMesh:
    """The watertight mesh of what lies below the heights: between their middles, and down to far
    below the lowest, where columns without a height are.
    """
    height = np.pad(columns.height, 1, constant_values=np.nan)
    low = float(np.nanmin(height)) - deep_m
    height = np.where(np.isnan(height), low, height)
    x, z = np.indices(height.shape)
    at = columns.low + (np.stack([x, z], 2) - 0.5) * columns.cell_m  # padded by one
    top = np.stack([at[..., 0], height, at[..., 1]], 2).reshape(-1, 3)
    number = np.arange(len(top)).reshape(height.shape)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    quad = np.stack([a, b, c, d], 2).reshape(-1, 4)
    rim = np.concatenate([number[0, ::-1], number[1:, 0], number[-1, 1:], number[-2:0:-1, -1]])
    bottom = (top[0] + top[-1]) / 2 - np.array([0.0, deep_m, 0.0])
    cone = np.stack([rim, np.roll(rim, -1), np.full(len(rim), len(top))], 1)
    faces = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]], cone]).astype(np.int32)
    return TriangleMesh(np.concatenate([top, bottom[None]]).astype(np.float32), faces)
