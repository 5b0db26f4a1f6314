"""What is surely solid of a place: what rays of cameras end on, and no other ray goes through.

Every pixel says two things: its ray is free from the camera to just before the depth, and a
surface lies there.  Cells of a grid near such surfaces are put to the vote of all pictures: more
rays that go through one than end on it make it free.  What no ray ends on is not solid, nor is
where a camera stands.  The surface is the mean of the pixels' planes (a truncated signed distance,
Curless and Levoy 1996), so it is finer than a cell.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shapeshift.scene.colliders.collider_wrap import simplify, within
from shapeshift.scene.colliders.marching_tetrahedra import find_surface
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.pose import View

CELLS = 160  # along the longest side, at most
MOST_PLACES = 200_000  # cells near surfaces, about; with more each is larger
OUTER = 1.0  # percent of the points seen on either side that the grid may leave out
FARTHEST = 3.0  # times the way to the subject, around that: so far the grid reaches
REACH = 2.5  # cells before and behind a surface in which a pixel knows it; behind lies its back
SURE = 1.0  # cells that a ray must go on behind a cell to have gone through it
SURE_SHARE = 0.01  # of the distance, the same: depths are no surer
LEAST_FREE = 0.3  # of a cell's votes that must be of rays through it for it to be free
LEAST_ENDS = 2  # rays, each of another picture, that end on what is solid; with few pictures 1
FEW = 6  # pictures
GRAZING = 0.15  # cosine between a surface and a ray, below which its plane is not known
BEND = 0.04  # of 1 / depth that both neighbours together may be off one plane with a pixel
LEAST_PART = 60  # cells of a piece; a smaller one is a floater
ROOM = 2  # empty cells around all
AROUND = 2.0  # cells around a camera that are free


@dataclass(frozen=True, eq=False)
class PhotoSight:
    """Where a photo was taken from, in few pixels."""

    view: View
    measured_m: np.ndarray | None = None  # (H, W) metres along the view, 0: not known


@dataclass(frozen=True, eq=False)
class SeenDepth:
    """How far one picture sees."""

    view: View
    depth_m: np.ndarray  # (H, W) along the view; Inf: nothing is seen, NaN: not known
    ends: np.ndarray | None = None  # (H, W) bool: pixels that end on what is looked for; None: all

    @property
    def solid(self) -> np.ndarray:
        """(H, W) bool: pixels that end on what is looked for."""
        return np.ones(self.depth_m.shape, bool) if self.ends is None else self.ends

    @cached_property
    def planes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(H, W, 3) unit normals towards the camera, world; (H, W) cosines to it, 0: not known; and
        (H, W) metres, the normal times each point of the plane.
        """
        points = self.points
        across, down = np.gradient(points, axis=1), np.gradient(points, axis=0)
        normal = np.cross(down, across)
        ray = points - self.view.world_from_eye.position
        with np.errstate(invalid="ignore", divide="ignore"):
            normal /= np.linalg.norm(normal, axis=2, keepdims=True)
            cosine = -(normal * ray).sum(2) / np.linalg.norm(ray, axis=2)
        normal[cosine < 0] *= -1
        cosine = np.nan_to_num(np.abs(cosine))
        cosine[self.edges] = 0
        offset = np.where(cosine > 0, (normal * points).sum(2), 0)
        normal[cosine <= 0] = 0
        return normal.astype(np.float32), cosine.astype(np.float32), offset.astype(np.float32)

    @cached_property
    def known_m(self) -> np.ndarray:
        """(H, W) float32 depths, NaN where there is none."""
        return np.where(np.isfinite(self.depth_m), self.depth_m, np.float32(np.nan))

    @property
    def points(self) -> np.ndarray:
        """(H, W, 3) float64 metres, world; NaN where nothing is seen.  Kept, they would be half of
        what eighty pictures take.
        """
        camera_from_world, fx, fy, cx, cy = self.view.pinhole()
        height, width = self.depth_m.shape
        rows, columns = np.mgrid[:height, :width] + 0.5
        ray = np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones_like(rows)], 2)
        at = ray * self.known_m[..., None].astype(np.float64) - camera_from_world[:3, 3]
        return at @ camera_from_world[:3, :3]

    @cached_property
    def edges(self) -> np.ndarray:
        """(H, W) bool: not on one plane with its neighbours.  Of a plane 1 / depth is linear."""
        with np.errstate(divide="ignore", invalid="ignore"):
            near = np.pad(1 / self.depth_m.astype(np.float64), 1, "reflect", reflect_type="odd")
        out = ~np.isfinite(self.depth_m)
        for axis in (0, 1):
            with np.errstate(invalid="ignore"):
                bend = np.diff(near, 2, axis=axis)
                bend = bend[:, 1:-1] if axis == 0 else bend[1:-1]
                out |= ~(np.abs(bend) <= BEND * near[1:-1, 1:-1])
        return out

    @cached_property
    def nearest(self) -> np.ndarray:
        """(H, W) the least depth of a pixel and its neighbours: so far all rays there are free."""
        from scipy import ndimage

        known = np.where(np.isnan(self.depth_m), 0, self.depth_m)  # unknown: free nowhere
        return ndimage.minimum_filter(known, 3, mode="nearest")


