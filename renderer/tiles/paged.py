"""Pages of the arena for objects whose splats come and go, as a budget has them (streaming/)."""

from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.grade import grade_color
from shapeshift.rasterizer.pack import pack
from shapeshift.rasterizer.paging.pages import PAGE, gather_pages, scatter_pages
from shapeshift.rasterizer.shade_sh import shade_sh, upload_sh
from shapeshift.runtime_models.leaf_levels import LeafSplats
from shapeshift.scene.appearance import Appearance

if TYPE_CHECKING:
    from pyopencl.array import Array


class PagedRows:
    """The last rows of the arena: pages, each of one object or of none."""

    def __init__(self, device: Device, first: int, pages: int, coefficients: int) -> None:
        """first: the row of the arena where they begin, a whole number of pages."""
        self._device, self.first, self.pages = device, first, pages
        self.rows = slice(first, first + PAGE * pages)
        self.owner = np.full(pages, -1, np.int32)  # object of each page
        self._sh = device.zeros((PAGE // 8 * pages, 3 * coefficients, 8))
        self._coefficients = coefficients

    def place(
        self, pages: np.ndarray, owner: np.ndarray, given: LeafSplats,
        arena: "tuple[Array, Array, Array]",
    ) -> None:  # fmt: skip
        """Writes splats (n PAGE,), absent ones among them, to pages (n,) of these objects (n,).

        arena: mean_opacity (N, 4), covariance (N, 8) and object_index (N,).
        """
        device, count = self._device, len(given.means)
        mean_opacity, covariance = device.empty((count, 4)), device.empty((count, 8))
        pack(
            device, (given.means, given.scales, given.wxyz, given.opacity), 0, mean_opacity,
            covariance,
        )  # fmt: skip
        at = pages + self.first // PAGE
        index = device.upload(np.repeat(owner.astype(np.int32), PAGE))
        for rows, array in zip((mean_opacity, covariance, index), arena, strict=True):
            scatter_pages(device, rows, at, array)
        more = self._coefficients - given.sh.shape[1]  # other scenes have higher degrees
        sh = np.pad(given.sh, ((0, 0), (0, more), (0, 0)))
        scatter_pages(device, upload_sh(device, sh), pages, self._sh)
        self.owner[pages] = owner
        device.queue.finish()

    def clear(self, pages: np.ndarray, mean_opacity: "Array") -> None:
        """Nothing is left in these pages (n,)."""
        if len(pages):
            nothing = self._device.zeros((PAGE * len(pages), 4))
            scatter_pages(self._device, nothing, pages + self.first // PAGE, mean_opacity)
            self.owner[pages] = -1

    def shade(
        self, pages: np.ndarray, eye: np.ndarray, mean_opacity: "Array", color: "Array"
    ) -> None:
        """Colours of these pages (n,) towards an eye (3,) in their object's frame."""
        seen = np.zeros((self.pages, PAGE), bool)
        seen[pages] = True
        shade_sh(self._device, self._sh, eye, self.rows, mean_opacity, color, seen.ravel())

    def grade(self, i: int, color: "Array", grade: Appearance) -> None:
        """The appearance of object i, whose colours were just shaded."""
        if len(pages := self.pages_of(i)):
            runs = self.read(i, color)
            rows = slice(0, PAGE * len(pages))
            grade_color(self._device, rows, runs, grade.gain, grade.power)
            scatter_pages(self._device, runs, pages + self.first // PAGE, color)

    def pages_of(self, i: int) -> np.ndarray:
        """The pages of object i, rising."""
        return np.flatnonzero(self.owner == i)

    def read(self, i: int, array: "Array") -> "Array":
        """(n PAGE, w) the rows of object i, a copy on the device."""
        pages = self.pages_of(i)
        out = self._device.empty((PAGE * len(pages), array.shape[1]))
        gather_pages(self._device, array, pages + self.first // PAGE, out)
        return out

    def write(self, i: int, rows: np.ndarray, array: "Array") -> None:
        """The inverse of `read`."""
        pages = self.pages_of(i)
        given = self._device.upload(np.asarray(rows, np.float32))
        scatter_pages(self._device, given, pages + self.first // PAGE, array)
