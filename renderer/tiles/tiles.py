"""Draws with rasterizer/ where there is no GPU: OpenCL tiles, 5 to 8 times faster than software GL.

What its methods mean: renderer/drawing.py.  No GL here.
"""

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles, bin_tiles, quantize_keys, sort_order
from shapeshift.rasterizer.clusters import Chosen, Clusters
from shapeshift.rasterizer.colors import compile_heat
from shapeshift.rasterizer.debug_passes import count_overdraw, draw_edges
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.foveate import rasterize_foveated
from shapeshift.rasterizer.project import CULL_REASONS, Projected
from shapeshift.rasterizer.project_arena import SortFrames, project_arena
from shapeshift.rasterizer.raster import compile_with_heat, rasterize_with_heat
from shapeshift.rasterizer.resolve import WindowOverlay, resolve
from shapeshift.renderer.colors.false_colors import has_heat
from shapeshift.renderer.foveation import foveas_of
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.sort_policy import SortPolicy
from shapeshift.renderer.surface import Surface
from shapeshift.renderer.tiles.arena import TilesArena
from shapeshift.renderer.tiles.inputs import (
    behind,
    bin_view,
    blend_depth,
    camera_of,
    depth_pictures,
    limits_of,
    surface_picture,
)
from shapeshift.renderer.tiles.occlusion import Drawn, Occlusion
from shapeshift.renderer.timing import PassTimer
from shapeshift.runtime_models.model import Model
from shapeshift.scene.appearance import Background
from shapeshift.scene.pose import OPENCV_FROM_EYE, View

if TYPE_CHECKING:
    from pyopencl.array import Array


