"""The GPU copy of a scene: one arena for all objects, so that one sort is right.

The life of the passes, in the order of the calls:

    gpu = Gpu(ctx)                                   # renderer/gl/gpu.py
    projector, splatter = Projector(gpu), Splatter(gpu, "rgba16f")
    sorter, resolve = Sorter(gpu, "gl" or "numpy"), Resolve(gpu)
    arena = Arena(gpu, [m.splat_count for m in models])     # again when the composition changes
    decoder = Decoder(gpu, arena, models, "gl" or "onnxruntime")
    decoder.geometry(i, x)                           # when the control value of object i changed
    decoder.color(i, x, eye_object)                  # then, and when the eye moved
    arena.set_poses(world_from_objects)                  # (4, 4) each, NaN hides; any time
    projector.project(arena, views, settings, sort_from_world)    # one or two views at once
    # with colours an eye: arena.color_set(v, len(views)) and decoder.color for each eye before
    sorter.sort(arena, settings.key_bits)
    for i, view in enumerate(views):
        splatter.draw(arena, i, view.size, settings.min_alpha)
        projector.counts(arena, i)                   # waits for the GPU: {drawn, opacity, ...}
    resolve.draw(splatter.texture(i), framebuffer, background, palette, weight)
    splatter.image(i)                                # (H, W, 4) float32

Every class has release() and works with `with`; nothing is allocated after the constructors
(Splatter: after the first frame of a size).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import moderngl
import numpy as np

from shapeshift.rasterizer.pages import PAGE, DrawnPages
from shapeshift.renderer import layout
from shapeshift.renderer.gl.gpu import Gpu, groups_for, overwrite
from shapeshift.renderer.limits import too_many

STAGED_SPLATS = 1 << 20  # decoded at a time; bounds the staging buffer to 46 MB
STAGED_FLOATS = 11  # mean or offset 3, scale 3, rotation 4, opacity 1
PARTS = {"offset": 3, "scale": 3, "rotation": 4, "opacity": 1}


# The pages of an arena as shaders read them: common/pages.glsl.

NO_PAGE = 0xFFFFFFFF  # nothing is drawn
POSE_VECS = 3 * (layout.MOST_VIEWS + 1)  # vec4 an object: of each view and of the order's frame


class MappedPages(DrawnPages):
    """The last rows of what is drawn, a page after the other, and the poses of all objects.

    Splats lie in stored pages, from the same row of the arena on; colours are of the pages that
    are drawn.
    """

    def __init__(
        self, gpu: Gpu, first: int, pages: int, stored: int, antialiased: tuple[bool, ...]
    ) -> None:
        """first: the row where both begin; antialiased: one an object."""
        super().__init__(pages, stored)
        self.first, self.antialiased = first, np.array(antialiased)
        self.first_entry = POSE_VECS * len(antialiased)  # vec4 of poses come before the pages
        self._words = np.zeros((self.first_entry + pages, 4), np.uint32)
        self.buffer = gpu.reserve(self._words.nbytes, "the map of pages")
        self._listed = gpu.reserve(4 * pages, "a list of pages")
        self._uploaded = -1  # the changes that the shaders know

    @property
    def rows(self) -> int:
        """Drawn, of pages that show nothing, too."""
        return PAGE * self.pages

    def upload(self, poses: np.ndarray | None = None) -> moderngl.Buffer:
        """What the shaders read now; poses: (O, frames, 3, 4) eye_from_object, as rows.

        Colours of a thousand copies ask for it a thousand times a frame: it is written where it
        has changed.
        """
        if poses is None and self._uploaded == self.changes:
            return self.buffer
        self._uploaded = self.changes
        entries = self._words[self.first_entry :]
        there = self.stored >= 0
        entries[:, 0] = np.where(there, self.first + PAGE * self.stored, NO_PAGE)
        entries[:, 1] = POSE_VECS * np.maximum(self.owner, 0)
        entries[:, 2] = self.weight.view(np.uint32)
        entries[:, 3] = self.antialiased[self.owner]
        if poses is not None:
            rows = np.ascontiguousarray(poses, np.float32).reshape(len(poses), -1, 4)
            of_objects = self._words[: self.first_entry].reshape(len(poses), POSE_VECS, 4)
            of_objects[:, : rows.shape[1]] = rows.view(np.uint32)
        overwrite(self.buffer, self._words)
        return self.buffer

    def listed(self, pages: np.ndarray) -> moderngl.Buffer:
        """The numbers of pages (n,), for a pass over these alone."""
        numbers = np.zeros(self.pages, np.uint32)
        numbers[: len(pages)] = pages
        overwrite(self._listed, numbers)
        return self._listed

    def release(self) -> None:
        self.buffer.release()
        self._listed.release()


def bind(**buffers: moderngl.Buffer) -> None:
    """Binds storage buffers by the names of layout.SLOTS, in lower case."""
    for name, buffer in buffers.items():
        buffer.bind_to_storage_buffer(layout.SLOTS[name.upper()])


def fitting_splats(gpu: Gpu) -> int:
    """How many splats an arena may have on this driver."""
    return min(gpu.max_block // (16 * layout.RECORD_VECS), gpu.max_groups * layout.WORKGROUP)


def limit_of(gpu: Gpu) -> str:
    """Which of the driver's limits makes fitting_splats what it is."""
    row = 16 * layout.RECORD_VECS
    if gpu.max_block // row <= gpu.max_groups * layout.WORKGROUP:
        limit = f"GL_MAX_SHADER_STORAGE_BLOCK_SIZE is {gpu.max_block:,} bytes"
        return f"{limit}, a splat takes {row} of one buffer"
    return f"GL_MAX_COMPUTE_WORK_GROUP_COUNT is {gpu.max_groups:,} groups of {layout.WORKGROUP}"


