"""Tiles of scenes with models in levels of detail: their splats lie in pages of the arena."""

from collections.abc import Sequence

import numpy as np

from shapeshift.rasterizer.paging.pages import PAGE
from shapeshift.renderer.colors.false_colors import Shade
from shapeshift.renderer.limits import arena_rows
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.tiles.paged import PagedRows
from shapeshift.renderer.tiles.tiles import TilesDrawing
from shapeshift.runtime_models.leaf_levels import LeafSplats
from shapeshift.runtime_models.model import Model
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import View

NO_EYE = np.zeros(3)  # for colours that look alike from everywhere


class PagedTiles(TilesDrawing):
    """TilesDrawing, with pages where a scene has models that need them."""

    _paged: PagedRows | None = None
    _is_paged: tuple[bool, ...] = ()  # of each object

    def allocate(self, models: list[Model], more: int = 0) -> None:
        super().allocate(models, more)
        self._paged, self._is_paged = None, (False,) * len(models)

    def allocate_pages(self, models: list[Model], pages: int, coefficients: int) -> None:
        fixed = sum(map(arena_rows, models))
        first = -(-fixed // PAGE) * PAGE
        self.allocate(models, first - fixed + PAGE * pages)
        self._paged = PagedRows(self.device, first, pages, coefficients)
        self._is_paged = tuple(getattr(model, "leaves", None) is not None for model in models)

    def place_pages(self, pages: np.ndarray, owner: np.ndarray, given: LeafSplats) -> None:
        self._pages.place(pages, owner, given, self._arena)
        self._splats_moved()

    def pages_of(self, i: int) -> np.ndarray:
        return self._pages.pages_of(i)

    def clear_pages(self, pages: np.ndarray) -> None:
        self._pages.clear(pages, self._mean_opacity)
        self._splats_moved()

    def shade_pages(self, pages: np.ndarray) -> None:
        for color in self._colors:
            self._pages.shade(pages, NO_EYE, self._mean_opacity, color)

    @property
    def _pages(self) -> PagedRows:
        assert self._paged is not None, "allocate_pages has made them"
        return self._paged

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
        arrays = (self._mean_opacity, self._covariance)
        mean_opacity, covariance = (self._read(i, array) for array in arrays)
        return mean_opacity, covariance

    def write_splats(self, i: int, mean_opacity: np.ndarray, covariance: np.ndarray | None) -> None:
        if not self._is_paged[i]:
            super().write_splats(i, mean_opacity, covariance)
            return
        self._pages.write(i, mean_opacity, self._mean_opacity)
        if covariance is not None:
            self._pages.write(i, covariance, self._covariance)
        self._splats_moved()

    def read_colors(self, i: int) -> tuple[np.ndarray, np.ndarray | None]:
        if not self._is_paged[i]:
            return super().read_colors(i)
        heat = self._heats[self._set]
        return self._read(i, self._color)[:, :3], None if heat is None else self._read(i, heat)

    def replace_colors(self, i: int, color: np.ndarray, heat: np.ndarray | None) -> None:
        if not self._is_paged[i]:
            super().replace_colors(i, color, heat)
            return
        self._pages.write(i, np.pad(color, ((0, 0), (0, 1))), self._color)
        if (kept := self._heats[self._set]) is not None and heat is not None:
            self._pages.write(i, heat, kept)

    def _read(self, i: int, array) -> np.ndarray:
        """(n, w) a copy of the rows of an object in pages."""
        return self.device.download(self._pages.read(i, array)).reshape(-1, array.shape[1])
