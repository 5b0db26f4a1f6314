"""Quads of scenes with models in levels of detail: their splats lie in pages of the arena."""

import math
from collections.abc import Iterator

import moderngl
import numpy as np

from shapeshift.rasterizer.pages import PAGE
from shapeshift.renderer import layout
from shapeshift.renderer.colors.false_colors import Shade
from shapeshift.renderer.gl.buffers import MappedPages, bind
from shapeshift.renderer.gl.gpu import groups_for, overwrite
from shapeshift.renderer.gl.quads import QuadsDrawing
from shapeshift.renderer.limits import arena_rows
from shapeshift.runtime_models.leaf_levels import LeafSplats
from shapeshift.runtime_models.model import Model, is_antialiased
from shapeshift.runtime_models.rotation import covariance
from shapeshift.scene.appearance import Appearance

NO_EYE = np.zeros(3)  # for colours that look alike from everywhere


class PagedQuads(QuadsDrawing):
    """QuadsDrawing, with pages where a scene has models that need them."""

    shares_pages = weighs_pages = True
    paged: MappedPages | None = None
    _is_paged: tuple[bool, ...] = ()  # of each object
    _sh: moderngl.Buffer | None = None  # (stored pages, coefficients * 3, PAGE)
    _coefficients = 1
    _brightest_placed = 1.0  # that a colour of any page was from any side, at most

    def allocate(self, models: list[Model], more: int = 0, stored: int | None = None) -> None:
        super().allocate(models, more, stored)
        self.paged, self._is_paged = None, (False,) * len(models)
        self._release_harmonics()

    def allocate_pages(
        self, models: list[Model], pages: int, coefficients: int, stored: int | None = None
    ) -> None:
        stored = pages if stored is None else stored
        first = sum(map(arena_rows, models))
        self.allocate(models, PAGE * pages, PAGE * stored)
        self._is_paged = tuple(getattr(model, "leaves", None) is not None for model in models)
        faint = tuple(
            paged and is_antialiased(m) for m, paged in zip(models, self._is_paged, strict=True)
        )
        self.paged = self.arena.pages = MappedPages(self._gpu, first, pages, stored, faint)
        self._coefficients, self._brightest_placed = coefficients, 1.0
        self._sh = self._gpu.reserve(self._bytes_of_sh(stored), "spherical harmonics")

    def _bytes_of_sh(self, stored: int) -> int:
        return 12 * self._coefficients * PAGE * stored

    @property
    def _pages(self) -> MappedPages:
        assert self.paged is not None, "allocate_pages has made them"
        return self.paged

    def pages_of(self, i: int) -> np.ndarray:
        return self._pages.pages_of(i)

    def place_pages(self, pages: np.ndarray, owner: np.ndarray, given: LeafSplats) -> None:
        self._make_room(len(pages))
        rows, stored = len(given.means), self._pages.free(len(pages))
        mean_opacity = np.concatenate([given.means, given.opacity[:, None]], axis=1)
        shapes = np.zeros((rows, 8), np.float32)
        shapes[:, :6] = covariance(given.scales, given.wxyz)
        self._write(stored, self.arena.mean_opacity, mean_opacity.astype(np.float32))
        self._write(stored, self.arena.covariance, shapes)
        more = self._coefficients - given.sh.shape[1]
        sh = np.pad(given.sh, ((0, 0), (0, more), (0, 0))).reshape(len(pages), PAGE, -1)
        assert self._sh is not None
        self._write(stored, self._sh, sh.transpose(0, 2, 1), 0)
        if rows:
            # The squares of the first M harmonics add up to M / (4 pi) in every direction.
            length = float(np.sqrt(np.square(given.sh).sum(axis=1).max()))
            most = 0.5 + length * math.sqrt(given.sh.shape[1] / (4 * math.pi))
            self._brightest_placed = max(self._brightest_placed, most)
        self._pages.draw(pages, owner, stored)
        self._changed = True

    def share_pages(self, pages: np.ndarray, owner: np.ndarray, like: np.ndarray) -> None:
        self._pages.draw(pages, owner, self._pages.stored[like])
        self._changed |= len(pages) > 0

    def clear_pages(self, pages: np.ndarray) -> None:
        self._pages.clear(pages)
        self._changed |= len(pages) > 0

    def weigh_pages(self, pages: np.ndarray, part: float) -> None:
        self._pages.weigh(pages, part)
        self._changed |= len(pages) > 0

    def _make_room(self, pages: int) -> None:
        """For so many more stored pages."""
        if stored := self._pages.lacking(pages):
            self.arena.grow(PAGE * stored)
            before, self._sh = self._sh, self._gpu.reserve(self._bytes_of_sh(stored))
            assert before is not None
            self._gpu.ctx.copy_buffer(self._sh, before, before.size)
            before.release()
            self._pages.grow(stored)

    def shade_pages(self, pages: np.ndarray) -> None:
        for color in self.arena.colors:
            self._shade(pages, NO_EYE, color)

    def _shade(self, pages: np.ndarray, eye: np.ndarray, color: moderngl.Buffer) -> None:
        if not len(pages):
            return
        program, paged = self._gpu.compute("colors/shade_sh.comp", PAGED=1, PAGE=PAGE), self._pages
        assert self._sh is not None
        bind(mean_opacity=self.arena.mean_opacity, color=color, sh=self._sh)
        bind(pages=paged.upload(), listed=paged.listed(pages))
        program["eye"].value = tuple(float(v) for v in eye)
        self._gpu.run(
            program, groups_for(PAGE * len(pages), layout.WORKGROUP), count=PAGE * len(pages),
            start=paged.first, first_entry=paged.first_entry, coefficients=self._coefficients,
        )  # fmt: skip

    def decode_color(
        self, i: int, shade: Shade, eye_object: np.ndarray, seen: np.ndarray | None = None,
        at_once: bool = False, grade: Appearance | None = None,
    ) -> None:  # fmt: skip
        if not self._is_paged[i]:
            super().decode_color(i, shade, eye_object, seen, at_once, grade)
            return
        self._grades[i], pages = grade, self.pages_of(i)
        self._shade(pages, eye_object, self.arena.color)
        if grade is not None and len(pages):
            program = self._gpu.compute("colors/grade.comp", PAGED=1, PAGE=PAGE)
            bind(color=self.arena.color, listed=self._pages.listed(pages))
            count = PAGE * len(pages)
            self._gpu.run(
                program, groups_for(count, layout.WORKGROUP), count=count, start=self._pages.first,
                gain=tuple(grade.gain), power=grade.power,
            )  # fmt: skip

    def read_splats(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        if not self._is_paged[i]:
            return super().read_splats(i)
        stored, arena = self._pages.stored[self.pages_of(i)], self.arena
        return self._read(stored, arena.mean_opacity, 4), self._read(stored, arena.covariance, 8)

    def write_splats(self, i: int, mean_opacity: np.ndarray, covariance: np.ndarray | None) -> None:
        if not self._is_paged[i]:
            super().write_splats(i, mean_opacity, covariance)
            return
        self._part(self._pages.shared(i))
        stored = self._pages.stored[self.pages_of(i)]
        self._write(stored, self.arena.mean_opacity, mean_opacity)
        if covariance is not None:
            self._write(stored, self.arena.covariance, covariance)
        self._changed = True

    def _part(self, pages: np.ndarray) -> None:
        """Gives pages (n,) splats of their own, which may be changed."""
        if not len(pages):
            return
        self._make_room(len(pages))
        before, stored = self._pages.part(pages)
        assert self._sh is not None
        first, arena = self._pages.first, self.arena
        for buffer, width, start in (
            (arena.mean_opacity, 4, first), (arena.covariance, 8, first),
            (self._sh, 3 * self._coefficients, 0),
        ):  # fmt: skip
            self._write(stored, buffer, self._read(before, buffer, width, start), start)

    def read_colors(self, i: int) -> tuple[np.ndarray, np.ndarray | None]:
        if not self._is_paged[i]:
            return super().read_colors(i)
        return self._read(self.pages_of(i), self.arena.color, 4)[:, :3], None

    def replace_colors(self, i: int, color: np.ndarray, heat: np.ndarray | None) -> None:
        if not self._is_paged[i]:
            super().replace_colors(i, color, heat)
            return
        self._write(self.pages_of(i), self.arena.color, np.pad(color, ((0, 0), (0, 1))))

    def write_colors(self, color: np.ndarray) -> None:
        super().write_colors(color[: self.arena.starts[-1]])
        if self.paged is not None:
            rows = np.pad(np.asarray(color[self.paged.first :], np.float32), ((0, 0), (0, 1)))
            for buffer in self.arena.colors:
                self._write(np.arange(self.paged.pages), buffer, rows)

    def splat_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        mean_opacity, owner, shapes = super().splat_points()
        if self.paged is None:
            return mean_opacity, owner, shapes
        there, out = self.paged.stored >= 0, []
        for fixed, buffer in (
            (mean_opacity, self.arena.mean_opacity), (shapes, self.arena.covariance)
        ):  # fmt: skip
            rows = np.zeros((self.paged.pages, PAGE, fixed.shape[1]), np.float32)
            drawn = self._read(self.paged.stored[there], buffer, fixed.shape[1])
            rows[there] = drawn.reshape(-1, *rows.shape[1:])
            out.append(np.concatenate([fixed, rows.reshape(-1, fixed.shape[1])]))
        return out[0], np.concatenate([owner, np.repeat(self.paged.owner, PAGE)]), out[1]

    def _brightest(self) -> float:
        if not any(self._is_paged):
            return super()._brightest()
        grades = [grade for grade in self._grades.values() if grade is not None]
        most = max(super()._brightest(), self._brightest_placed)
        return max([most, *(float(g.graded(np.full(3, most)).max()) for g in grades)])

    def _read(
        self, pages: np.ndarray, buffer: moderngl.Buffer, width: int, first: int | None = None
    ) -> np.ndarray:
        """(n PAGE, width) pages (n,) of a buffer, whose pages begin at row `first`: the arena's."""
        start, (wanted, at) = self._start(first), np.unique(pages, return_inverse=True)
        parts = [
            buffer.read(4 * width * PAGE * (last - low), offset=4 * width * (start + PAGE * low))
            for low, last in runs_of(wanted)
        ]
        rows = np.frombuffer(b"".join(parts), np.float32).reshape(-1, PAGE * width)
        return rows[at].reshape(-1, width)

    def _write(
        self, pages: np.ndarray, buffer: moderngl.Buffer, rows: np.ndarray, first: int | None = None
    ) -> None:
        """Rows of pages (n,) into a buffer, whose pages begin at row `first`: the arena's."""
        if not len(pages):
            return
        start = self._start(first)
        data = np.ascontiguousarray(rows, np.float32).reshape(len(pages), -1)
        order = np.argsort(pages)
        data, each, at = data[order], 4 * data.shape[1], 0
        for low, high in runs_of(pages[order]):
            place = each * low + each // PAGE * start
            overwrite(buffer, data[at : at + high - low], offset=place)
            at += high - low

    def _start(self, first: int | None) -> int:
        return self._pages.first if first is None else first

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