class TilesDrawing(TilesArena):
    """The passes that draw an arena."""

    decodes_on_gpu = False

    def __init__(self, device: Device | None = None, mlps: str = "opencl") -> None:
        super().__init__(device, mlps)
        self._images: dict[int, np.ndarray] = {}
        self._heat_images: dict[int, np.ndarray] = {}
        self._depths: dict[int, np.ndarray] = {}
        self._projected: list[Projected] = []
        self._rooms: dict[int, list[Projected]] = {}  # arrays of projection, kept between frames
        self._orders: list = []  # device arrays, splats near to far: one, or one a view
        self._order_rows: list[np.ndarray] = []  # of each view, from objects to depths in it
        self._last: tuple | None = None  # what the last frame was projected with
        self._sort_policy, self.occlusion = SortPolicy(), Occlusion()
        self.sorts = self.order_age = 0  # of the last frame, see FrameStats
        self.draws_heat = False  # in addition to the colours, from the next frame on
        self._heat_ahead = HeatAhead()

    def allocate(self, models: list[Model], more: int = 0, stored: int | None = None) -> None:
        self._projected, self._rooms, self._orders, self._last = [], {}, [], None
        super().allocate(models, more, stored)
        self._heat_ahead.open(models)

    def draw(
        self, views: list[View], settings: RenderSettings, timer: PassTimer, first: int = 0,
        sets: Sequence[int] = (), again: bool = False,
    ) -> None:  # fmt: skip
        if not self.splats:
            for i, view in enumerate(views, first):
                nothing = np.zeros((*view.size[::-1], 4), np.float32)
                self._images[i] = self._depths[i] = nothing
                self._heat_images[i] = nothing[..., :2]
            return
        self._heat_ahead.next_frame(self.device)
        sets = sets or [first + i if len(self._colors) > 1 else 0 for i in range(len(views))]
        whole = bool(first or self.draws_heat or foveas_of(views, settings))
        if again and self.occlusion.hidden:
            self._order_whole()
        with timer.time("project", on_gpu=False):
            self._project(views, settings, sets, again, whole or self.device.kind != "cpu")
            self.device.queue.finish()
            self.culling.note(self.device, self._projected[-1].unseen)
        with timer.time("bin", on_gpu=False):
            tiles = self._bin(views, settings.key_bits)
            self.device.queue.finish()
        with timer.time("splat", on_gpu=False):
            self._blend(views, settings, sets, tiles, first)
        if settings.depth_scale > 0:
            with timer.time("depth", on_gpu=False):
                scene = (self.device, self._arena, self._world_from_objects)
                made = depth_pictures(*scene, self._projected, tiles, views, settings.depth_scale)
                self._depths.update(enumerate(made, first))

    def _blend(
        self, views: list[View], settings: RenderSettings, sets: Sequence[int], tiles: list[Tiles],
        first: int,
    ) -> None:  # fmt: skip
        if self.occlusion.watching:
            drawn = list(zip(self._projected, tiles, strict=True))
            given = (self.device, self._arena, self._order_rows, drawn, views, settings)
            self._images.update(enumerate(self.occlusion.blend(*given, self._uncover)))
            return
        for size in {view.size for view in views}:
            same = [i for i, view in enumerate(views) if view.size == size]
            drawn = [(self._projected[i], tiles[i]) for i in same]
            heats = self._heats_of([sets[i] for i in same]) if self.draws_heat else []
            alike = [views[i] for i in same]
            images, heats = blend_views(self.device, drawn, heats, alike, settings)
            numbers = [first + i for i in same]
            self._images.update(zip(numbers, images, strict=True))
            self._heat_images.update(zip(numbers, heats, strict=False))

    def _project(
        self, views: list[View], settings: RenderSettings, sets: Sequence[int], again: bool,
        whole: bool,
    ) -> None:  # fmt: skip
        """Ellipses of all views, two in each launch: a splat is read once for both eyes.

        whole: what lies behind what is drawn would be missed.
        """
        asked = (self._changed, self._median_distance, again)
        plan = self._sort_policy.plan(views, settings, *asked)
        self._changed = False
        frames = [OPENCV_FROM_EYE @ frame for frame in plan.frames]
        shared = len(frames) <= 1 < len(views)
        # One order for more views than a launch has must hold what none of its two sees.
        keep_outside = plan.keep_outside or (shared and len(views) > 2)
        self.culling.next_frame(self.device, self._arena, settings.min_alpha)
        boxes = None if keep_outside else self.culling.boxes(settings.min_alpha)
        hiding = self.occlusion.begin(self.device, boxes, views, plan, settings, whole or again)
        clusters = hiding or (boxes and self.culling.in_use(settings.min_alpha))
        rows = [(frame @ self._world_from_objects)[:, 2] for frame in frames]  # (O, 4)
        self._order_rows = rows * (len(views) if shared else 1)
        self._projected = []
        for first in range(0, len(views), 2):
            pair = views[first : first + 2]
            mine = frames[first : first + (1 if shared else 2)]
            sort = SortFrames(tuple(mine), settings.order == "distance", keep_outside)
            colors = [self._colors[which] for which in dict.fromkeys(sets[first : first + 2])]
            given = (sort, self._rooms.get(first), colors, clusters)
            self._rooms[first] = projected = self._launch(pair, settings, *given)
            self._projected += projected
        self.sorts, self.order_age = plan.sorts, plan.age
        if not again:
            self._last = (views, settings, sets, sort, colors)

    def _order_whole(self) -> None:
        """The order of the last frame with what was left out of it behind what is drawn."""
        assert self._last is not None
        views, settings, sets, *_ = self._last
        self.occlusion.rest()
        self._project(views, settings, sets, False, True)
        self._sort(settings.key_bits)

    def _uncover(self, flags: "Array") -> Drawn:
        """Lists of some clusters of the last frame, also of those that were left out of it."""
        assert self._last is not None
        views, settings, _, sort, colors = self._last
        into = [
            replace(p, culled_counts=self.device.empty(counts.shape, np.int32))
            for p in self._projected
            if (counts := p.culled_counts) is not None  # in what project_arena made
        ]
        projected = self._launch(views, settings, sort, into, colors, Chosen(flags))
        self.device.queue.finish()
        orders = [sort_order(self.device, p.in_tiles) for p in projected[: self.sorts]]
        orders *= len(views) if len(orders) == 1 else 1
        made = zip(projected, views, orders, strict=True)
        return [(p, bin_view(self.device, p, view, order)) for p, view, order in made]

    def _launch(
        self, views: list[View], settings: RenderSettings, sort: SortFrames,
        into: list[Projected] | None = None, colors: list | None = None,
        clusters: Clusters | Chosen | None = None,
    ) -> list[Projected]:  # fmt: skip
        first, *second = colors or self._colors
        return project_arena(
            self.device, self._mean_opacity, self._covariance, first, self._object_index,
            self._world_from_objects, [camera_of(view) for view in views], limits_of(settings),
            sort, into, self._antialiased, second[0] if second else None, clusters, self._page_map,
        )  # fmt: skip

    def _sort(self, key_bits: int) -> None:
        sorted_by = self._projected[: self.sorts]  # views whose keys make an order
        for projected in sorted_by if key_bits == 16 else ():
            quantize_keys(self.device, projected.in_tiles)
        self._orders = [sort_order(self.device, p.in_tiles) for p in sorted_by]

    def _bin(self, views: list[View], key_bits: int) -> list[Tiles]:
        if self.sorts:
            self._sort(key_bits)
        orders = self._orders * (len(views) if len(self._orders) == 1 else 1)
        made = zip(self._projected, views, orders, strict=True)
        return [bin_view(self.device, *each) for each in made]

    @contextmanager
    def order_set_aside(self) -> Iterator[None]:
        names = ("_orders", "sorts", "order_age", "_changed")
        kept, sort_policy = [getattr(self, name) for name in names], copy(self._sort_policy)
        try:
            yield
        finally:
            self._sort_policy = sort_policy
            for name, value in zip(names, kept, strict=True):
                setattr(self, name, value)

    def counts(self, wait: bool = False) -> dict[str, int]:
        if not self.splats:
            return dict.fromkeys(("drawn", *CULL_REASONS), 0)
        culled = self._projected[-1].culled(self.device)
        drawn = self.splats - sum(culled.values())
        culled["frustum"] -= self.hidden  # as what they were left out
        return {"drawn": drawn, **culled}

    @property
    def hidden(self) -> int:
        return self.occlusion.hidden

    def presentable(self, i: int) -> np.ndarray:
        return self._images[i]

    def unit_of(self, i: int) -> float:
        return 1.0  # floats hold any display value

    def presentable_heat(self, i: int) -> np.ndarray:
        return self._heat_images[i]

    def presentable_bytes(
        self, i: int, background: Background, view: View, palette: np.ndarray | None = None,
        heat: bool = False, as_window: bool = False, overlay: WindowOverlay | None = None,
    ) -> np.ndarray:  # fmt: skip
        given = (self._images[i], behind(background, view), palette)
        beside = self._heat_images[i] if heat else None
        return resolve(self.device, *given, beside, as_window=as_window, overlay=overlay)

    def presentable_depth(self, i: int) -> np.ndarray:
        return self._depths[i]

    def overdraw(self, i: int, view: View, settings: RenderSettings) -> np.ndarray:
        if not self.splats:
            return np.zeros(view.size[::-1], np.int32)
        return count_overdraw(self.device, self._projected[i], view.size)

    def edges(self, i: int, view: View, settings: RenderSettings, kind: str) -> np.ndarray:
        if not self.splats:
            return np.zeros((*view.size[::-1], 4), np.float32)
        order = self._orders[i if len(self._orders) > 1 else 0]
        return draw_edges(self.device, self._projected[i], order, view.size, kind)

    def surface(self, view: View, settings: RenderSettings) -> Surface:
        """Depth, normals and coverage from a view; the last frame stays as it is."""
        if not self.splats:
            return Surface.empty(view.size)
        sort = SortFrames((camera_of(view).camera_from_world,), settings.order == "distance")
        (projected,) = self._launch([view], settings, sort)
        order = sort_order(self.device, projected.in_tiles)
        tiles = bin_tiles(self.device, projected, view.size, order=order)
        drawn = (self._arena, self._world_from_objects, projected, tiles, view)
        return surface_picture(self.device, blend_depth(self.device, *drawn))

    def image(self, i: int) -> np.ndarray:
        return self._images[i]

    def heat(self, i: int) -> np.ndarray:
        return self._heat_images[i]

    def close(self) -> None:
        """Lets go of the scene's memory; the device outlives this drawing."""
        self.allocate([])
        self._images.clear()
        self._heat_images.clear()
        self.device.pool.free_held()


