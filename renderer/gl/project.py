"""project: splats -> screen ellipses and keys to sort by; the only culling gate."""

from collections.abc import Sequence

import moderngl
import numpy as np

from shapeshift.rasterizer.pages import PAGE
from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, groups_for, overwrite
from shapeshift.renderer.settings import CULL_REASONS, RenderSettings
from shapeshift.renderer.timing import UnderWay
from shapeshift.scene.pose import View

NO_COUNTS = np.zeros(layout.COUNTS_SIZE, np.uint32)
NO_COUNTS[layout.COUNTS["NEAREST"]] = layout.CULLED_KEY


class Projector:
    """Writes the records, keys and counts of an arena, for one view or for two at once."""

    def __init__(self, gpu: Gpu, key_range: bool = False) -> None:
        """key_range: finds it for the sort in GL, which then takes fewer passes."""
        self._gpu, self._key_range = gpu, key_range
        self._under_way = UnderWay[tuple[moderngl.Buffer, int]]()  # counts of frames, and the view
        self._spare: list[moderngl.Buffer] = []
        self._counted: Arena | None = None  # whose these are
        self._known: tuple[dict[str, int], int] = ({}, 0)
        self._variant(1, False, RenderSettings())  # a broken shader is reported at the start

    def _variant(
        self, views: int, own_frame: bool, settings: RenderSettings, antialiased: bool = False,
        own_colors: bool = False, paged: bool = False,
    ) -> moderngl.ComputeShader:  # fmt: skip
        return self._gpu.compute(
            "project.comp", VIEWS=views, SORT_FRAME=int(own_frame), FADE=int(settings.fade > 0),
            KEY_RANGE=int(settings.key_bits == 16 or self._key_range),
            BY_DISTANCE=int(settings.order == "distance"),
            ANTIALIASED=int(antialiased), OWN_COLORS=int(own_colors), PAGED=int(paged), PAGE=PAGE,
        )  # fmt: skip

    def project(
        self,
        arena: Arena,
        views: list[View],
        settings: RenderSettings,
        sort_from_world: np.ndarray | None = None,
        keep_outside: bool = False,
        first_view: int = 0,
        sets: Sequence[int] = (),
    ) -> None:
        """Projects all objects with their poses, under the limits of the settings.

        Row v * N + i of arena.records is splat i in view v; arena.keys[i] its depth (or distance,
        settings.order) in the frame sort_from_world (4, 4), by default the first view's eye.
        keep_outside: the order is to outlive this frame, or did outlive another: every splat that
        is not absent has a key, and every record is written; those of culled ones have no area.
        first_view, sets: as colors_of takes them.
        """
        if not 1 <= len(views) <= layout.MOST_VIEWS:
            raise ValueError(f"{len(views)} views came; project takes 1 to {layout.MOST_VIEWS}.")
        counts = NO_COUNTS.copy()
        counts[layout.COUNTS["SORTED"]] = arena.count  # from which project subtracts
        overwrite(arena.counts, counts)
        if not arena.count:
            return
        arena.make_room(len(views))
        frames = [view.eye_from_world() for view in views]
        if sort_from_world is not None:
            frames.append(np.asarray(sort_from_world, np.float64))
        # In float64 on the CPU: a far world origin must not eat the digits of a near splat.
        rows = np.stack([frame @ arena.world_from_object for frame in frames], axis=1)
        rows = np.ascontiguousarray(rows[:, :, :3], np.float32)  # (O, frames, 3, 4)
        bind(
            mean_opacity=arena.mean_opacity, covariance=arena.covariance,
            records=arena.records, keys=arena.keys, counts=arena.counts,
        )  # fmt: skip
        mine = colors_of(arena, first_view, sets)
        bind(color=mine[0])
        if own_colors := len(views) > 1 < len(mine):
            bind(second_color=mine[1])
        how = (views, len(frames) > len(views), settings, keep_outside, own_colors)
        programs = self._programs(arena, *how)
        for i, first, last in arena.runs:
            program = programs[arena.antialiased[i], False]
            set_uniforms(program, first=first, last=last)
            program["frames"].write(rows[i])
            program.run(groups_for(last - first, layout.WORKGROUP))
        if (pages := arena.pages) is not None:
            bind(pages=pages.upload(rows))
            program = programs[bool(pages.antialiased.any()), True]
            ends = {"first": pages.first, "last": arena.count, "first_entry": pages.first_entry}
            set_uniforms(program, **ends)
            program.run(groups_for(pages.rows, layout.WORKGROUP))
        self._gpu.ctx.memory_barrier()

    def _programs(
        self, arena: Arena, views: list[View], own_frame: bool, settings: RenderSettings,
        keep_outside: bool, own_colors: bool,
    ) -> dict[tuple[bool, bool], moderngl.ComputeShader]:  # fmt: skip
        """Of what is antialiased or not, and in pages or not; what all objects share is set."""
        kinds = {(arena.antialiased[i], False) for i, _, _ in arena.runs}
        if arena.pages is not None:
            kinds.add((bool(arena.pages.antialiased.any()), True))
        programs = {
            (faint, paged): self._variant(len(views), own_frame, settings, faint, own_colors, paged)
            for faint, paged in kinds
        }
        for program in programs.values():
            set_uniforms(
                program, keep_outside=keep_outside, tangents=_each(v.tangents for v in views),
                clamps=_each(jacobian_clamp(v) for v in views),
                size=_each(v.size for v in views), near=_each(v.near for v in views),
                **limits(settings),
            )  # fmt: skip
            if len(views) > 1:
                set_uniforms(program, count=arena.count)
        return programs

    def counts(self, arena: Arena, i: int = 0) -> dict[str, int]:
        """Splats of view i at the last projection: drawn, then CULL_REASONS.

        Waits for the GPU.
        """
        return self._read(arena, arena.counts, i)

    def late_counts(self, arena: Arena, i: int = 0) -> tuple[dict[str, int], int]:
        """The same of the newest frame that the GPU has done, and how many frames ago it was; of
        this one, which is waited for, where none was done yet.  To be called once a frame.
        """
        if arena is not self._counted:
            self._forget()
            self._counted, self._known = arena, (self.counts(arena, i), 0)
            return self._known
        self._known = self._known[0], self._known[1] + 1
        copy = None
        if not self._under_way.full:
            copy = self._spare.pop() if self._spare else self._gpu.reserve(arena.counts.size)
            self._gpu.ctx.copy_buffer(copy, arena.counts, arena.counts.size)
        self._under_way.leave(None if copy is None else (copy, i))
        for age, (done, view) in self._under_way.done():
            self._known = self._read(arena, done, view), age
            self._spare.append(done)
        return self._known

    def _read(self, arena: Arena, counts: moderngl.Buffer, i: int) -> dict[str, int]:
        rows = np.frombuffer(counts.read(), np.uint32)[i * layout.COUNTS_STRIDE :]
        culled = {name: int(rows[layout.COUNTS[name.upper()]]) for name in CULL_REASONS}
        return {"drawn": arena.count - sum(culled.values()), **culled}

    def _forget(self) -> None:
        self._spare += [copy for _, (copy, _) in self._under_way.all()]

    def release(self) -> None:
        """The copies of counts; programs belong to the Gpu."""
        self._forget()
        while self._spare:
            self._spare.pop().release()
        self._counted = None

    def __enter__(self) -> "Projector":
        return self

    def __exit__(self, *failure) -> None:
        self.release()


