"""Draws scenes: the passes of a frame in order.  The file to read first in renderer/."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import moderngl
import numpy as np

from shapeshift.renderer.backends import choose_backends, open_drawing
from shapeshift.renderer.colors.color_cache import (
    ColorCache,
    by_eye,
    drawn_together,
    eyes_among,
    forget_colors,
)
from shapeshift.renderer.colors.decode_colors import (
    Look,
    decode_colors,
    looks_of,
    own_colors,
    prepare_two,
    same_shape,
    take_looks,
    two_false_colors,
)
from shapeshift.renderer.colors.false_colors import (
    BESIDE,
    PICTURE,
    SPLATS,
    FalseColors,
    false_colors,
)
from shapeshift.renderer.colors.palette import (
    apply_palette,
    behind,
    over_background,
    overlay_heat,
    palette_between,
)
from shapeshift.renderer.debug.debug import debug_image, opaque, prepare_debug
from shapeshift.renderer.decoded_object import (
    BESIDE_SET,
    DecodedObject,
    place_splats,
    restore_shapes,
)
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.resolve import Resolve, WindowTaker
from shapeshift.renderer.levels import LevelChoice, Streaming, decoded_objects, exchange_levels
from shapeshift.renderer.resolution import bilinear, scaled
from shapeshift.renderer.settings import TARGETS, FrameStats, RenderSettings
from shapeshift.renderer.streaming.stream import has_leaves
from shapeshift.renderer.surface import Surface
from shapeshift.renderer.timing import PassTimer
from shapeshift.runtime_models.evaluate import follows_eye, shape_follows_control
from shapeshift.runtime_models.stop_weights import same_controls
from shapeshift.scene.control import control_key, control_of
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import View, pose_matrices
from shapeshift.scene.scene import Scene


class Renderer:
    """Keeps a scene decoded and draws views of it.

    drawing, mlps, sort: "auto" takes tiles, opencl and numpy where GL is software or absent, and
    quads, gl, gl on a GPU; `backends` says what is in use and it never changes by itself.
    target: what quads blend into whatever settings.target says (tiles: float32 in registers).
    ctx None: no GL at all, tiles only, present() is not there.
    """

    def __init__(
        self, ctx: moderngl.Context | None, drawing: str = "auto", mlps: str = "auto",
        sort: str = "auto", target: str | None = None,
    ) -> None:  # fmt: skip
        drawing, mlps, sort = choose_backends(ctx, drawing, mlps, sort)
        if target not in (None, *TARGETS):
            raise ValueError(f"there is no target {target!r}; choose {', '.join(TARGETS)}.")
        self.settings = RenderSettings()
        self._target = target
        self._ctx, self.gpu = ctx, Gpu(ctx) if ctx is not None else None
        self._resolve = Resolve(self.gpu) if self.gpu is not None else None
        self.drawing = open_drawing(drawing, self.gpu, mlps, sort)
        self._timer = PassTimer(ctx)
        self._scene = self._given = Scene(())  # with the levels of detail in use, and as it came
        self._poses = np.zeros((0, 4, 4))  # world_from_objects
        self.levels = LevelChoice()
        self._decoded: list[DecodedObject] = []
        self._false_key: list | None = None  # what the next was chosen for
        self._false_colors = FalseColors()
        self.streaming = Streaming(self.drawing)
        self.drawing.allocate([])
        self._geometry_runs = self._color_runs = 0
        self._stats = FrameStats()  # of the last frame
        self._views: list[View] = []  # of the last frame, in the size that is shown
        self._ways: list[FalseColors] = []  # how their colours came about
        self.taker: WindowTaker | None = None  # asked first where bytes would fill a window
        self.keeps_beside = False  # a set of colours for `draw_beside`, from the next frame on
        self._beside_timer = PassTimer(ctx)
        self._debug: list[tuple[np.ndarray, dict[str, float]]] = []  # picture and numbers, a view

    @property
    def backends(self) -> dict[str, str]:
        """What is in use: drawing, mlps, sort."""
        return self.drawing.backends

    def update(self, scene: Scene) -> None:
        """Takes over poses and control values; decodes only what is new or has another x."""
        self._given = scene
        self.levels.begin(scene)
        scene = self.levels.shown(scene)
        with self._timer.time("decode", on_gpu=self.drawing.decodes_on_gpu):
            models = [id(decoded.model) for decoded in self._decoded]
            other = self.streaming.differs(self.settings.budget)
            if other or models != [id(obj.model) for obj in scene.objects]:
                self._rebuild(scene)
            for i, (obj, decoded) in enumerate(zip(scene.objects, self._decoded, strict=True)):
                if not obj.seen:
                    continue
                key, first = control_key(obj), decoded.key is None
                x = control_of(obj) if decoded.key != key else decoded.x
                # Another key with the same x: a selector changed where nothing is.
                if decoded.key != key and (first or not same_controls(x, decoded.x)):
                    # What follows the eye is decoded with the colours, once the eye is known.
                    follows = first or shape_follows_control(obj.model)
                    # What has leaves comes with the stream.
                    if follows and not follows_eye(obj.model) and not has_leaves(obj.model):
                        restore_shapes(self.drawing, i, decoded)
                        self.drawing.decode_geometry(i, x)
                        self._geometry_runs += 1
                    decoded.x = x
                    decoded.version += 1
                decoded.key = key
                place_splats(self.drawing, i, obj, decoded)
            self._choose_false_colors(scene)
        self._poses = pose_matrices([obj.world_from_object for obj in scene.objects])
        seen = np.array([obj.seen for obj in scene.objects], bool)[:, None, None]
        self.drawing.set_poses(np.where(seen, self._poses, np.nan))  # no gate lets NaN pass
        self._scene = scene

    def _look_from(self, views: list[View]) -> None:
        """Objects with levels of detail at those that these views ask for.  Raises BadFile."""
        if self.levels.choose(self._given, self._scaled(views)):
            if self.streaming.stream is None:  # else all is made anew
                before, self._decoded, self._false_key = self._decoded, [], None
                scene = self.levels.shown(self._given)
                self._decoded = exchange_levels(self.drawing, before, scene)
            self.update(self._given)
        self.streaming.follow(self._scene, self._poses, self._decoded, views, self._timer)

    def _scaled(self, views: Sequence[View]) -> list[View]:
        return [scaled(view, self.settings.render_scale) for view in views]

    def _choose_false_colors(self, scene: Scene) -> None:
        """Which colours are decoded, and where palettes belong, as the controls ask for."""
        pairs = zip(self._decoded, scene.objects, strict=True)
        state = [(d.version, o.seen, o.tint is None, o.appearance) for d, o in pairs]
        if state == self._false_key:
            return
        self._false_key, before = state, self._false_colors.way
        self._false_colors = false_colors(scene, [decoded.x for decoded in self._decoded])
        take_looks(self._decoded, scene, self._false_colors, before == self._false_colors.way)

    def _rebuild(self, scene: Scene) -> None:
        """A new arena for another set of objects; an empty one if the set does not fit."""
        models = [o.model for o in scene.objects]
        self._scene, self._decoded, self._false_key = Scene(()), [], None
        self.streaming.allocate(models, self.settings.budget)
        self._decoded = decoded_objects(models)

    def draw(
        self, views: list[View],
        target: moderngl.Framebuffer | list[moderngl.Framebuffer] | None = None,
    ) -> FrameStats:  # fmt: skip
        """Draws every view; with `target` (one framebuffer a view) presents them there as well.

        Colours are computed for each eye, or once for the middle of the eyes where that cannot be
        told apart (settings.stereo_colors), and only when it moved.  Counts of splats in the result
        are those of the last view; on a GPU they and the times are of a frame before, since nobody
        waits for this one (FrameStats.age; `exact_stats` does).
        """
        targets = [target] if isinstance(target, moderngl.Framebuffer) else target
        if not views or (targets is not None and len(targets) != len(views)):
            raise ValueError("draw wants at least one view, and no or one framebuffer a view.")
        settings = self._settings_of_frame()
        self._look_from(views)
        self.drawing.draws_heat = self._false_colors.way == BESIDE and not settings.debug
        self._views = views
        # An eye that is not drawn keeps its picture, and how its colours came about.
        self._ways = [self._false_colors] * len(views) + self._ways[len(views) :]
        full, views, sorts = views, self._scaled(views), 0
        own = own_colors(self.settings, self._scene, self._decoded, full)
        with self._framebuffer_kept():
            for group in drawn_together(self._scene, len(full), own):
                sets = self._decode_colors(full[group], own)
                if prepare_debug(self.drawing, views, self._scene, settings.debug):
                    for decoded in self._decoded:
                        forget_colors(decoded.colored)  # their own are to come back
                self.drawing.draw(views[group], settings, self._timer, group.start, sets)
                sorts += self.drawing.sorts
            self._debug = [
                debug_image(self.drawing, i, view, self._scene, settings)
                for i, view in enumerate(views if settings.debug else [])
            ]
        if targets is not None:
            with self._timer.time("resolve"):
                for i, framebuffer in enumerate(targets):
                    self.present(framebuffer, i)
        return self._stats_of(sorts, len(set(eyes_among(full))) if own else 1)

    def draw_two(self, views: tuple[View, View], other: Scene) -> FrameStats:
        """Draws one view of the scene that `update` took over, and another one of a scene that
        differs from it in its colours alone: projected and sorted once.

        ValueError where more differs (colors/two_looks.py, `same_shape`).  No debug pictures.
        """
        self._look_from(list(views))
        other = self.levels.shown(other)
        if not same_shape(self._scene, other):
            raise ValueError("draw_two wants two scenes that differ in their colours alone.")
        scenes, self._ways = (self._scene, other), two_false_colors(self._scene, other)
        looks = [looks_of(*pair) for pair in zip(scenes, self._ways, strict=True)]
        self._false_key = None  # the next `update` looks again at what is decoded
        self.drawing.draws_heat = any(colors.way == BESIDE for colors in self._ways)
        self._views, self._debug = list(views), []
        settings = replace(self._settings_of_frame(), debug="", stereo_sort="shared")
        prepare_two(self._decoded, (looks[0], looks[1]))
        with self._framebuffer_kept():
            with self._timer.time("decode", on_gpu=self.drawing.decodes_on_gpu):
                for which, scene in enumerate(scenes):
                    at_once = self._ways[which].way == SPLATS
                    self._decode_set((which, 2), [views[which]], scene, looks[which], at_once)
                self.drawing.wait_decoded()
            self.drawing.draw(self._scaled(views), settings, self._timer)
        return self._stats_of(self.drawing.sorts, 2)

    def draw_beside(self, views: Sequence[View], other: Scene, first: int) -> dict[str, float]:
        """Draws views of a scene that differs in its colours alone from the one just drawn, as
        pictures `first`..., in that frame's order: its two views have seen all that these see.

        With `keeps_beside`, or its colours are decoded each time.  Milliseconds of the passes.
        ValueError where more differs.  The counts become those of these views.
        """
        other = self.levels.shown(other)
        if not same_shape(self._scene, other):
            raise ValueError("draw_beside wants a scene that differs in its colours alone.")
        colors = false_colors(other, [control_of(obj) for obj in other.objects])
        looks, sets = looks_of(other, colors), (BESIDE_SET,) * len(views)
        for decoded, look in zip(self._decoded, looks, strict=True):
            decoded.look_beside(look)
        settings, timer = self._settings_of_frame(), self._beside_timer
        settings = replace(settings, debug="", depth_scale=0.0)
        self._views = [*self._views[:first], *views]
        self._ways = [*self._ways[:first], *([colors] * len(views))]
        with self._framebuffer_kept():
            with timer.time("decode", on_gpu=self.drawing.decodes_on_gpu):
                at_once = colors.way == SPLATS
                self._decode_set((BESIDE_SET, BESIDE_SET + 1), list(views), other, looks, at_once)
                self.drawing.wait_decoded()
            self.drawing.draws_heat = colors.way == BESIDE
            self.drawing.draw(self._scaled(views), settings, timer, first, sets, again=True)
        return timer.collect()

    def _stats_of(self, sorts: int, color_sets: int) -> FrameStats:
        """The counters of the frame that was just drawn; they begin anew."""
        drawn = (culled := self.drawing.counts()).pop("drawn")
        told = (drawn, culled, self.drawing.hidden, self._geometry_runs, self._color_runs)
        self._geometry_runs = self._color_runs = 0
        stats = FrameStats(self._timer.collect(), self._scene.splat_count, *told)
        stats.sorts, stats.order_age, stats.color_sets = sorts, self.drawing.order_age, color_sets
        stats.debug, stats.streaming = next((d[1] for d in self._debug), {}), self.streaming.stats
        stats.age = max(self._timer.age, self.drawing.counts_age)
        self._stats = stats
        return self.exact_stats() if self._debug else stats  # whose legend is of this picture

    def exact_stats(self) -> FrameStats:
        """The same with the last frame's own times and counts: waits for a GPU."""
        if self._stats.age:
            drawn = (culled := self.drawing.counts(wait=True)).pop("drawn")
            known = {"ms": self._timer.collect(wait=True), "drawn": drawn, "culled": culled}
            self._stats = replace(self._stats, **known, age=0)
        return self._stats

    def _settings_of_frame(self) -> RenderSettings:
        """The settings with the target in use: debug pictures hold numbers, not colours."""
        target = "rgba32f" if self.settings.debug else self._target or self.settings.target
        return replace(self.settings, target=target)

    def _decode_colors(self, views: list[View], own: bool = False) -> tuple[int, ...]:
        """Runs the colours of the visible objects for the middle of the eyes; own: for each eye,
        whose views have them together.

        Returns the sets of the views, where there is another one that is none of theirs.
        """
        eyes, groups = by_eye(views, own, BESIDE_SET if self.keeps_beside else len(views))
        count = BESIDE_SET + 1 if self.keeps_beside else len(groups)
        for decoded in self._decoded:
            fresh = (ColorCache(decoded.colored[0].centre) for _ in range(count))
            decoded.colored = [*decoded.colored, *fresh][:count]
        looks = [(decoded.shade, decoded.grade) for decoded in self._decoded]
        at_once = self._false_colors.way == SPLATS
        with self._timer.time("decode", on_gpu=self.drawing.decodes_on_gpu):
            for which, group in enumerate(groups):
                self._decode_set((which, count), group, self._scene, looks, at_once)
            self.drawing.wait_decoded()
        return tuple(eyes) if self.keeps_beside or len(groups) != len(views) else ()

    def _decode_set(
        self, color_set: tuple[int, int], views: list[View], scene: Scene, looks: list[Look],
        at_once: bool,
    ) -> None:  # fmt: skip
        """One set of colours of so many, for the middle of some eyes, where it moved."""
        self.drawing.color_set(*color_set)
        what = (color_set[0], views, scene, looks, at_once)
        ran = decode_colors(self.drawing, self.settings, self._decoded, *what)
        self._geometry_runs += ran[0]
        self._color_runs += ran[1]

    def _has_heat(self, i: int) -> bool:
        """Whether heat was drawn beside the colours of view i."""
        return not self._debug and self._ways[i].way == BESIDE

    def image(self, i: int = 0) -> np.ndarray:
        """(H, W, 4) float32 of view i as drawn (settings.render_scale), premultiplied over nothing,
        row 0 on top.  At a pure value stop it holds values, else colours.
        """
        image, palette = self.drawing.image(i), self._ways[i].palette
        if not self._has_heat(i):
            return image
        return overlay_heat(image, self.drawing.heat(i), palette, self.settings.heat_ends)

    def resolved(self, i: int = 0, out: np.ndarray | None = None) -> np.ndarray:
        """(H, W, 3) float32 display sRGB of view i: palette applied, over settings.background,
        written to `out` where there is one; or its debug picture, a new one, with settings.debug.
        """
        if self._debug:
            return bilinear(self._debug[i][0], self._views[i].size)
        colors, view, ends = self._ways[i], self._views[i], self.settings.heat_ends
        rgba = bilinear(self.drawing.image(i), view.size)
        if self._has_heat(i):
            heat = bilinear(self.drawing.heat(i), view.size)
            rgba = overlay_heat(rgba, heat, colors.palette, ends)
        elif colors.way == PICTURE:
            rgba = apply_palette(rgba, colors.palette, ends)
        return over_background(rgba, behind(self.settings.background, view), out)

    def present(self, framebuffer: moderngl.Framebuffer, i: int = 0) -> None:
        """Fills a GL framebuffer with view i as resolved() shows it."""
        if self._resolve is None:
            raise ValueError("this renderer has no GL context to present with; use resolved().")
        name, ends = "" if self._debug else self._ways[i].palette, self.settings.heat_ends
        palette = palette_between(name, ends) if name else None
        image = opaque(self._debug[i][0]) if self._debug else self.drawing.presentable(i)
        heat = self.drawing.presentable_heat(i) if self._has_heat(i) else None
        background, view = self.settings.background, self._views[i]
        as_array = isinstance(image, np.ndarray) and not self._debug
        with self._framebuffer_kept():
            if as_array and self._resolve.takes_bytes(framebuffer, image.shape[1::-1]):
                looks = (background, view, palette, heat is not None)
                make = partial(self.drawing.presentable_bytes, i, *looks)
                self._resolve.copy(make, framebuffer, self.taker)
            else:
                how = (1.0 if self._debug else self.drawing.unit_of(i), view)
                self._resolve.draw(image, framebuffer, background, palette, heat, *how)

    def coverage(self, i: int = 0) -> moderngl.Texture | np.ndarray:
        """How much splats hide in view i: the alpha of a GL texture, or (H, W), row 0 on top."""
        image = self.drawing.presentable(i)
        return image[..., 3] if isinstance(image, np.ndarray) else image

    def surface(self, view: View) -> Surface:
        """Depth, normals and coverage of what `update` was given, from a view; no frame is lost."""
        self._look_from([view])
        self._decode_colors([view])
        with self._framebuffer_kept():
            return self.drawing.surface(view, self._settings_of_frame())

    def stale_order_db(self, views: list[View]) -> float:
        """PSNR of the order in use against one sorted for these views: what keeping it costs, dB.

        Of the worst view; inf where no pixel differs.  The order in use and its age stay as they
        are; image(i) is the picture in that order afterwards.
        """
        sets = self._decode_colors(views)
        self._ways = [self._false_colors] * len(views) + self._ways[len(views) :]
        settings = replace(self._settings_of_frame(), debug="")
        views, pictures = self._scaled(views), []
        for frames in (1, 0):  # sorted now, then the order that is kept
            once = replace(settings, resort_frames=frames, resort_degrees=0.0)
            with self._framebuffer_kept(), self.drawing.order_set_aside():
                self.drawing.draw(views, once, PassTimer(self._ctx), sets=sets)
                pictures.append([self.image(i)[..., :3].copy() for i in range(len(views))])
        return min(psnr(kept, exact) for exact, kept in zip(*pictures, strict=True))

    @contextmanager
    def _framebuffer_kept(self) -> Iterator[None]:
        """Leaves bound what was bound: a window's, or none of ours that close() deletes."""
        bound = self._ctx.fbo if self._ctx is not None else None
        try:
            yield
        finally:
            if bound is not None:
                bound.use()

    def close(self) -> None:
        """Gives the memory of the scene and the programs back; the context stays."""
        self.streaming.close()
        self.drawing.close()
        for part in (self._resolve, self.gpu):
            if part is not None:
                part.release()

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *failure) -> None:
        self.close()
