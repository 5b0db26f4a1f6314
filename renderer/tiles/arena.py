"""The splats of all objects on an OpenCL device: shapes and colours, decoded into one arena."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from shapeshift.rasterizer.clusters import CLUSTER, Clusters, bound_clusters
from shapeshift.rasterizer.colors import add_heat, blend_heat, grade_color
from shapeshift.rasterizer.device import Device, open_device
from shapeshift.rasterizer.pack import pack, pack_color, pack_opacity
from shapeshift.rasterizer.pages import PageMap
from shapeshift.rasterizer.project_arena import clusters_unseen
from shapeshift.renderer.colors.false_colors import Shade
from shapeshift.renderer.colors.palette import palette_colors
from shapeshift.renderer.drawing import SAMPLE, Drawing, median_distance
from shapeshift.renderer.limits import arena_rows, check_tiles
from shapeshift.renderer.resolution import scaled
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.tiles.inputs import (
    camera_of,
    limits_of,
    read_rows,
    write_rows,
)
from shapeshift.renderer.tiles.slot import Decoding, Slot, run_by, slots_of
from shapeshift.runtime_models.evaluate import only_fades
from shapeshift.runtime_models.model import Model, is_antialiased
from shapeshift.runtime_models.stop_weights import Controls, is_each
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from pyopencl.array import Array

    from shapeshift.rasterizer.pages import Arena

    Tables: TypeAlias = "list[Array | None]"  # with a row a splat


def keep_rows(
    device: Device, before: list[Slot], after: list[Slot], tables: "list[tuple[Tables, Tables]]"
) -> list[bool]:
    """Copies what objects of the same model have decoded, and puts their slots in place of new
    ones; which objects these are.  tables: pairs of the same, of the arena before and after.
    """
    kept = [False] * len(after)
    for i, (old, new) in enumerate(zip(before, after, strict=False)):
        if old.model is not new.model:
            continue
        kept[i] = True
        for sources, targets in tables:
            for source, target in zip(sources, targets, strict=True):
                if source is not None and target is not None and old.count:
                    device.copy_rows(source[old.rows], target, new.start)
        old.start, after[i] = new.start, old
    return kept


class TilesArena(Drawing):
    """What is drawn, without the frames.

    mlps "opencl": networks run in our kernel where it knows them; "onnxruntime": its twin.
    """

    def __init__(self, device: Device | None = None, mlps: str = "opencl") -> None:
        self.device, self._mlps = device or open_device(), mlps
        name = f"tiles ({self.device.platform})"
        self.backends = {"drawing": name, "mlps": mlps, "sort": name}
        self.allocations = 0  # how often the arena was made: once for each set of objects
        self._slots: list[Slot] = []
        self._decodings: dict[int, Decoding] = {}
        self._known: dict[int, Decoding] = {}  # of models that were drawn before and may be again
        self._changed = True  # since the last frame: a pose, a control value, the set of objects
        self.culling = Culling()
        self._world_from_objects = np.zeros((0, 4, 4))
        self._colors: list = []  # rows of four of each splat: one for all views, or one a view
        self._heats: list = []  # of the same splats, (N, 4) once an object has any

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

    def set_poses(self, world_from_objects: np.ndarray) -> None:
        poses = np.reshape(world_from_objects, (-1, 4, 4))
        if not np.array_equal(poses, self._world_from_objects, equal_nan=True):
            self._world_from_objects, self._changed = poses, True

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

    def _median_distance(self, eye_from_world: np.ndarray) -> float:
        """Metres from an eye to the median splat, from a sample of those that are there."""
        step = -(-self.splats // SAMPLE)
        mean_opacity = self.device.view(self._mean_opacity)[::step]
        owner = self.device.view(self._object_index)[::step]
        return median_distance(eye_from_world @ self._world_from_objects, mean_opacity, owner)

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


# When clusters of splats that no view sees are left out, and which splats need no colours for it.
#
# Boxes are made once a scene has rested for some frames: while x moves they would be made anew
# each time, and cost as much as they save. Where hardly anything is out of view nobody is asked,
# for some frames. Either way the picture and its counts are the same to the bit.

RESTS = 4  # frames with the same splats before boxes are made: these cost as one projection
LEAST_SPLATS = 1 << 16  # left out: to ask takes as long as to project a third of them
PAUSE = 8  # frames until it is asked again


class Culling:
    """The boxes of one arena, and whether they are used."""

    def __init__(self) -> None:
        self.allowed = True  # off: what tests and tools compare with
        self.left_out: int | None = None  # clusters of the last frame's last views; None: not asked
        self._clusters: Clusters | None = None
        self._rested = self._paused = 0

    def forget(self) -> None:
        """Splats moved, grew or faded."""
        self._clusters, self._rested, self._paused = None, 0, 0

    def boxes(self, min_alpha: float) -> Clusters | None:
        """The boxes, where they are true."""
        made = self._clusters if self.allowed else None
        return made if made is not None and made.min_alpha == min_alpha else None

    def in_use(self, min_alpha: float) -> Clusters | None:
        """The same where they were of use."""
        return None if self._paused else self.boxes(min_alpha)

    def next_frame(self, device: Device, arena: "Arena", least: float) -> None:
        """Once a frame; arena: mean_opacity, covariance, object_index, pages; least: alpha."""
        self._paused = max(0, self._paused - 1)
        if self._clusters is not None and self._clusters.min_alpha != least:
            self.forget()
        self._rested += 1
        due = self._clusters is None and self._rested > RESTS
        if due and arena[2].shape[0] >= LEAST_SPLATS:
            self._clusters = bound_clusters(device, *arena[:3], least, arena[3])

    def note(self, device: Device, unseen: "Array | None") -> None:
        """What a projection left out, (C,) as find_unseen.cl has it."""
        self.left_out = None
        if unseen is not None:
            self.left_out = int(np.count_nonzero(device.view(unseen)))
            if self.left_out * CLUSTER < LEAST_SPLATS:
                self._paused = PAUSE

    def seen_rows(
        self, device: Device, views: Sequence[View], settings: RenderSettings,
        world_from_objects: np.ndarray, rows: slice,
    ) -> np.ndarray | None:  # fmt: skip
        """(n,) bool: which of these rows of the arena the views may see; None: not asked."""
        clusters = self.in_use(settings.min_alpha)
        if clusters is None:
            return None
        cameras = [camera_of(scaled(view, settings.render_scale)) for view in views]
        unseen = clusters_unseen(device, clusters, cameras, limits_of(settings), world_from_objects)
        first, last = rows.start // CLUSTER, -(-rows.stop // CLUSTER)
        seen = np.repeat(~unseen[first:last], CLUSTER)
        return seen[rows.start - first * CLUSTER :][: rows.stop - rows.start]