@dataclass(frozen=True)
class Votes:
    """What pictures say of places (N,)."""

    through: np.ndarray  # rays that go on behind it
    ends: np.ndarray  # rays that end near it
    height: np.ndarray  # metres before the surface there, below 0 behind it; NaN without `ends`


def votes(seen: Sequence[SeenDepth], places: np.ndarray, near_m: float) -> Votes:
    """Of places (N, 3) metres; near_m: as far before and behind a surface a pixel knows it."""
    through, ends = (np.zeros(len(places), np.int32) for _ in range(2))
    total, weight = (np.zeros(len(places), np.float32) for _ in range(2))
    middle = places.mean(0)  # short numbers: float32 is enough from there
    local = (places - middle).astype(np.float32)
    for one in seen:
        rows, at, z = shown_at(one.view, local, middle)
        sure = np.maximum(np.float32(SURE / REACH * near_m), np.float32(SURE_SHARE) * z)
        through[rows] += one.nearest.reshape(-1)[at] > z + sure
        normals, cosines, offsets = one.planes
        cosine = np.where(one.solid, cosines, 0).reshape(-1)[at]
        # What lies farther along the ray than that cannot be so near to the pixel's plane.
        known = np.flatnonzero(
            (cosine > GRAZING) & (np.abs(one.known_m.reshape(-1)[at] - z) * cosine < 2 * near_m)
        )
        rows, at, z, cosine = rows[known], at[known], z[known], cosine[known]
        normal = normals.reshape(-1, 3)[at]
        above = np.einsum("ij,ij->i", local[rows], normal)
        above -= offsets.reshape(-1)[at] - normal @ middle.astype(np.float32)
        near = np.flatnonzero(np.abs(above) <= near_m)
        rows, share = rows[near], cosine[near] / z[near]
        ends[rows] += 1
        total[rows] += share * above[near]
        weight[rows] += share
    with np.errstate(invalid="ignore"):
        return Votes(through, ends, total / np.where(weight > 0, weight, np.nan))


def shown_at(view: View, local: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, ...]:
    """Of places (N, 3) from a middle: rows that a picture shows, their pixels, metres along it."""
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    pixels = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]) @ camera_from_world[:3]  # (3, 4)
    moved = pixels[:, :3] @ middle + pixels[:, 3]
    u, v, z = (local @ pixels[:, :3].T.astype(np.float32) + moved.astype(np.float32)).T
    width, height = view.size
    rows = np.flatnonzero((z > 0) & (u >= 0) & (v >= 0) & (u < width * z) & (v < height * z))
    z = z[rows]
    column = np.minimum((u[rows] / z).astype(np.int32), width - 1)
    row = np.minimum((v[rows] / z).astype(np.int32), height - 1)
    return rows, row * width + column, z


def is_free(found: Votes) -> np.ndarray:
    """(N,) bool: rays go through there."""
    return found.through > LEAST_FREE * (found.through + found.ends)


