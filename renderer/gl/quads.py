"""Draws with GL: compute passes and quads, made for a GPU; software GL runs the same.

What its methods mean: renderer/drawing.py.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from itertools import pairwise

import moderngl
import numpy as np

from shapeshift.rasterizer.debug_passes import BAND_PX, EDGE_POWER, KINDS, POINT_PX
from shapeshift.renderer.colors.false_colors import Shade, has_heat
from shapeshift.renderer.drawing import SAMPLE, Drawing, median_distance
from shapeshift.renderer.foveation import foveas_of
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.gl.decode import Decoder
from shapeshift.renderer.gl.foveated import FoveatedSplatter
from shapeshift.renderer.gl.gpu import Gpu, overwrite
from shapeshift.renderer.gl.project import Projector
from shapeshift.renderer.gl.sort_check import checked_sorter
from shapeshift.renderer.gl.splat import Splatter
from shapeshift.renderer.gl.stereo_pair import LEAST_LOW_PASS, StereoPairSplatter
from shapeshift.renderer.gl.surface import DepthPictures, draw_surface
from shapeshift.renderer.gl.target import brightest, choose_target, warn_once
from shapeshift.renderer.layout import MOST_VIEWS
from shapeshift.renderer.limits import arena_rows
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.sort_policy import SortPolicy, sort_frames
from shapeshift.renderer.surface import Surface
from shapeshift.renderer.timing import PassTimer
from shapeshift.runtime_models.evaluate import follows_eye
from shapeshift.runtime_models.model import Model, is_antialiased
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import View

WHOLE = "quads on software GL are drawn in all pixels, whatever foveation says; tiles follow it."


class QuadsDrawing(Drawing):
    """The arena of all objects in GL buffers, and the passes that draw it."""

    def __init__(self, gpu: Gpu, mlps: str, sort: str) -> None:
        self._sorter, sort = checked_sorter(gpu, sort)
        self.backends = {"drawing": "quads", "mlps": mlps, "sort": sort}
        self._mlps = mlps
        self.decodes_on_gpu = mlps == "gl"  # says which clock times the decoding
        self._gpu = gpu
        self._projector = Projector(gpu, key_range=self._sorter.backend == "gl")
        self._splatter = Splatter(gpu)
        self.stereo_pair = StereoPairSplatter(gpu) if is_software(gpu.ctx) else None
        self._foveated = FoveatedSplatter(gpu)
        # Software GL pays for triangles, and drawing twice has twice as many.
        self.foveates = not is_software(gpu.ctx)
        self.counts_age = 0
        self._depths = DepthPictures(gpu)
        self.sorts = self.order_age = 0  # of the last frame, see FrameStats
        self._sort_policy = SortPolicy()
        self._changed = True  # since the last frame: a pose, a control value, the set of objects
        self._models: list[Model] = []
        self._most: list[float] = []  # brightest colour of each of these; []: not known yet
        self._grades: dict[int, Appearance | None] = {}  # of objects whose colours are graded
        self._last = 0  # row of the counts of the view drawn last
        self.draws_heat = False  # in addition to the colours, from the next frame on
        self.arena: Arena  # these two from allocate() on
        self._decoder: Decoder
        self._allocated: list[Arena | Decoder] = []

    @property
    def allocations(self) -> int:
        """How many buffers and textures were ever made."""
        return self._gpu.allocations

    def allocate(self, models: list[Model], more: int = 0, stored: int | None = None) -> None:
        """more: rows behind those of the objects; stored: rows that splats of these lie in."""
        self._release_arena()
        self._changed = True
        self._models, self._most = models, []
        self._grades = {}
        counts, antialiased = list(map(arena_rows, models)), tuple(map(is_antialiased, models))
        self.arena = Arena(self._gpu, counts, antialiased, more, stored)
        self._decoder = Decoder(self._gpu, self.arena, models, self._mlps)
        self._allocated = [self.arena, self._decoder]
        if any(map(has_heat, models)):
            self._splatter.program_for(heat=True)  # compiled now, not in the first frame with heat
        on_cpu = self._mlps == "gl" and any(follows_eye(model) for model in models)
        self.backends["mlps"] = f"{self._mlps}, Scaffold-GS onnxruntime" if on_cpu else self._mlps

    def decode_geometry(
        self,
        i: int,
        x: Controls,
        eye_object: np.ndarray | None = None,
        seen: np.ndarray | None = None,
    ) -> None:
        self._changed = True
        self._decoder.geometry(i, x, eye_object, seen)

    def color_set(self, which: int, count: int) -> None:
        self.arena.color_set(which, count)

    def decode_color(
        self,
        i: int,
        shade: Shade,
        eye_object: np.ndarray,
        seen: np.ndarray | None = None,
        at_once: bool = False,
        grade: Appearance | None = None,
    ) -> None:
        self._grades[i] = grade
        self._decoder.shade(i, shade, eye_object, seen, at_once, grade)

    def read_splats(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        return self.arena.read_splats(i)

    def write_splats(self, i: int, mean_opacity: np.ndarray, covariance: np.ndarray | None) -> None:
        self.arena.write_splats(i, mean_opacity, covariance)
        self._changed = True

    def wait_decoded(self) -> None:
        """Nothing: GL keeps the order of the passes itself."""

    def set_poses(self, world_from_objects: np.ndarray) -> None:
        poses = np.reshape(world_from_objects, (-1, 4, 4))
        if not np.array_equal(poses, self.arena.world_from_object, equal_nan=True):
            self._changed = True
            self.arena.set_poses(poses)

    def draw(
        self, views: list[View], settings: RenderSettings, timer: PassTimer, first: int = 0,
        sets: Sequence[int] = (), again: bool = False,
    ) -> None:  # fmt: skip
        arena = self.arena
        target, unit = choose_target(self._gpu, settings.target, self._brightest())
        self._splatter.target, self._splatter.unit = target, unit
        self.backends["drawing"] = f"quads ({target})"
        canted = len(sort_frames(views, settings)) > 1
        if canted:  # an order a view, and room for one: none is kept
            settings = replace(settings, resort_frames=1, resort_degrees=0.0)
        again &= not canted  # else the order is that of one view alone
        asked = (self._changed, self._median_distance, again)
        plan = self._sort_policy.plan(views, settings, *asked)
        self._changed = False
        self.sorts, self.order_age = plan.sorts, plan.age
        at_once = MOST_VIEWS if arena.holds_views(MOST_VIEWS) and not canted else 1
        groups = [views[n : n + at_once] for n in range(0, len(views), at_once)]
        # One order for views that are projected one by one must hold what the first does not see.
        keep_outside = plan.keep_outside or (len(groups) > 1 and not canted)
        i = 0
        for n, group in enumerate(groups):
            frame = plan.frames[n] if n < plan.sorts else None
            with timer.time("project"):
                own = frame is None or canted or len(views) == 1  # its own eye: one frame less
                sort_from_world = None if own else frame
                how = (settings, sort_from_world, keep_outside, i)
                with arena.sorted_kept(again):
                    self._projector.project(arena, group, *how, sets=sets[i : i + len(group)])
            if frame is not None:
                with timer.time("sort", on_gpu=self._sorter.backend == "gl"):
                    self._sorter.sort(arena, settings.key_bits)
            with timer.time("splat"):
                in_order = frame is not None and self._sorter.backend == "gl"  # the keys, too
                self._splat(group, first + i, settings, sets[i : i + len(group)], in_order)
            if settings.depth_scale > 0:
                with timer.time("depth"):
                    for row, view in enumerate(group):
                        self._depths.draw(arena, first + i + row, view, settings, row)
            i += len(group)
        self._last = len(groups[-1]) - 1

    def _splat(
        self, group: list[View], i: int, settings: RenderSettings, sets: Sequence[int] = (),
        keys_sorted: bool = False,
    ) -> None:  # fmt: skip
        """Draws views that were projected together, from image i on; two at once where it pays."""
        arena, pair, disparity = self.arena, self.stereo_pair, None
        foveas = foveas_of(group, settings)
        if foveas and not self.foveates:
            warn_once(WHOLE)
            foveas = []
        alike = len(group) == 2 and not foveas and group[0].size == group[1].size and arena.count
        if pair is not None and alike and not self.draws_heat:
            if settings.low_pass >= LEAST_LOW_PASS:
                disparity = pair.disparity(arena, group[0].size[0], keys_sorted)
        if pair is not None and disparity is not None:
            pictures = [self._splatter.target_of(i + row, group[row].size) for row in range(2)]
            pair.draw(arena, pictures, disparity, settings.min_alpha, self._splatter.unit)
            return
        for row, view in enumerate(group):
            heat = None
            if self.draws_heat:
                heat = arena.heat_of(sets[row] if sets else min(i + row, len(arena.colors) - 1))
            if foveas:
                how = (view, foveas[row], settings.min_alpha, row, heat)
                self._foveated.draw(self._splatter, arena, i + row, *how)
                continue
            self._splatter.draw(arena, i + row, view.size, settings.min_alpha, row, heat, view)

    @contextmanager
    def order_set_aside(self) -> Iterator[None]:
        arena, sort_policy = self.arena, copy(self._sort_policy)
        now = (self.sorts, self.order_age, self._changed)
        kept = [(buffer, buffer.read()) for buffer in (arena.order, arena.command)]
        try:
            yield
        finally:
            for buffer, data in kept:
                overwrite(buffer, data)
            self._sort_policy = sort_policy
            self.sorts, self.order_age, self._changed = now

    def _median_distance(self, eye_from_world: np.ndarray) -> float:
        """Metres from an eye to the median splat, from a sample of those that are there."""
        mean_opacity, owner, _ = (a[:: -(-self.arena.count // SAMPLE)] for a in self.splat_points())
        return median_distance(eye_from_world @ self.arena.world_from_object, mean_opacity, owner)

    def counts(self, wait: bool = False) -> dict[str, int]:
        if wait or is_software(self._gpu.ctx):  # which has nothing under way
            self.counts_age = 0
            return self._projector.counts(self.arena, self._last)
        counts, self.counts_age = self._projector.late_counts(self.arena, self._last)
        return dict(counts)

    def _brightest(self) -> float:
        """The largest colour of the scene; of its models found out once."""
        self._most = self._most or [brightest([model]) for model in self._models]
        graded = [
            float(grade.graded(np.full(3, most)).max()) if grade is not None else most
            for i, most in enumerate(self._most)
            for grade in [self._grades.get(i)]
        ]
        return max([1.0, *graded])

    def presentable(self, i: int) -> moderngl.Texture:
        return self._splatter.texture(i)

    def unit_of(self, i: int) -> float:
        return self._splatter.unit_of(i)

    def image(self, i: int) -> np.ndarray:
        return self._splatter.image(i)

    def heat(self, i: int) -> np.ndarray:
        return self._splatter.image(i, of=1)[..., :2]

    def presentable_heat(self, i: int) -> moderngl.Texture:
        return self._splatter.texture(i, of=1)

    def presentable_depth(self, i: int) -> moderngl.Texture:
        return self._depths.texture(i)

    def splat_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        arena = self.arena
        owner = np.repeat(np.arange(len(arena.starts) - 1), np.diff(arena.starts))
        n, read = arena.starts[-1], []
        for buffer, width in ((arena.mean_opacity, 4), (arena.covariance, 8)):
            data = buffer.read(4 * width * n) if n else b""
            read.append(np.frombuffer(data, np.float32).reshape(n, width))
        return read[0], owner, read[1]

    def write_colors(self, color: np.ndarray) -> None:
        sets = len(self.arena.colors)
        for which in reversed(range(sets)):
            self.arena.color_set(which, sets)
            for i, (start, end) in enumerate(pairwise(self.arena.starts)):
                self.arena.write_color(i, color[start:end])

    def read_colors(self, i: int) -> tuple[np.ndarray, np.ndarray | None]:
        return self.arena.read_colors(i)

    def replace_colors(self, i: int, color: np.ndarray, heat: np.ndarray | None) -> None:
        self.arena.write_color(i, color)
        if heat is not None:
            self.arena.write_heat(i, heat)

    def overdraw(self, i: int, view: View, settings: RenderSettings) -> np.ndarray:
        return count_overdraw(self._gpu, self._projector, self.arena, view, settings)

    def edges(self, i: int, view: View, settings: RenderSettings, kind: str) -> np.ndarray:
        return draw_edges(self._gpu, self._projector, self.arena, view, settings, kind)

    def surface(self, view: View, settings: RenderSettings) -> Surface:
        """Depth, normals and coverage from a view; the order and the counts in use stay."""
        arena = self.arena
        if not arena.count:
            return Surface.empty(view.size)
        with self.order_set_aside():
            counts = arena.counts.read()
            self._projector.project(arena, [view], settings)
            self._sorter.sort(arena, settings.key_bits)
            made = draw_surface(self._gpu, arena, view, settings)
            overwrite(arena.counts, counts)
        return made

    def close(self) -> None:
        self._release_arena()
        for part in (self._splatter, self._foveated, self._depths, self._sorter, self._projector):
            if part is not None:
                part.release()

    def _release_arena(self) -> None:
        while self._allocated:
            self._allocated.pop().release()


# overdraw: how many splats each pixel blends, drawn with GL; for debug pictures alone.


def count_overdraw(
    gpu: Gpu, projector: Projector, arena: Arena, view: View, settings: RenderSettings
) -> np.ndarray:
    """(H, W) float32, row 0 on top.  Projects the arena again: records and keys become the view's;
    the counts of the frame before stay.
    """
    width, height = view.size
    if not arena.count:
        return np.zeros((height, width), np.float32)
    counts = arena.counts.read()
    projector.project(arena, [view], settings)
    overwrite(arena.counts, counts)
    program = gpu.program("overdraw.vert", "overdraw.frag")
    program["size"].value, program["min_alpha"].value = view.size, settings.min_alpha
    target = gpu.target(view.size, "f4")
    triangles = gpu.ctx.vertex_array(program, [])
    bind(records=arena.records, keys=arena.keys)
    with gpu.drawing_into(target):
        target.clear(0.0, 0.0, 0.0, 0.0)
        gpu.ctx.enable_only(moderngl.BLEND)
        gpu.ctx.blend_func = (moderngl.ONE, moderngl.ONE)
        triangles.render(moderngl.TRIANGLES, vertices=3 * arena.count)
    texture = target.color_attachments[0]
    number = np.frombuffer(texture.read(), np.float32).reshape(height, width, 4)[::-1, :, 0]
    for made in (triangles, target, texture):
        made.release()
    return np.ascontiguousarray(number)


# splat_edges: splats as ellipses, points or rings, drawn with GL; for debug pictures alone.


def draw_edges(
    gpu: Gpu, projector: Projector, arena: Arena, view: View, settings: RenderSettings, kind: str
) -> np.ndarray:
    """(H, W, 4) float32 display sRGB and coverage, row 0 on top, in the order that is there.

    Projects the arena again: records and keys become the view's; the counts of before stay.
    """
    width, height = view.size
    if not arena.count:
        return np.zeros((height, width, 4), np.float32)
    counts = arena.counts.read()
    projector.project(arena, [view], settings, keep_outside=True)
    overwrite(arena.counts, counts)
    program = gpu.program("splat.vert", "splat_edges.frag", HEAT=0, KIND=KINDS.index(kind))
    values = {
        "size": view.size, "min_alpha": settings.min_alpha, "first": 0, "per_unit": 1.0,
        "edge_power": EDGE_POWER, "radius": POINT_PX, "band": BAND_PX,
    }  # fmt: skip
    for name, value in values.items():
        if name in program:  # a kind does not ask for all of them
            program[name].value = value
    target = gpu.target(view.size, "f4")
    triangles = gpu.ctx.vertex_array(program, [])
    bind(order=arena.order, records=arena.records, counts=arena.counts)
    with gpu.drawing_into(target):
        target.clear(0.0, 0.0, 0.0, 0.0)
        gpu.ctx.enable_only(moderngl.NOTHING)
        triangles.render_indirect(arena.command, moderngl.TRIANGLES, count=1)
    texture = target.color_attachments[0]
    image = np.frombuffer(texture.read(), np.float32).reshape(height, width, 4)[::-1].copy()
    for made in (triangles, target, texture):
        made.release()
    return image