class Arena:
    """The splats of all objects, and what a frame makes of them."""

    def __init__(
        self, gpu: Gpu, counts: list[int], antialiased: tuple[bool, ...] | None = None,
        more: int = 0, stored: int | None = None,
    ) -> None:  # fmt: skip
        """Room for objects of so many splats; antialiased: one an object, None: no object is.

        more: rows drawn behind those of the objects, which `pages` tells; stored: rows that their
        splats lie in, None: as many.
        """
        self.count = sum(counts) + more
        self.pages: MappedPages | None = None
        if not self.count <= fitting_splats(gpu):
            raise too_many(self.count, fitting_splats(gpu), limit_of(gpu), "tiles")
        self.gpu = gpu
        self.antialiased = antialiased or (False,) * len(counts)
        self.starts = [0, *np.cumsum(counts, dtype=int).tolist()]  # rows of object i: [i], [i + 1]
        n = self.count
        rows = n if stored is None else sum(counts) + stored
        self.mean_opacity = gpu.reserve(16 * rows)
        self.covariance = gpu.reserve(16 * layout.COVARIANCE_VECS * rows)
        self.colors = [gpu.reserve(16 * n)]  # for all views, or one a view
        self.color, self.set = self.colors[0], 0  # that decoding writes into
        self.records = gpu.reserve(16 * layout.RECORD_VECS * n)
        self.keys, self.keys_spare = gpu.reserve(4 * n), gpu.reserve(4 * n)
        self.order, self.order_spare = gpu.reserve(4 * n), gpu.reserve(4 * n)
        sort_groups = groups_for(n, layout.WORKGROUP * layout.SORT_BLOCKS)
        self.histogram = gpu.reserve(4 * layout.RADIX * (sort_groups + 1))
        self.counts = gpu.reserve(4 * layout.COUNTS_SIZE)
        self._sorted = gpu.reserve(4)  # of counts, while others are counted
        self.command = gpu.upload(np.array([0, 1, 0, 0, 0], np.uint32))
        fit = min(STAGED_SPLATS, gpu.max_block // (4 * STAGED_FLOATS))
        self.dispatch = gpu.upload(np.ones(layout.DISPATCH_SIZE, np.uint32))
        self.staged = min(max(counts, default=0), fit)
        self.staging = gpu.reserve(4 * STAGED_FLOATS * self.staged)
        self.world_from_object = np.tile(np.eye(4), (len(counts), 1, 1))  # (O, 4, 4)
        self._pack = gpu.compute("pack.comp")
        self._heats: dict[int, moderngl.Buffer] = {}  # set -> heat that goes with its colours
        self._heated: set[tuple[int, int]] = set()  # (set, object) whose rows there are not all 0

    @property
    def runs(self) -> list[tuple[int, int, int]]:
        """(object, first row, last row + 1) of the objects that have rows of their own."""
        own = ((i, *ends) for i, ends in enumerate(pairwise(self.starts)))
        return [run for run in own if run[2] > run[1]]

    def grow(self, stored: int) -> None:
        """Room for the splats of so many rows behind those of the objects."""
        rows = self.starts[-1] + stored
        for name, width in (("mean_opacity", 16), ("covariance", 16 * layout.COVARIANCE_VECS)):
            before, made = getattr(self, name), self.gpu.reserve(width * rows)
            self.gpu.ctx.copy_buffer(made, before, before.size)
            setattr(self, name, made)
            before.release()

    def heat_of(self, which: int) -> moderngl.Buffer:
        """What value stops have in a set of colours; made, all zero, when first asked for."""
        if which not in self._heats:
            self._heats[which] = self.gpu.reserve(16 * self.count, "heat")
        return self._heats[which]

    @property
    def heat(self) -> moderngl.Buffer:
        """That of the set which decoding writes into."""
        return self.heat_of(self.set)

    def heated(self, i: int) -> bool:
        """Whether anything was written into the heat of object i in the set in use."""
        return (self.set, i) in self._heated

    def note_heat(self, i: int, there: bool) -> None:
        """Object i has heat in the set in use from now on; else its rows were cleared."""
        (self._heated.add if there else self._heated.discard)((self.set, i))

    def color_set(self, which: int, count: int) -> None:
        """From now on colours are decoded into set `which` of `count`: 1 for all views of a frame,
        or one a view.
        """
        for buffer in self.colors[count:]:
            buffer.release()
        self.colors = self.colors[:count]
        for gone in [kept for kept in self._heats if kept >= count]:
            self._heats.pop(gone).release()
            self._heated = {each for each in self._heated if each[0] != gone}
        while len(self.colors) < count:
            self.colors.append(self.gpu.reserve(16 * self.count, "colours of another eye"))
        self.color, self.set = self.colors[which], which

    def holds_views(self, views: int) -> bool:
        """Whether the records of so many views at once fit this driver's storage blocks."""
        return 16 * layout.RECORD_VECS * self.count * views <= self.gpu.max_block

    @contextmanager
    def sorted_kept(self, kept: bool) -> Iterator[None]:
        """kept: however many splats the body would sort, the order is of those that it was made of;
        it is read from its end.
        """
        place = 4 * layout.COUNTS["SORTED"]
        if kept:
            self.gpu.ctx.copy_buffer(self._sorted, self.counts, 4, read_offset=place)
        yield
        if kept:
            self.gpu.ctx.copy_buffer(self.counts, self._sorted, 4, write_offset=place)

    def make_room(self, views: int) -> None:
        """Records of so many views from now on; what they held is gone when they had to grow."""
        size = 16 * layout.RECORD_VECS * self.count * views
        if size > self.records.size:
            self.records.release()
            self.records = self.gpu.reserve(size, "records of two views")

    def set_poses(self, world_from_objects: list[np.ndarray] | np.ndarray) -> None:
        """Poses (4, 4) of all objects; one full of NaN hides its object."""
        self.world_from_object[:] = np.reshape(world_from_objects, (-1, 4, 4))

    def staging_at(self, part: str) -> int:
        """The float of the staging buffer where a part ("offset", "scale", ...) begins."""
        before = list(PARTS)[: list(PARTS).index(part)]
        return sum(PARTS[name] for name in before) * self.staged

    def pack_staged(
        self,
        start: int,
        count: int,
        anchors: moderngl.Buffer | None = None,
        first: int = 0,
        frames: moderngl.Buffer | None = None,
    ) -> None:
        """Turns `count` staged splats into rows start... of the arena: R S S^T R^T (paper eq. 1).

        With `anchors` (vec4 each; w = splats an anchor) staged means are offsets to be added to
        them; `first` is the anchor of the first staged splat.  With `frames` (2 vec4 each, as
        layout.SLOTS says) what is staged is in the anchors' own axes and sizes.
        """
        if not count:
            return
        bind(mean_opacity=self.mean_opacity, covariance=self.covariance, staging=self.staging)
        bind(anchors=anchors or self.staging, frames=frames or self.staging)
        groups = groups_for(count, layout.WORKGROUP)
        sizes = {"count": count, "start": start, "capacity": self.staged, "first_anchor": first}
        self.gpu.run(
            self._pack, groups, **sizes, is_offset=anchors is not None,
            has_frames=frames is not None,
        )  # fmt: skip

    def write_geometry(
        self, i: int, means: np.ndarray, scales: np.ndarray, wxyz: np.ndarray, opacity: np.ndarray
    ) -> None:
        """Uploads object i as an Evaluator gives it: (n, 3) m, (n, 3) m, (n, 4), (n,)."""
        start, end = self._rows(i, means, "means")
        for first in range(start, end, max(self.staged, 1)):
            part = slice(first - start, min(first - start + self.staged, end - start))
            arrays = (means[part], scales[part], wxyz[part], opacity[part])
            for name, array in zip(PARTS, arrays, strict=True):
                rows = np.ascontiguousarray(array, np.float32)
                overwrite(self.staging, rows, offset=4 * self.staging_at(name))
            self.pack_staged(first, part.stop - part.start)

    def write_color(self, i: int, color: np.ndarray) -> None:
        """Uploads the colours (n, 3) of object i."""
        start, end = self._rows(i, color, "colours")
        rows = np.zeros((end - start, 4), np.float32)
        rows[:, :3] = color
        if end > start:
            overwrite(self.color, rows, offset=16 * start)

    def read_splats(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """mean_opacity (n, 4) and covariance (n, 8) of object i."""
        start, count = self.starts[i], self.starts[i + 1] - self.starts[i]
        if not count:
            return np.zeros((0, 4), np.float32), np.zeros((0, 8), np.float32)
        parts = ((self.mean_opacity, 4), (self.covariance, 8))
        data = [(b.read(4 * width * count, offset=4 * width * start), width) for b, width in parts]
        places, shapes = (np.frombuffer(d, np.float32).reshape(-1, w).copy() for d, w in data)
        return places, shapes

    def write_splats(self, i: int, mean_opacity: np.ndarray, covariance: np.ndarray | None) -> None:
        """The inverse of `read_splats`; None: shapes stay."""
        start, end = self._rows(i, mean_opacity, "places")
        parts = ((self.mean_opacity, mean_opacity, 4), (self.covariance, covariance, 8))
        for buffer, rows, width in parts if end > start else ():
            if rows is not None:
                data = np.ascontiguousarray(rows, np.float32)
                overwrite(buffer, data, offset=4 * width * start)

    def write_heat(self, i: int, heat: np.ndarray) -> None:
        """Uploads what value stops have in the colours of object i, (n, 4), to the set in use."""
        start, end = self._rows(i, heat, "heats")
        if end > start:
            overwrite(self.heat, np.ascontiguousarray(heat, np.float32), offset=16 * start)
            self.note_heat(i, True)

    def read_colors(self, i: int) -> tuple[np.ndarray, np.ndarray | None]:
        """(n, 3) colours of object i in the set in use, and (n, 4) heat; None: there is none."""
        start, end = self.starts[i], self.starts[i + 1]
        kept = self._heats.get(self.set)
        if end == start:
            return np.zeros((0, 3), np.float32), None
        rows = [
            np.frombuffer(buffer.read(16 * (end - start), offset=16 * start), np.float32)
            for buffer in (self.color, kept)
            if buffer is not None
        ]
        color, *heat = (row.reshape(-1, 4).copy() for row in rows)
        return color[:, :3], heat[0] if heat else None

    def _rows(self, i: int, array: np.ndarray, what: str) -> tuple[int, int]:
        start, end = self.starts[i], self.starts[i + 1]
        if len(array) != end - start:
            raise ValueError(f"object {i} has {end - start} splats, but {len(array)} {what} came.")
        return start, end

    def release(self) -> None:
        for buffer in (
            self.mean_opacity, self.covariance, *self.colors, self.records,
            self.keys, self.keys_spare, self.order, self.order_spare, self.histogram, self.counts,
            self.command, self.dispatch, self.staging, self._sorted,
        ):  # fmt: skip
            buffer.release()
        for buffer in self._heats.values():
            buffer.release()
        if self.pages is not None:
            self.pages.release()

    def __enter__(self) -> "Arena":
        return self

    def __exit__(self, *failure) -> None:
        self.release()