def carved_mesh(
    seen: Sequence[SeenDepth], faces: int, things: Sequence[np.ndarray] = ()
) -> TriangleMesh | None:
    """A closed mesh of about so many faces around what is surely solid, the world's metres; None
    where that is nothing.

    things: corners (V, 3) of convex pieces of what stands there and is no part of it: nothing is
    solid within them, or a cell off.
    """
    from scipy import ndimage

    grid = grid_of(seen)
    if grid is None:
        return None
    low, cell, where, shape = grid
    places = low + (where + 0.5) * cell
    found = votes(seen, places, REACH * cell)
    least = LEAST_ENDS if len(seen) > FEW else 1
    eyes = np.array([one.view.world_from_eye.position for one in seen])
    free = is_free(found) | ~away_from(places, eyes, AROUND * cell)
    for corners in things:
        free |= is_within(places, corners.astype(np.float64), cell)
    # Before a surface its height stays, so that the field passes through 0 where the surface is.
    known = (found.ends >= least) & ((found.height > 0) | ~free)
    field = np.full(shape, 1.0, np.float32)
    field[tuple(where[known].T)] = found.height[known] / cell
    field[field == 0] = 1e-6
    pieces, count = ndimage.label(field < 0, np.ones((3, 3, 3)))
    small = np.bincount(pieces.ravel(), minlength=count + 1) < LEAST_PART
    field[(field < 0) & small[pieces]] = 1.0
    if not (field < 0).any():
        return None
    skin = find_surface(field)
    vertices = (skin.vertices + np.float32(0.5)) * np.float32(cell)  # from low: short numbers
    coarse = simplify(TriangleMesh(vertices, skin.faces), faces)
    return TriangleMesh((coarse.vertices + low).astype(np.float32), coarse.faces)


def grid_of(
    seen: Sequence[SeenDepth],
) -> tuple[np.ndarray, float, np.ndarray, np.ndarray] | None:
    """Where a grid begins (3,) metres, its cell, the cells (N, 3) near what rays end on, its shape.

    None where no ray ends on anything.
    """
    ends = [one.planes[1] > GRAZING for one in seen]
    solid = [found & one.solid for one, found in zip(seen, ends, strict=True)]
    every = np.concatenate(
        [np.zeros((0, 3)), *(o.points[s] for o, s in zip(seen, solid, strict=True))]
    )
    if not len(every):
        return None
    other = [found & ~mine for found, mine in zip(ends, solid, strict=True)]
    about = other if any(one.any() for one in other) else solid  # the things, if there are some
    subject = np.concatenate([one.points[m] for one, m in zip(seen, about, strict=True)])
    away = np.concatenate([one.depth_m[m] for one, m in zip(seen, about, strict=True)])
    middle, far = np.median(subject, axis=0), FARTHEST * float(np.median(away))
    low, high = np.percentile(every, (OUTER, 100 - OUTER), axis=0)
    low, high = np.maximum(low, middle - far), np.minimum(high, middle + far)
    cell = float((high - low).max()) / CELLS
    if not (cell > 0 and (high >= low).all()):
        return None
    while True:
        border = (
            ROOM + REACH + 1.37
        ) * cell  # no plane of the lowest points through cells' middles
        shape = np.ceil((high - low + 2 * border) / cell).astype(int)
        cells = np.floor((every - (low - border)) / cell).astype(np.int32)
        taken = np.zeros(shape, bool)
        taken[tuple(cells[((cells >= 0) & (cells < shape)).all(1)].T)] = True
        near = within(taken, int(np.ceil(REACH)))
        inner = np.zeros_like(near)
        inner[(slice(ROOM, -ROOM),) * 3] = True
        where = np.argwhere(near & inner)
        if len(where) <= 1.2 * MOST_PLACES:
            return low - border, cell, where, shape
        cell *= float(np.sqrt(len(where) / MOST_PLACES))  # places lie on surfaces


def is_within(places: np.ndarray, corners: np.ndarray, margin: float) -> np.ndarray:
    """(N,) bool: the places (N, 3) in the convex hull of corners (V, 3), or so many metres off it.

    Fur and carpets make a skin that stands above the plane around a thing and reaches into it.
    """
    from scipy.spatial import ConvexHull

    low, high = corners.min(0) - margin, corners.max(0) + margin
    near = np.flatnonzero(((places > low) & (places < high)).all(1))
    equations = ConvexHull(corners).equations  # (F, 4) outward normals
    for equation in equations:  # one after the other: all at once are hundreds of megabytes
        near = near[places[near] @ equation[:3] + equation[3] < margin]
    found = np.zeros(len(places), bool)
    found[near] = True
    return found


def away_from(places: np.ndarray, eyes: np.ndarray, radius_m: float) -> np.ndarray:
    """(N,) bool: places (N, 3) that no eye (E, 3) is nearer to than that."""
    from scipy.spatial import cKDTree

    return cKDTree(eyes).query(places, distance_upper_bound=radius_m)[0] >= radius_m
