"""project_arena: splats of posed objects -> ellipses, tiles and sort keys of one or two views."""

from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shapeshift.rasterizer.clusters import CLUSTER, Chosen, Clusters, clusters_of, find_unseen
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.pages import PageMap, defines_of_pages
from shapeshift.rasterizer.project import (
    CULL_REASONS,
    LEAST_ALPHA,
    LOW_BITS,
    LOW_PASS,
    RECORD,
    Camera,
    Projected,
    TileScratch,
    chunks_of,
    grid_of,
)

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "project_arena.cl"
FARTHEST = 1e18  # metres, or pixels: its square is a finite float


@dataclass(frozen=True)
class Limits:
    """What is left out of a frame, gate by gate; see renderer.settings for the prices."""

    min_alpha: float = LEAST_ALPHA
    max_pixels: float = inf  # one sigma of the longer screen axis
    max_distance: float = inf  # metres from the eye
    min_pixels: float = 0.0  # of the longer axis where alpha reaches min_alpha
    fade: float = 0.0  # part of each limit over which opacity falls to 0 before it
    low_pass: float = LOW_PASS  # px^2

    def packed(self) -> np.ndarray:
        """(13,) float32 as kernels/common/limits.cl reads it."""
        limits = (self.max_pixels, self.max_distance, self.min_pixels)
        large, far, least = (min(limit, FARTHEST) for limit in limits)
        bands = [1 / (self.fade * t) if 0 < self.fade * t < inf else 0.0 for t in limits]
        rows = [self.min_alpha, 1 / self.min_alpha, self.low_pass, large, large**2, far, far**2]
        return np.array([*rows, least, least**2, *bands, any(bands)], np.float32)


@dataclass(frozen=True)
class SortFrames:
    """By what splats are ordered: camera_from_world (4, 4), OpenCV axes, one or one a view.

    by_distance: metres to the frame's origin instead of along its z.  keep_outside: splats that no
    view sees are ordered, too, so that the order can be kept while the views turn.
    """

    camera_from_world: tuple[np.ndarray, ...]
    by_distance: bool = False
    keep_outside: bool = False


def project_arena(
    device: Device, mean_opacity, covariance, color, object_index, world_from_object,
    cameras: list[Camera], limits: Limits | None = None, sort: SortFrames | None = None,
    into: list[Projected] | None = None, antialiased: tuple[bool, ...] = (), second_color=None,
    clusters: Clusters | Chosen | None = None, pages: PageMap | None = None,
) -> list[Projected]:  # fmt: skip
    """For drawing: N splats of O posed objects in one or two views; counts what each gate drops.

    mean_opacity (N, 4) object frame metres and 0..1; covariance (N, 8) m^2, object frame, xx xy xz
    yy yz zz and two unused; color (N, 4), last unused, and second_color, that of the second view
    where it has its own; object_index (N,) int32; device arrays.
    world_from_object: numpy (O, 3 or 4, 4) or (O, 12) rows, rigid.
    sort: no camera_from_world at all: no keys, an order from before is to be used; None: by depth,
    each view for itself.  With one frame for two views both share the pairs to be sorted.
    into: an earlier result, whose arrays are filled again where they fit (making them anew takes
    longer than projecting 10,000 splats).
    antialiased: one an object, or none where no object is: opacity falls as the low pass grows the
    ellipse, by sqrt(det / det with it) (Mip-Splatting's 2D filter, gsplat's "antialiased").
    clusters: boxes of the same arena, by which it leaves out what no view sees: not with
    keep_outside, and `into` must be the latest result that was made in its arrays.  Chosen ones are
    projected into these, and what they hold of others stays; orders and counts are theirs alone.
    pages: the rows that are drawn, in pages of mean_opacity and covariance; color, second_color and
    object_index are theirs, N is their number.
    """
    limits = limits or Limits()
    sort = sort or SortFrames(tuple(camera.camera_from_world for camera in cameras))
    count, views, orders = object_index.shape[0], len(cameras), len(sort.camera_from_world)
    if views not in (1, 2) or orders not in (0, 1, views):
        raise ValueError(f"project_arena takes 1 or 2 views and 0, 1 or as many sort frames, "
                         f"not {views} and {orders}.")  # fmt: skip
    if clusters is not None and sort.keep_outside:
        raise ValueError("an order of all splats cannot leave out those that nobody sees.")
    grids = [grid_of(camera.size) for camera in cameras]
    if into is None or not _fits(into, count, orders, grids):
        into = _room(device, count, orders, grids)
    poses = _poses(cameras, sort, world_from_object)
    variant = {"VIEWS": views, "ORDERS": orders, **lanes_of(device)} | defines_of_pages(pages)
    if second_color is not None and views == 2:
        variant["OWN_COLORS"] = 1
    if any(antialiased):
        flags = np.array(antialiased, np.float32)
        poses = np.concatenate([poses.reshape(len(flags), -1), flags[:, None]], axis=1)
        variant["ANTIALIASED"] = 1
    packed = [limits.packed(), *(_packed(camera) for camera in cameras), poses.ravel()]
    frame = device.constants(np.concatenate(packed))
    asked = (views, orders, poses[0].size, frame)
    unseen, said = _left_out(device, clusters, into[0].unseen, count, asked)
    projected = [replace(p, low_pass=limits.low_pass, unseen=said) for p in into]
    buffers = [_buffers(p) for p in projected]
    scratch = projected[0].in_tiles
    device.launch(
        device.program(KERNEL, **variant)["project_arena"], len(scratch.status), 1,
        count, scratch.chunk, sort.by_distance, sort.keep_outside, unseen,
        *(pages.arrays if pages else (None, None)), frame, mean_opacity, covariance, color,
        second_color, object_index,
        *buffers[0], *(buffers[1] if views == 2 else [None] * len(buffers[0])),
    )  # fmt: skip
    return projected


