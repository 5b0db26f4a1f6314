"""Tiles of scenes with models in levels of detail: their splats lie in pages of the arena."""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.colors import grade_color, shade_pages, upload_sh
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.pack import pack
from shapeshift.rasterizer.pages import PAGE, DrawnPages, PageMap, gather_pages, scatter_pages
from shapeshift.renderer.colors.false_colors import Shade
from shapeshift.renderer.drawing import SAMPLE, median_distance
from shapeshift.renderer.limits import arena_rows
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.tiles.tiles import TilesDrawing
from shapeshift.runtime_models.leaf_levels import LeafSplats
from shapeshift.runtime_models.model import Model
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from pyopencl.array import Array

    from shapeshift.rasterizer.pages import Arena


# Pages of the arena for objects whose splats come and go, as a budget has them (streaming/).


class PagedRows(DrawnPages):
    """The last rows of a frame: pages that are drawn, each for one object or for none.

    Their splats lie in stored pages, the last of the arena.  Colours are of the pages that are
    drawn.
    """

    def __init__(
        self, device: Device, first: int, pages: int, stored: int, coefficients: int
    ) -> None:
        """first: the row where both begin, a whole number of pages."""
        super().__init__(pages, stored)
        self._device, self.first = device, first
        self._sh = device.zeros((PAGE // 8 * stored, 3 * coefficients, 8))
        self._coefficients = coefficients

    @cached_property
    def map(self) -> PageMap:
        """Of all rows of a frame: objects that are there for good have theirs where they are."""
        fixed = self.first // PAGE
        moved = np.where(self.stored >= 0, self.stored + fixed, -1)
        sources = np.concatenate([np.arange(fixed), moved]).astype(np.int32)
        weights = np.concatenate([np.ones(fixed, np.float32), self.weight])
        return PageMap(self._device.upload(sources), self._device.upload(weights))

    def _remap(self) -> None:
        self.__dict__.pop("map", None)

    def grow(self, stored: int) -> None:
        """To so many stored pages; the arena has grown already."""
        super().grow(stored)
        sh = self._device.zeros((PAGE // 8 * stored, *self._sh.shape[1:]))
        self._device.copy_rows(self._sh, sh, 0)
        self._sh = sh

    def place(
        self, pages: np.ndarray, owner: np.ndarray, given: LeafSplats, arena: "Arena"
    ) -> None:
        """Writes splats (n PAGE,), absent ones among them, for pages (n,) of these objects (n,)."""
        device, count = self._device, len(given.means)
        mean_opacity, covariance = device.empty((count, 4)), device.empty((count, 8))
        pack(
            device, (given.means, given.scales, given.wxyz, given.opacity), 0, mean_opacity,
            covariance,
        )  # fmt: skip
        stored = self.free(len(pages))
        at = stored + self.first // PAGE
        scatter_pages(device, mean_opacity, at, arena[0])
        scatter_pages(device, covariance, at, arena[1])
        more = self._coefficients - given.sh.shape[1]  # other scenes have higher degrees
        sh = np.pad(given.sh, ((0, 0), (0, more), (0, 0)))
        scatter_pages(device, upload_sh(device, sh), stored, self._sh)
        self._draw(pages, owner, stored, arena[2])
        device.queue.finish()

    def share(
        self, pages: np.ndarray, owner: np.ndarray, like: np.ndarray, object_index: "Array"
    ) -> None:
        """Draws in pages (n,), for these objects (n,), what pages `like` (n,) show."""
        if len(pages):
            self._draw(pages, owner, self.stored[like], object_index)

    def _draw(
        self, pages: np.ndarray, owner: np.ndarray, stored: np.ndarray, object_index: "Array"
    ) -> None:
        index = self._device.upload(np.repeat(owner.astype(np.int32), PAGE))
        scatter_pages(self._device, index, pages + self.first // PAGE, object_index)
        self.draw(pages, owner, stored)
        self._remap()

    def clear(self, pages: np.ndarray) -> None:
        super().clear(pages)
        self._remap()

    def weigh(self, pages: np.ndarray, weight: float) -> None:
        super().weigh(pages, weight)
        self._remap()

    def own(self, pages: np.ndarray, arena: "Arena") -> None:
        """Gives pages (n,) splats of their own, which may be changed."""
        if not len(pages):
            return
        fixed = self.first // PAGE
        before, stored = self.part(pages)
        for array, start in ((arena[0], fixed), (arena[1], fixed), (self._sh, 0)):
            self._move(before + start, stored + start, array)
        self._remap()

    def _move(self, before: np.ndarray, after: np.ndarray, array: "Array") -> None:
        """Copies pages (n,) of an array to its pages (n,)."""
        rows = PAGE // 8 if array is self._sh else PAGE
        kept = self._device.empty((rows * len(before), *array.shape[1:]))
        gather_pages(self._device, array, before, kept)
        scatter_pages(self._device, kept, after, array)

    def shade(
        self, pages: np.ndarray, eye: np.ndarray, mean_opacity: "Array", color: "Array"
    ) -> None:
        """Colours of these pages (n,) towards an eye (3,) in their object's frame."""
        where = (self.stored[pages], pages)
        shade_pages(self._device, self._sh, eye, self.first, where, mean_opacity, color)

    def grade(self, i: int, color: "Array", grade: Appearance) -> None:
        """The appearance of object i, whose colours were just shaded."""
        if len(pages := self.pages_of(i)):
            runs = self.read(pages, color)
            rows = slice(0, PAGE * len(pages))
            grade_color(self._device, rows, runs, grade.gain, grade.power)
            scatter_pages(self._device, runs, pages + self.first // PAGE, color)

    def read(self, pages: np.ndarray, array: "Array") -> "Array":
        """(n PAGE, w) rows of pages (n,), a copy on the device.

        pages: drawn ones of an array of colours, stored ones of an array of splats.
        """
        out = self._device.empty((PAGE * len(pages), array.shape[1]))
        gather_pages(self._device, array, pages + self.first // PAGE, out)
        return out

    def write(self, pages: np.ndarray, rows: np.ndarray, array: "Array") -> None:
        """The inverse of `read`."""
        given = self._device.upload(np.asarray(rows, np.float32))
        scatter_pages(self._device, given, pages + self.first // PAGE, array)


HELD = 64 << 20  # bytes that passes may leave for the next frame
NO_EYE = np.zeros(3)  # for colours that look alike from everywhere


class PagedTiles(TilesDrawing):
    """TilesDrawing, with pages where a scene has models that need them."""

    shares_pages = weighs_pages = True
    paged: PagedRows | None = None
    _is_paged: tuple[bool, ...] = ()  # of each object

    def allocate(self, models: list[Model], more: int = 0, stored: int | None = None) -> None:
        super().allocate(models, more, stored)
        self.paged, self._is_paged = None, (False,) * len(models)

    def allocate_pages(
        self, models: list[Model], pages: int, coefficients: int, stored: int | None = None
    ) -> None:
        stored = pages if stored is None else stored
        fixed = sum(map(arena_rows, models))
        first = -(-fixed // PAGE) * PAGE
        self.allocate(models, first - fixed + PAGE * pages, first - fixed + PAGE * stored)
        self.paged = PagedRows(self.device, first, pages, stored, coefficients)
        self._is_paged = tuple(getattr(model, "leaves", None) is not None for model in models)

    @property
    def _page_map(self) -> PageMap | None:
        return self.paged.map if self.paged is not None else None

    def place_pages(self, pages: np.ndarray, owner: np.ndarray, given: LeafSplats) -> None:
        self._make_room(len(pages))
        self._pages.place(pages, owner, given, self._arena)
        self._splats_moved()

    def share_pages(self, pages: np.ndarray, owner: np.ndarray, like: np.ndarray) -> None:
        self._pages.share(pages, owner, like, self._object_index)
        self._splats_moved()

    def weigh_pages(self, pages: np.ndarray, part: float) -> None:
        if len(pages):
            self._pages.weigh(pages, part)
            self._splats_moved()

    def trim(self) -> int:
        pool = self.device.pool
        if pool.managed_bytes - pool.active_bytes > HELD:
            pool.free_held()
        return pool.managed_bytes if self.device.kind == "cpu" else 0

    def _make_room(self, pages: int) -> None:
        """For so many more stored pages."""
        if not (stored := self._pages.lacking(pages)):
            return
        rows, before = self._pages.first + PAGE * stored, (self._mean_opacity, self._covariance)
        self._mean_opacity, self._covariance = (
            self.device.zeros((rows, array.shape[1])) for array in before
        )
        for array, into in zip(before, (self._mean_opacity, self._covariance), strict=True):
            self.device.copy_rows(array, into, 0)
        self._pages.grow(stored)

    def pages_of(self, i: int) -> np.ndarray:
        return self._pages.pages_of(i)

    def clear_pages(self, pages: np.ndarray) -> None:
        if len(pages):
            self._pages.clear(pages)
            self._splats_moved()

    def shade_pages(self, pages: np.ndarray) -> None:
        for color in self._colors:
            self._pages.shade(pages, NO_EYE, self._mean_opacity, color)

    @property
    def _pages(self) -> PagedRows:
        assert self.paged is not None, "allocate_pages has made them"
        return self.paged

    def decode_color(
        self, i: int, shade: Shade, eye_object: np.ndarray, seen: np.ndarray | None = None,
        at_once: bool = False, grade: Appearance | None = None,
    ) -> None:  # fmt: skip
        if not self._is_paged[i]:
            super().decode_color(i, shade, eye_object, seen, at_once, grade)
            return
        pages = self._pages
        pages.shade(pages.pages_of(i), eye_object, self._mean_opacity, self._color)
        if grade is not None:
            pages.grade(i, self._color, grade)

    def seen_splats(
        self, i: int, views: Sequence[View], settings: RenderSettings
    ) -> np.ndarray | None:
        return None if self._is_paged[i] else super().seen_splats(i, views, settings)

    def read_splats(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        if not self._is_paged[i]:
            return super().read_splats(i)
        stored = self._pages.stored[self.pages_of(i)]
        arrays = (self._mean_opacity, self._covariance)
        mean_opacity, covariance = (self._read(stored, array) for array in arrays)
        return mean_opacity, covariance

    def write_splats(self, i: int, mean_opacity: np.ndarray, covariance: np.ndarray | None) -> None:
        if not self._is_paged[i]:
            super().write_splats(i, mean_opacity, covariance)
            return
        shared = self._pages.shared(i)
        self._make_room(len(shared))
        self._pages.own(shared, self._arena)
        stored = self._pages.stored[self.pages_of(i)]
        self._pages.write(stored, mean_opacity, self._mean_opacity)
        if covariance is not None:
            self._pages.write(stored, covariance, self._covariance)
        self._splats_moved()

    def read_colors(self, i: int) -> tuple[np.ndarray, np.ndarray | None]:
        if not self._is_paged[i]:
            return super().read_colors(i)
        heat, pages = self._heats[self._set], self.pages_of(i)
        color = self._read(pages, self._color)[:, :3]
        return color, None if heat is None else self._read(pages, heat)

    def replace_colors(self, i: int, color: np.ndarray, heat: np.ndarray | None) -> None:
        if not self._is_paged[i]:
            super().replace_colors(i, color, heat)
            return
        pages = self.pages_of(i)
        self._pages.write(pages, np.pad(color, ((0, 0), (0, 1))), self._color)
        if (kept := self._heats[self._set]) is not None and heat is not None:
            self._pages.write(pages, heat, kept)

    def _read(self, pages: np.ndarray, array) -> np.ndarray:
        """(n, w) a copy of the rows of pages."""
        return self.device.download(self._pages.read(pages, array)).reshape(-1, array.shape[1])

    def _median_distance(self, eye_from_world: np.ndarray) -> float:
        if self.paged is None:
            return super()._median_distance(eye_from_world)
        row = np.arange(0, self.splats, -(-self.splats // SAMPLE))
        fixed, page = self.paged.first // PAGE, row // PAGE
        drawn = np.concatenate([np.arange(fixed), self.paged.stored + fixed])
        there = (page < fixed) | (self.paged.stored[np.maximum(page - fixed, 0)] >= 0)
        row, page = row[there], page[there]
        mean_opacity = self.device.view(self._mean_opacity)[PAGE * drawn[page] + row % PAGE]
        owner = self.device.view(self._object_index)[row]
        return median_distance(eye_from_world @ self._world_from_objects, mean_opacity, owner)

    def splat_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if self.paged is None:
            return super().splat_points()
        first, stored = self.paged.first, self.paged.stored
        out = []
        for array in (self._mean_opacity, self._covariance):
            rows = np.zeros((len(stored), PAGE, array.shape[1]), np.float32)
            drawn = stored >= 0
            rows[drawn] = self._read(stored[drawn], array).reshape(-1, *rows.shape[1:])
            fixed = (
                self.device.download(array[:first]) if first else rows[:0].reshape(0, rows.shape[2])
            )
            out.append(np.concatenate([fixed, rows.reshape(-1, rows.shape[2])]))
        owner = self.device.download(self._object_index)[:first]
        return out[0], np.concatenate([owner, np.repeat(self.paged.owner, PAGE)]), out[1]
