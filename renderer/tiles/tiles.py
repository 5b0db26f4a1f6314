"""Draws with rasterizer/ where there is no GPU: OpenCL tiles, 5 to 8 times faster than software GL.

What its methods mean: renderer/drawing.py.  No GL here.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles, bin_tiles, sort_order
from shapeshift.rasterizer.clusters.clusters import Clusters
from shapeshift.rasterizer.device import Device, open_device
from shapeshift.rasterizer.grade import grade_color
from shapeshift.rasterizer.heat import add_heat, blend_heat
from shapeshift.rasterizer.overdraw import count_overdraw
from shapeshift.rasterizer.pack import pack, pack_color, pack_opacity
from shapeshift.rasterizer.paging.pages import PageMap
from shapeshift.rasterizer.project import CULL_REASONS, Projected
from shapeshift.rasterizer.project_arena import SortFrames, project_arena
from shapeshift.rasterizer.quantize_keys import quantize_keys
from shapeshift.rasterizer.resolve import WindowOverlay, resolve
from shapeshift.rasterizer.splat_edges import draw_edges
from shapeshift.renderer.colors.false_colors import Shade
from shapeshift.renderer.colors.palette import palette_colors
from shapeshift.renderer.drawing import SAMPLE, Drawing, median_distance
from shapeshift.renderer.limits import arena_rows, check_tiles
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.sort_policy import SortPolicy
from shapeshift.renderer.surface import Surface
from shapeshift.renderer.tiles.blend import HeatAhead, blend_views
from shapeshift.renderer.tiles.culling import Culling
from shapeshift.renderer.tiles.depth import blend_depth, depth_pictures, surface_picture
from shapeshift.renderer.tiles.inputs import (
    behind,
    bin_view,
    camera_of,
    limits_of,
    read_rows,
    write_rows,
)
from shapeshift.renderer.tiles.keep_rows import keep_rows
from shapeshift.renderer.tiles.slot import Decoding, Slot, run_by, slots_of
from shapeshift.renderer.timing import PassTimer
from shapeshift.runtime_models.evaluate import only_fades
from shapeshift.runtime_models.model import Model, is_antialiased
from shapeshift.runtime_models.stop_weights import Controls, is_each
from shapeshift.scene.appearance import Appearance, Background
from shapeshift.scene.pose import OPENCV_FROM_EYE, View

if TYPE_CHECKING:
    from pyopencl.array import Array


class TilesDrawing(Drawing):
    """The arena of all objects on an OpenCL device, and the passes that draw it.

    mlps "opencl": networks run in our kernel where it knows them; "onnxruntime": its twin.
    """

    decodes_on_gpu = False

    def __init__(self, device: Device | None = None, mlps: str = "opencl") -> None:
        self.device, self._mlps = device or open_device(), mlps
        name = f"tiles ({self.device.platform})"
        self.backends = {"drawing": name, "mlps": mlps, "sort": name}
        self.allocations = 0  # how often the arena was made: once for each set of objects
        self._slots: list[Slot] = []
        self._decodings: dict[int, Decoding] = {}
        self._known: dict[int, Decoding] = {}  # of models that were drawn before and may be again
        self._images: dict[int, np.ndarray] = {}
        self._projected: list[Projected] = []
        self._rooms: dict[int, list[Projected]] = {}  # arrays of projection, kept between frames
        self._orders: list = []  # device arrays, splats near to far: one, or one a view
        self._sort_policy = SortPolicy()
        self._changed = True  # since the last frame: a pose, a control value, the set of objects
        self.culling = Culling()
        self._world_from_objects = np.zeros((0, 4, 4))
        self.sorts = self.order_age = 0  # of the last frame, see FrameStats
        self.draws_heat = False  # in addition to the colours, from the next frame on
        self._heat_images: dict[int, np.ndarray] = {}
        self._depths: dict[int, np.ndarray] = {}
        self._colors: list = []  # rows of four of each splat: one for all views, or one a view
        self._heats: list = []  # of the same splats, (N, 4) once an object has any
        self._heat_ahead = HeatAhead()

    def exchange(self, models: list[Model]) -> list[bool]:
        arena, slots, self._known = self._tables(), self._slots, self._decodings
        self.allocate(models)
        self._known = {}
        self._colors = [self.device.zeros((self.splats, 4)) for _ in arena[1]]
        self._heats = [h if h is None else self.device.zeros((self.splats, 4)) for h in arena[2]]
        self._color = self._colors[0]
        tables = [*zip(arena, self._tables(), strict=True)]
        return keep_rows(self.device, slots, self._slots, tables)

    def _tables(self) -> tuple[list, list, list]:
        return [self._mean_opacity, self._covariance], self._colors, self._heats

    def allocate(self, models: list[Model], more: int = 0, stored: int | None = None) -> None:
        """more: rows behind those of the objects, of which so many are stored, by default all."""
        check_tiles(self.device, models, more)
        counts = [arena_rows(model) for model in models]
        self.splats = sum(counts) + more
        self.allocations += 1
        device = self.device
        self._projected, self._rooms, self._orders = [], {}, []
        self._splats_moved()
        rows = self.splats if stored is None else sum(counts) + stored
        self._mean_opacity, self._covariance = device.zeros((rows, 4)), device.zeros((rows, 8))
        self._colors, self._heats = [device.zeros((self.splats, 4))], [None]
        self._color, self._set = self._colors[0], 0  # that decoding writes into
        self._antialiased = tuple(map(is_antialiased, models))
        index = np.repeat(np.arange(len(models), dtype=np.int32), counts)
        self._object_index = device.upload(np.pad(index, (0, more)))
        self._slots, self._decodings = slots_of(device, models, self._mlps, self._known)
        self.backends["mlps"] = run_by(self._mlps, self._slots)
        self._heat_ahead.open(models)

    def decode_geometry(
        self, i: int, x: Controls, eye_object: np.ndarray | None = None,
        seen: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        slot, arena = self._slots[i], (self._mean_opacity, self._covariance)
        heads, evaluator = slot.decoding.heads, slot.decoding.evaluator
        self._splats_moved()
        if heads is not None and not is_each(x):  # one control an anchor: onnxruntime's
            shapes = heads.shapes_follow or not slot.placed
            for first, part in heads.parts():
                part.anchors.decode_shapes(part.folded(x), slot.start + first, *arena, shapes)
            slot.placed = True
            return
        splats = evaluator.geometry(x, unit=False, eye=eye_object, seen=seen)
        if slot.placed and only_fades(evaluator.model):
            pack_opacity(self.device, splats[3], slot.start, self._mean_opacity)
            return
        pack(self.device, splats, slot.start, *arena)
        slot.placed = only_fades(evaluator.model)

    def color_set(self, which: int, count: int) -> None:
        self._colors = self._colors[:count]
        while len(self._colors) < count:
            self._colors.append(self.device.zeros((self.splats, 4)))
        self._heats = [*self._heats[:count], *[None] * (count - len(self._heats))]
        self._color, self._set = self._colors[which], which

    def decode_color(
        self, i: int, shade: Shade, eye_object: np.ndarray, seen: np.ndarray | None = None,
        at_once: bool = False, grade: Appearance | None = None,
    ) -> None:  # fmt: skip
        slot = self._slots[i]
        rows = slot.rows
        if self._heats[self._set] is None and shade.heats:
            self._heats[self._set] = self.device.zeros((self.splats, 4))
        kept, arena = self._heats[self._set], (self._mean_opacity, self._color)

        def mix(part: int, x: Controls) -> None:
            key, again = (self._set, part), bool(shade.heats)
            slot.decode_color(self.device, key, x, eye_object, seen, arena, again)

        for number, heat in enumerate(shade.heats):
            mix(number + 1, heat.control)
            palette = palette_colors(heat.palette) if at_once else None
            parts = (heat.weights, rows, self._color, kept, palette, number == 0)
            add_heat(self.device, *parts)
        if shade.rest is not None and not (shade.heats and slot.decoding.sh is not None):
            mix(0, shade.rest)
        if grade is not None and shade.rest is not None:
            grade_color(self.device, rows, self._color, grade.gain, grade.power)
        slot.forget_colors(self._set, len(shade.heats))
        if shade.heats:
            blend_heat(self.device, rows, self._color, kept, at_once)
        elif kept is not None and slot.count:
            self.device.clear(kept[rows])

    def seen_splats(
        self, i: int, views: Sequence[View], settings: RenderSettings
    ) -> np.ndarray | None:
        rows, poses = self._slots[i].rows, self._world_from_objects
        return self.culling.seen_rows(self.device, views, settings, poses, rows)

    def read_splats(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        arrays = (self._mean_opacity, self._covariance)
        mean_opacity, covariance = read_rows(self.device, self._slots[i].rows, *arrays)
        return mean_opacity, covariance

    def write_splats(self, i: int, mean_opacity: np.ndarray, covariance: np.ndarray | None) -> None:
        pairs = ((self._mean_opacity, mean_opacity), (self._covariance, covariance))
        write_rows(self._slots[i].rows, *pairs)
        self._splats_moved()

    def _splats_moved(self) -> None:
        self._changed = True
        self.culling.forget()

    def wait_decoded(self) -> None:
        """Returns when what was decoded is there: once for all objects, not after each."""
        self.device.queue.finish()

    def set_poses(self, world_from_objects: list[np.ndarray]) -> None:
        poses = np.reshape(world_from_objects, (-1, 4, 4))
        if not np.array_equal(poses, self._world_from_objects, equal_nan=True):
            self._world_from_objects, self._changed = poses, True

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
        with timer.time("project", on_gpu=False):
            self._project(views, settings, sets, again)
            self.device.queue.finish()
            self.culling.note(self.device, self._projected[-1].unseen)
        with timer.time("bin", on_gpu=False):
            tiles = self._bin(views, settings.key_bits)
            self.device.queue.finish()
        with timer.time("splat", on_gpu=False):
            for size in {view.size for view in views}:
                same = [i for i, view in enumerate(views) if view.size == size]
                drawn = [(self._projected[i], tiles[i]) for i in same]
                heats = self._heats_of([sets[i] for i in same]) if self.draws_heat else []
                alike = [views[i] for i in same]
                images, heats = blend_views(self.device, drawn, heats, alike, settings)
                numbers = [first + i for i in same]
                self._images.update(zip(numbers, images, strict=True))
                self._heat_images.update(zip(numbers, heats, strict=False))
        if settings.depth_scale > 0:
            with timer.time("depth", on_gpu=False):
                scene = (self.device, self._arena, self._world_from_objects)
                made = depth_pictures(*scene, self._projected, tiles, views, settings.depth_scale)
                self._depths.update(enumerate(made, first))

    @property
    def _page_map(self) -> PageMap | None:
        return None  # where rows that are drawn lie; None: where they are drawn

    @property
    def _arena(self) -> "tuple[Array, Array, Array, PageMap | None]":
        return self._mean_opacity, self._covariance, self._object_index, self._page_map

    def _heats_of(self, sets: Sequence[int]) -> list:
        """(N, 4) of each of these sets; made where there is none yet."""
        for which, heat in enumerate(self._heats):
            if heat is None:
                self._heats[which] = self.device.zeros((self.splats, 4))
        return [self._heats[which] for which in sets]

    def _project(
        self, views: list[View], settings: RenderSettings, sets: Sequence[int], again: bool
    ) -> None:
        """Ellipses of all views, two in each launch: a splat is read once for both eyes."""
        asked = (self._changed, self._median_distance, again)
        plan = self._sort_policy.plan(views, settings, *asked)
        self._changed = False
        frames = [OPENCV_FROM_EYE @ frame for frame in plan.frames]
        shared = len(frames) <= 1 < len(views)
        # One order for more views than a launch has must hold what none of its two sees.
        keep_outside = plan.keep_outside or (shared and len(views) > 2)
        self.culling.next_frame(self.device, self._arena, settings.min_alpha)
        clusters = None if keep_outside else self.culling.in_use(settings.min_alpha)
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

    def _launch(
        self, views: list[View], settings: RenderSettings, sort: SortFrames,
        into: list[Projected] | None = None, colors: list | None = None,
        clusters: Clusters | None = None,
    ) -> list[Projected]:  # fmt: skip
        first, *second = colors or self._colors
        return project_arena(
            self.device, self._mean_opacity, self._covariance, first, self._object_index,
            self._world_from_objects, [camera_of(view) for view in views], limits_of(settings),
            sort, into, self._antialiased, second[0] if second else None, clusters, self._page_map,
        )  # fmt: skip

    def _bin(self, views: list[View], key_bits: int) -> list[Tiles]:
        if self.sorts:
            sorted_by = self._projected[: self.sorts]  # views whose keys make an order
            for projected in sorted_by if key_bits == 16 else ():
                quantize_keys(self.device, projected.in_tiles)
            self._orders = [sort_order(self.device, p.in_tiles) for p in sorted_by]
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

    def _median_distance(self, eye_from_world: np.ndarray) -> float:
        """Metres from an eye to the median splat, from a sample of those that are there."""
        step = -(-self.splats // SAMPLE)
        mean_opacity = self.device.view(self._mean_opacity)[::step]
        owner = self.device.view(self._object_index)[::step]
        return median_distance(eye_from_world @ self._world_from_objects, mean_opacity, owner)

    def counts(self) -> dict[str, int]:
        if not self.splats:
            return dict.fromkeys(("drawn", *CULL_REASONS), 0)
        culled = self._projected[-1].culled(self.device)
        return {"drawn": self.splats - sum(culled.values()), **culled}

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

    def splat_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        read = self.device.download
        return read(self._mean_opacity), read(self._object_index), read(self._covariance)

    def write_colors(self, color: np.ndarray) -> None:
        for each in self._colors:
            pack_color(self.device, np.reshape(color, (self.splats, 3)), 0, each)

    def read_colors(self, i: int) -> tuple[np.ndarray, np.ndarray | None]:
        heat, rows = self._heats[self._set], self._slots[i].rows
        (color,) = read_rows(self.device, rows, self._color)
        kept = None if heat is None or not len(color) else read_rows(self.device, rows, heat)[0]
        return color[:, :3], kept

    def replace_colors(self, i: int, color: np.ndarray, heat: np.ndarray | None) -> None:
        pack_color(self.device, color, self._slots[i].start, self._color)
        if (kept := self._heats[self._set]) is not None:
            write_rows(self._slots[i].rows, (kept, heat))

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