# Views of one size, projected and put into lists, as pictures in memory.


def blend_views(
    device: Device, drawn: "list[tuple[Projected, Tiles]]", heats: "list[Array]",
    views: Sequence[View], settings: RenderSettings,
) -> tuple[list[np.ndarray], list[np.ndarray]]:  # fmt: skip
    """(H, W, 4) of each view, and (H, W, 2) of its heat where any is given."""
    size, least = views[0].size, settings.min_transmittance
    foveas = foveas_of(views, settings)
    if foveas and device.kind == "gpu":
        say_whole()
    elif foveas:
        return rasterize_foveated(device, drawn, heats, size, foveas, least)
    return rasterize_with_heat(device, drawn, heats, size, min_transmittance=least)


@cache
def say_whole() -> None:
    """Once."""
    logging.getLogger("renderer").warning(
        "tiles on an OpenCL GPU are drawn in all pixels, whatever foveation says; quads follow it."
    )


class HeatAhead:
    """Compiles what the first frame with heat would, with the second frame of a set of models.

    Not with the first, which is there 0.4 s sooner where no kernel was ever compiled.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._counts: set[int] = set()  # splats of those models that have heat

    def open(self, models: list[Model]) -> None:
        """Another set of models."""
        self._frames = 0
        self._counts = {m.splat_count for m in models if m.splat_count and has_heat(m)}

    def next_frame(self, device: Device) -> None:
        self._frames += 1
        if self._frames == 2 and self._counts:
            for count in {min(self._counts), max(self._counts)}:
                compile_heat(device, count)
            compile_with_heat(device, min_transmittance=RenderSettings().min_transmittance)