def _left_out(
    device: Device, clusters: Clusters | Chosen | None, said: "Array | None", count: int,
    asked: tuple[int, int, int, Any],
) -> "tuple[Array | None, Array | None]":  # fmt: skip
    """Flags of clusters for a launch, and those of rows that say "culled" after it.

    said: the latter before it; asked: what find_unseen takes of a frame.
    """
    if isinstance(clusters, Chosen):
        return clusters.unseen, said
    if clusters is None:
        return None, None
    unseen = device.empty(clusters_of(count), np.int32) if said is None else said
    find_unseen(device, clusters, *asked, unseen, said is not None)
    return unseen, unseen


def clusters_unseen(
    device: Device, clusters: Clusters, cameras: list[Camera], limits: Limits, world_from_object
) -> np.ndarray:
    """(C,) bool: what project_arena would leave out of a frame of all these cameras."""
    poses = _poses(cameras, SortFrames(()), world_from_object)
    packed = [limits.packed(), *(_packed(camera) for camera in cameras), poses.ravel()]
    unseen = device.empty(clusters.bounds.shape[0], np.int32)
    frame = device.constants(np.concatenate(packed))
    clusters = replace(clusters, occluders=None)
    find_unseen(device, clusters, len(cameras), 0, poses[0].size, frame, unseen, False)
    found: np.ndarray = device.view(unseen) != 0
    return found


def lanes_of(device: Device) -> dict[str, int]:
    """LANES of kernels/common/vector.cl, where they are not eight."""
    return {"LANES": 16} if device.lanes >= 16 else {}


def _fits(earlier: list[Projected], count: int, orders: int, grids: list) -> bool:
    """Whether the arrays of an earlier result are those that this one needs."""
    if [p.in_tiles.grid for p in earlier] != grids:
        return False
    pairs = {id(p.in_tiles.pairs) for p in earlier if p.in_tiles.pairs is not None}
    return earlier[0].depth.shape[0] == count and len(pairs) == orders


def _room(device: Device, count: int, orders: int, grids: list) -> list[Projected]:
    """Arrays for `count` splats in as many views as there are grids."""
    chunks = chunks_of(device, count)
    chunk = -(-count // (chunks * CLUSTER)) * CLUSTER  # whole clusters but for the last
    keys: list = [
        (device.empty((count, 2), np.uint32), device.empty((chunks, 1 << LOW_BITS), np.int32))
        for _ in range(orders)
    ]
    keys = keys * len(grids) if orders == 1 else keys or [(None, None)] * len(grids)
    return [
        Projected(
            device.empty((count, RECORD)),
            device.empty(count),
            culled_counts=device.empty((chunks, len(CULL_REASONS)), np.int32),
            scratch=TileScratch(
                device.empty((count, 2), np.uint32),
                pairs,
                table,
                device.empty((chunks, 4), np.uint32),
                chunk,
                grid,
            ),
        )
        for (pairs, table), grid in zip(keys, grids, strict=False)
    ]


def _buffers(projected: Projected) -> tuple:
    scratch = projected.in_tiles
    results = (projected.record, projected.depth, projected.culled_counts)
    return (*results, scratch.tile_bounds, scratch.status, scratch.pairs, scratch.table)


def _packed(camera: Camera) -> np.ndarray:
    """(25,) float32 as kernels/common/limits.cl reads a view."""
    rest = (*camera.size, camera.near, *grid_of(camera.size))
    return np.concatenate([camera.packed(), np.array(rest, np.float32)])


def _poses(cameras: list[Camera], sort: SortFrames, world_from_object) -> np.ndarray:
    """(O, blocks, 12) float32: rows from each object into every camera and sort frame."""
    poses = np.asarray(world_from_object, np.float64)
    poses = poses.reshape(-1, poses.size // max(1, len(poses)) // 4, 4)[:, :3]  # (O, 3, 4)
    into = [camera.camera_from_world for camera in cameras] + list(sort.camera_from_world)
    chained = np.stack([np.asarray(m, np.float64)[:3, :3] @ poses for m in into], axis=1)
    chained[..., 3] += np.stack([np.asarray(m, np.float64)[:3, 3] for m in into])
    return chained.reshape(-1, len(into), 12).astype(np.float32)