def colors_of(arena: Arena, first_view: int, sets: Sequence[int]) -> list[moderngl.Buffer]:
    """Those of sets, one a view; else where each view has its own, from `first_view`, the number of
    the first of them in its frame; else one for all.
    """
    if sets:
        return [arena.colors[which] for which in dict.fromkeys(sets)]
    return arena.colors[first_view:] if len(arena.colors) > 1 else arena.colors


def jacobian_clamp(view: View) -> tuple[float, float]:
    """Largest |x/z| and |y/z| at which the projection's slope is that of the place itself."""
    x, y = view.widest_tangents()
    return layout.JACOBIAN_MARGIN * x, layout.JACOBIAN_MARGIN * y


def limits(settings: RenderSettings) -> dict[str, object]:
    """The uniforms that stand for the settings' limits; infinite ones as large floats.

    A ramp of the fade is clamp((limit - value) * slope, 0, 1); without one it is 1 everywhere.
    """
    largest = min(settings.max_pixels, layout.HUGE)
    farthest = min(settings.max_distance, layout.HUGE)
    ends, slopes = [layout.HUGE, layout.HUGE, -layout.HUGE], [1.0, 1.0, 1.0]
    for i, limit in enumerate((largest, farthest, settings.min_pixels)):
        if settings.fade > 0 and 0 < limit < layout.HUGE:
            ends[i], slopes[i] = limit, min(1 / (settings.fade * limit), layout.HUGE)
    numbers: dict[str, object] = {
        "min_alpha": settings.min_alpha, "low_pass": settings.low_pass, "max_pixels": largest,
        "max_distance": farthest, "min_pixels": min(settings.min_pixels, layout.HUGE),
    }  # fmt: skip
    if settings.fade > 0:
        numbers |= {"fade_ends": tuple(ends), "fade_slopes": tuple(slopes)}
    return numbers


def set_uniforms(program: moderngl.ComputeShader, **values: object) -> None:
    for name, value in values.items():
        program[name].value = value


def _each(values) -> object:
    """One value a view, as a uniform array wants them: an array of one is a plain uniform."""
    values = list(values)
    return values[0] if len(values) == 1 else values
