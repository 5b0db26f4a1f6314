"""Pages of the arena for objects whose splats come and go, as a budget has them (streaming/)."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.grade import grade_color
from shapeshift.rasterizer.pack import pack
from shapeshift.rasterizer.paging.drawn_pages import DrawnPages
from shapeshift.rasterizer.paging.pages import PAGE, PageMap, gather_pages, scatter_pages
from shapeshift.rasterizer.shade_sh import shade_pages, upload_sh
from shapeshift.runtime_models.leaf_levels import LeafSplats
from shapeshift.scene.appearance import Appearance

if TYPE_CHECKING:
    from pyopencl.array import Array

    from shapeshift.rasterizer.paging.pages import Arena


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
