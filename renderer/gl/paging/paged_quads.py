"""Quads of scenes with models in levels of detail: their splats lie in pages of the arena."""

import math
from collections.abc import Iterator

import moderngl
import numpy as np

from shapeshift.rasterizer.paging.pages import PAGE
from shapeshift.renderer import layout
from shapeshift.renderer.colors.false_colors import Shade
from shapeshift.renderer.gl.buffers import bind
from shapeshift.renderer.gl.gpu import groups_for, overwrite
from shapeshift.renderer.gl.quads import QuadsDrawing
from shapeshift.renderer.limits import arena_rows
from shapeshift.runtime_models.leaf_levels import LeafSplats
from shapeshift.runtime_models.model import Model
from shapeshift.runtime_models.rotation import covariance
from shapeshift.scene.appearance import Appearance

NO_EYE = np.zeros(3)  # for colours that look alike from everywhere


class PagedQuads(QuadsDrawing):
    """QuadsDrawing, with pages where a scene has models that need them.

    Pages are written run by run, and an object is projected a run of pages at a time; free pages
    belong to the run before them.
    """

    weighs_pages = True
    _is_paged: tuple[bool, ...] = ()  # of each object
    _left_out = np.zeros(0, np.float32)  # the part of each page that is not drawn
    _owner = np.zeros(0, np.int32)  # object of each page; -1: it is free
    _first = 0  # row of the arena where pages begin
    _sh: moderngl.Buffer | None = None  # (pages, coefficients * 3, PAGE)
    _coefficients = 1
    _brightest_placed = 1.0  # that a colour of any page was from any side, at most

    def allocate(self, models: list[Model], more: int = 0) -> None:
        super().allocate(models, more)
        self._is_paged, self._owner = (False,) * len(models), np.zeros(0, np.int32)
        self._release_harmonics()

    def allocate_pages(
        self, models: list[Model], pages: int, coefficients: int, stored: int | None = None
    ) -> None:
        self._first = sum(map(arena_rows, models))
        self.allocate(models, PAGE * pages)
        self._is_paged = tuple(getattr(model, "leaves", None) is not None for model in models)
        self._owner, self._left_out = np.full(pages, -1, np.int32), np.zeros(pages, np.float32)
        self._coefficients, self._brightest_placed = coefficients, 1.0
        size = 12 * coefficients * PAGE * pages
        self._sh = self._gpu.reserve(size, "spherical harmonics")
        self._note_runs()

    def _note_runs(self) -> None:
        """Tells the arena whose its last rows are."""
        given = np.flatnonzero(self._owner >= 0)
        first_paged = self._is_paged.index(True)
        owner = self._owner[given] if len(given) else np.array([first_paged])
        starts = given if len(given) else np.array([0])
        new = np.flatnonzero(np.diff(owner, prepend=-1))
        ends = [0, *starts[new[1:]].tolist(), len(self._owner)]
        self.arena.paged = [
            (int(owner[at]), self._first + PAGE * first, self._first + PAGE * last)
            for at, first, last in zip(new, ends[:-1], ends[1:], strict=True)
        ]

    def pages_of(self, i: int) -> np.ndarray:
        return np.flatnonzero(self._owner == i)

    def place_pages(self, pages: np.ndarray, owner: np.ndarray, given: LeafSplats) -> None:
        rows = len(given.means)
        mean_opacity = np.concatenate([given.means, given.opacity[:, None]], axis=1)
        shapes = np.zeros((rows, 8), np.float32)
        shapes[:, :6] = covariance(given.scales, given.wxyz)
        self._write(pages, self.arena.mean_opacity, mean_opacity.astype(np.float32))
        self._write(pages, self.arena.covariance, shapes)
        more = self._coefficients - given.sh.shape[1]
        sh = np.pad(given.sh, ((0, 0), (0, more), (0, 0))).reshape(len(pages), PAGE, -1)
        assert self._sh is not None
        self._write(pages, self._sh, sh.transpose(0, 2, 1), 0)
        if rows:
            # The squares of the first M harmonics add up to M / (4 pi) in every direction.
            length = float(np.sqrt(np.square(given.sh).sum(axis=1).max()))
            most = 0.5 + length * math.sqrt(given.sh.shape[1] / (4 * math.pi))
            self._brightest_placed = max(self._brightest_placed, most)
        self._owner[pages], self._left_out[pages] = owner, 0
        self._note_runs()
        self._changed = True

    def clear_pages(self, pages: np.ndarray) -> None:
        self._write(pages, self.arena.mean_opacity, np.zeros((PAGE * len(pages), 4), np.float32))
        self._owner[pages] = -1
        self._note_runs()
        self._changed = True

    def weigh_pages(self, pages: np.ndarray, part: float) -> None:
        program = self._gpu.compute("paging/fade_pages.comp")
        bind(covariance=self.arena.covariance)
        for first, last in runs_of(np.sort(pages)):
            count = PAGE * (last - first)
            self._gpu.run(
                program, groups_for(count, layout.WORKGROUP), count=count,
                start=self._first + PAGE * first, left_out=1 - part,
            )  # fmt: skip
        self._left_out[pages] = 1 - part
        self._changed |= len(pages) > 0

    def shade_pages(self, pages: np.ndarray) -> None:
        for color in self.arena.colors:
            self._shade(pages, NO_EYE, color)

    def _shade(self, pages: np.ndarray, eye: np.ndarray, color: moderngl.Buffer) -> None:
        program = self._gpu.compute("colors/shade_sh.comp", PAGE=PAGE)
        assert self._sh is not None
        bind(mean_opacity=self.arena.mean_opacity, color=color, sh=self._sh)
        program["eye"].value = tuple(float(v) for v in eye)
        for first, last in runs_of(pages):
            count = PAGE * (last - first)
            self._gpu.run(
                program, groups_for(count, layout.WORKGROUP), count=count, first_page=first,
                start=self._first + PAGE * first, coefficients=self._coefficients,
            )  # fmt: skip

    def decode_color(
        self, i: int, shade: Shade, eye_object: np.ndarray, seen: np.ndarray | None = None,
        at_once: bool = False, grade: Appearance | None = None,
    ) -> None:  # fmt: skip
        if not self._is_paged[i]:
            super().decode_color(i, shade, eye_object, seen, at_once, grade)
            return
        self._grades[i] = grade
        self._shade(self.pages_of(i), eye_object, self.arena.color)
        if grade is not None:
            program = self._gpu.compute("colors/grade.comp")
            bind(color=self.arena.color)
            for first, last in runs_of(self.pages_of(i)):
                count, start = PAGE * (last - first), self._first + PAGE * first
                self._gpu.run(
                    program, groups_for(count, layout.WORKGROUP), count=count, start=start,
                    gain=tuple(grade.gain), power=grade.power,
                )  # fmt: skip

    def read_splats(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        if not self._is_paged[i]:
            return super().read_splats(i)
        shapes = self._read(i, self.arena.covariance, 8)
        shapes[:, 6:] = 0  # what is left out is the page's
        return self._read(i, self.arena.mean_opacity, 4), shapes

    def write_splats(self, i: int, mean_opacity: np.ndarray, covariance: np.ndarray | None) -> None:
        if not self._is_paged[i]:
            super().write_splats(i, mean_opacity, covariance)
            return
        self._write(self.pages_of(i), self.arena.mean_opacity, mean_opacity)
        if covariance is not None:
            shapes = covariance.copy()
            shapes[:, 6] = np.repeat(self._left_out[self.pages_of(i)], PAGE)
            self._write(self.pages_of(i), self.arena.covariance, shapes)
        self._changed = True

    def read_colors(self, i: int) -> tuple[np.ndarray, np.ndarray | None]:
        if not self._is_paged[i]:
            return super().read_colors(i)
        return self._read(i, self.arena.color, 4)[:, :3], None

    def replace_colors(self, i: int, color: np.ndarray, heat: np.ndarray | None) -> None:
        if not self._is_paged[i]:
            super().replace_colors(i, color, heat)
            return
        self._write(self.pages_of(i), self.arena.color, np.pad(color, ((0, 0), (0, 1))))

    def write_colors(self, color: np.ndarray) -> None:
        super().write_colors(color[: self._first] if self._owner.size else color)
        if self._owner.size:
            rows = np.pad(np.asarray(color[self._first :], np.float32), ((0, 0), (0, 1)))
            for buffer in self.arena.colors:
                self._write(np.arange(len(self._owner)), buffer, rows)

    def splat_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        mean_opacity, owner, shapes = super().splat_points()
        return mean_opacity, np.concatenate([owner, np.repeat(self._owner, PAGE)]), shapes

    def _brightest(self) -> float:
        if not any(self._is_paged):
            return super()._brightest()
        grades = [grade for grade in self._grades.values() if grade is not None]
        most = max(super()._brightest(), self._brightest_placed)
        return max([most, *(float(g.graded(np.full(3, most)).max()) for g in grades)])

    def _read(self, i: int, buffer: moderngl.Buffer, width: int) -> np.ndarray:
        """(n PAGE, width) the rows of an object in pages; a copy."""
        parts = [
            buffer.read(4 * width * PAGE * (last - first),
                        offset=4 * width * (self._first + PAGE * first))
            for first, last in runs_of(self.pages_of(i))
        ]  # fmt: skip
        return np.frombuffer(b"".join(parts), np.float32).reshape(-1, width).copy()

    def _write(
        self, pages: np.ndarray, buffer: moderngl.Buffer, rows: np.ndarray, first: int | None = None
    ) -> None:
        """Rows of pages (n,) into a buffer, whose pages begin at row `first`: the arena's."""
        if not len(pages):
            return
        start = self._first if first is None else first
        data = np.ascontiguousarray(rows, np.float32).reshape(len(pages), -1)
        order = np.argsort(pages)
        data, each, at = data[order], 4 * data.shape[1], 0
        for low, high in runs_of(pages[order]):
            place = each * low + each // PAGE * start
            overwrite(buffer, data[at : at + high - low], offset=place)
            at += high - low

    def _release_harmonics(self) -> None:
        if self._sh is not None:
            self._sh.release()
        self._sh = None

    def close(self) -> None:
        self._release_harmonics()
        super().close()


def runs_of(pages: np.ndarray) -> Iterator[tuple[int, int]]:
    """(first, last + 1) of the runs of neighbours among rising pages."""
    if len(pages):
        cuts = np.flatnonzero(np.diff(pages) != 1) + 1
        for run in np.split(np.asarray(pages), cuts):
            yield int(run[0]), int(run[-1]) + 1
