"""When clusters of splats that lie behind what is drawn are left out of a frame, and which tiles
are drawn again for it.

A tile is done where all of its pixels are opaque, at some depth in the order of the splats.  What
that depth was in the last frame, in and around a tile, is a guess of where it is now: clusters that
lie behind it in all tiles that they may reach are neither projected nor sorted nor put into lists.
Then the depths of this frame say where the guess held.  A tile that was not done before the nearest
box that it might have shown is drawn again, from the splats of all clusters that may reach it.  So
pictures are the same to the bit, whatever is guessed.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from shapeshift.rasterizer.bin import Tiles
from shapeshift.rasterizer.clusters import CLUSTER, Clusters, Occluders
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.pages import PAGE
from shapeshift.rasterizer.project import TILE, Projected, grid_of
from shapeshift.rasterizer.raster import rasterize_noting
from shapeshift.renderer.foveation import hidden_tiles
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.sort_policy import SortPlan
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from pyopencl.array import Array

    from shapeshift.rasterizer.pages import Arena

LEAST_SPLATS = 1 << 15  # that a frame saves: to ask and to note how deep tiles are costs as much
PAUSE = 12  # frames until it is tried again
RECENT = 4  # frames that a mean is about
LONG_PAUSE = 1000
INFINITELY = 1e6  # metres, for where there is no depth
SLACK = 1.02  # of a depth: what one walks away from lies deeper in the next frame
ROUNDING = 1e-5  # of the terms of a sum, as in find_unseen.cl
LEAVE = 3  # a flag of find_unseen.cl: left out, and its rows are not touched
Drawn: TypeAlias = list[tuple[Projected, Tiles]]
Uncover: TypeAlias = "Callable[[Array], Drawn]"  # from flags of clusters


class Occlusion:
    """What one drawing knows of the depths of its last frame."""

    def __init__(self) -> None:
        self.allowed = True  # off: what tests and tools compare with
        self.hidden = self.redrawn = 0  # splats left out of the last frame, tiles drawn again
        self.watching = False  # in this frame: depths are noted
        self._occluders: Occluders | None = None  # of this frame
        self._depths: list[
            np.ndarray
        ] = []  # (tiles down, tiles across) metres: a batch behind, or inf
        self._views: list[View] = []
        self._paused = 0
        self._saved: float | None = None  # splats a frame, of late

    def forget(self) -> None:
        """Splats moved, grew or faded."""
        self._depths, self._views = [], []

    def rest(self) -> None:
        """Somebody needed the order of all: not again for a long while."""
        self._paused = LONG_PAUSE

    def begin(
        self, device: Device, clusters: Clusters | None, views: list[View], plan: SortPlan,
        settings: RenderSettings, whole: bool,
    ) -> Clusters | None:  # fmt: skip
        """Boxes with what hides them, for a projection; None: nothing is known, or nobody asks.

        clusters: boxes that are true, if there are any.  whole: what is left out would be missed.
        """
        self.hidden = self.redrawn = 0
        self._occluders = None
        self._paused = max(0, self._paused - 1)
        # Keys of 16 bits are those of a range, and what needs more than pictures needs all lists.
        exact = settings.order == "depth" and settings.key_bits == 32 and plan.sorts > 0
        exact &= not (plan.keep_outside or settings.debug or settings.depth_scale > 0 or whole)
        alike = len(views) <= 2 and len({view.size for view in views}) == 1
        self.watching = self.allowed and exact and alike and not self._paused
        if not self.watching or clusters is None:
            self.watching = False
            self.forget()
            return None
        limits = self._limits(views)
        if limits is None:
            return None
        self._occluders = Occluders.of(device, limits, clusters.bounds.shape[0])
        return replace(clusters, occluders=self._occluders)

    def _limits(self, views: list[View]) -> list[np.ndarray] | None:
        """How deep the tiles of these views may be done; None: nothing is known of them."""
        if len(views) != len(self._views):
            return None
        limits = []
        for depths, before, view in zip(self._depths, self._views, views, strict=True):
            unseen = hidden_tiles(view, TILE)
            guess = SLACK * widest(moved(depths, before, view))
            limits.append(guess if unseen is None else np.where(unseen, 0, guess))
        return limits

    def blend(
        self, device: Device, arena: "Arena", order_rows: list[np.ndarray], projected: Drawn,
        views: list[View], settings: RenderSettings, uncover: Uncover,
    ) -> list[np.ndarray]:  # fmt: skip
        """(H, W, 4) of each view, as if nothing had been left out.

        order_rows: of each view (O, 4), from places in an object to depths in the order.
        """
        size, least = views[0].size, settings.min_transmittance
        across, down = grid_of(size)
        images = [device.empty((*size[::-1], 4)) for _ in views]
        ends = [device.empty((across * down, 2), np.int32) for _ in views]

        def draw(drawn: Drawn, only: list[np.ndarray] | None) -> list[np.ndarray]:
            rasterize_noting(device, drawn, size, least, images, ends, only)
            device.queue.finish()
            pairs = zip(ends, order_rows, strict=True)
            return [depths_of(device, end, arena, rows) for end, rows in pairs]

        depths = draw(projected, None)
        if self._occluders is not None:
            missing = self._missing(device, depths, views)
            self.redrawn = int(np.sum(missing))
            chosen = self._chosen(device, missing, across)
            if self.redrawn:
                depths = draw(uncover(self._flags(device, chosen, projected)), missing)
            self._judge(device, chosen)
        self._depths = [depth[:, 1].reshape(down, across) for depth in depths]
        self._views = list(views)
        return [device.view(image) for image in images]

    def _missing(
        self, device: Device, depths: list[np.ndarray], views: list[View]
    ) -> list[np.ndarray]:
        """(tiles,) bool of each view: something was left out that may be seen there."""
        assert self._occluders is not None
        found, boxes = [], self._occluders.nearest_boxes(device)
        for depth, nearest, view in zip(depths, boxes, views, strict=True):
            missing = np.isfinite(nearest) & ~(depth[:, 0] < nearest)
            unseen = hidden_tiles(view, TILE)
            found.append(missing if unseen is None else missing & ~unseen.ravel())
        return found

    def _chosen(self, device: Device, tiles: list[np.ndarray], across: int) -> np.ndarray:
        """(C,) bool: clusters that may reach one of these tiles."""
        assert self._occluders is not None
        reached = device.view(self._occluders.reached)
        found = np.zeros(reached.shape[1], bool)
        for mask, boxes in zip(tiles, reached, strict=True):
            if not mask.any():
                continue
            sums = np.zeros((len(mask) // across + 1, across + 1), np.int32)
            sums[1:, 1:] = mask.reshape(-1, across).cumsum(0).cumsum(1)
            some = (boxes[:, 1] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 2])
            left, right, top, bottom = np.where(some[:, None], boxes, 0).T
            within = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
            found |= within > 0
        return found

    def _flags(self, device: Device, chosen: np.ndarray, projected: Drawn) -> "Array":
        """What a second projection leaves out; what the first one has left out becomes less."""
        first = projected[0][0].unseen
        assert first is not None and self._occluders is not None
        flags = device.download(first)
        again = chosen & ((flags == 0) | (device.view(self._occluders.hidden) > 0))
        first.set(np.where(again, 0, flags).astype(np.int32))
        return device.upload(np.where(again, 0, LEAVE).astype(np.int32))

    def _judge(self, device: Device, chosen: np.ndarray) -> None:
        """Whether it was worth it."""
        assert self._occluders is not None
        hidden = device.view(self._occluders.hidden)
        self.hidden = int(hidden.sum(dtype=np.int64))
        saved = self.hidden - CLUSTER * int(np.count_nonzero(chosen))
        # One frame with a door that opens is no reason to stop.
        known = self._saved if self._saved is not None else saved
        self._saved = known + (saved - known) / RECENT
        if self._saved < LEAST_SPLATS:
            self._paused, self._saved = PAUSE, None


def depths_of(device: Device, ends: "Array", arena: "Arena", rows: np.ndarray) -> np.ndarray:
    """(tiles, 2) float32 metres in the order, none of them less than those of these splats; inf
    where a tile would have taken more.

    ends (tiles, 2) as draw_cpu.cl has them; rows (O, 4): from places in an object to such a depth.
    """
    mean_opacity, _, object_index, pages = arena
    last = device.view(ends)
    splats = at = np.maximum(last, 0)
    if pages is not None:
        at = PAGE * device.view(pages.sources)[splats // PAGE].astype(np.int64) + splats % PAGE
    means = device.view(mean_opacity)[at, :3].astype(np.float64)  # (tiles, 2, 3)
    mine = rows[device.view(object_index)[splats]]
    terms = np.concatenate([mine[..., :3] * means, mine[..., 3:]], axis=-1)
    depth = terms.sum(-1) + ROUNDING * np.abs(terms).sum(-1)
    return np.where(last < 0, np.inf, depth).astype(np.float32)


def widest(depths: np.ndarray) -> np.ndarray:
    """(H, W) the largest of each and its eight neighbours."""
    across = np.maximum(depths[:, 1:], depths[:, :-1])
    wide = depths.copy()
    wide[:, 1:] = across
    wide[:, :-1] = np.maximum(wide[:, :-1], across)
    down = np.maximum(wide[1:], wide[:-1])
    out = wide.copy()
    out[1:] = down
    out[:-1] = np.maximum(out[:-1], down)
    return out


def moved(depths: np.ndarray, before: View, now: View) -> np.ndarray:
    """(tiles down, tiles across) the depths that one view's tiles had, where they lie in another.

    Tiles that none of them meets take the largest of their neighbours, inf where there is none.
    """
    known = np.isfinite(depths)
    camera_from_world, fx, fy, cx, cy = before.pinhole()
    centres = [TILE * (np.arange(count) + 0.5) for count in depths.shape[::-1]]
    x, y = ((c - middle) / f for c, middle, f in zip(centres, (cx, cy), (fx, fy), strict=True))
    z = np.where(known, depths, INFINITELY)
    places = np.stack([x * z, y[:, None] * z, z], axis=-1).reshape(-1, 3)
    into, fx, fy, cx, cy = now.pinhole()
    into = into @ np.linalg.inv(camera_from_world)
    x, y, z = into[:3, :3] @ places.T + into[:3, 3:]
    across, down = grid_of(now.size)
    front = z > now.near
    z_here = np.where(front, z, 1.0)
    column, row = (fx * x / z_here + cx) / TILE, (fy * y / z_here + cy) / TILE
    inside = front & (column >= 0) & (column < across) & (row >= 0) & (row < down)
    at = row[inside].astype(np.int64) * across + column[inside].astype(np.int64)
    deep = np.where(known.ravel()[inside], z[inside], np.inf)
    out = np.full(across * down, -np.inf)
    np.maximum.at(out, at, deep)
    there = out.reshape(down, across)
    there = np.where(there == -np.inf, widest(there), there)
    return np.where(there == -np.inf, np.inf, there)
