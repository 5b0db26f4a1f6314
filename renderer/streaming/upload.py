"""Leaves at their levels into pages: each read and uploaded once, however many copies show it."""

from collections.abc import Iterator, Sequence

import numpy as np

from shapeshift.rasterizer.paging.pages import PAGE
from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.streaming.pages import (
    Filled,
    PageTable,
    fill_pages,
    pages_needed,
    together,
)
from shapeshift.runtime_models.leaf_levels import LeafSource, LeafSplats
from shapeshift.runtime_models.model import SplatLayers

AT_ONCE = 1 << 16  # splats that are uploaded together


class Uploader:
    """Fills the pages of a table from what the objects' leaves come from."""

    def __init__(
        self, drawing: Drawing, table: PageTable, objects: Sequence[int],
        models: Sequence[SplatLayers], first: np.ndarray,
    ) -> None:  # fmt: skip
        """objects: their numbers; first (O + 1,): the number of each one's first leaf."""
        self._drawing, self._table, self._first = drawing, table, first
        self._owner = np.array(objects)
        self._object = np.repeat(np.arange(len(models)), np.diff(first))  # of each leaf
        self._sources: dict[int, LeafSource] = {}
        self._coarse: dict[int, CoarseLevels] = {}
        for model in models:
            assert model.leaves is not None
            if id(model.leaves) not in self._sources:
                self._sources[id(model.leaves)] = model.leaves
                self._coarse[id(model.leaves)] = CoarseLevels(model, model.leaves)
        self._source_of = np.array([id(model.leaves) for model in models])  # of each object
        self._waiting: list[tuple[np.ndarray, Filled]] = []  # pages that are still to be written
        self._filled: list[np.ndarray] = []  # pages that were filled since this `upload` began
        self.placed = np.zeros(0, np.int64)  # those of the last one, rising
        self.edited = np.zeros(len(models), bool)  # objects whose splats are not as they were read

    def upload(self, leaves: np.ndarray, levels: np.ndarray) -> None:
        """Leaves (n,) at levels (n,) into free pages.  Raises BadFile."""
        self._filled.clear()
        for number in np.unique(self._source_of[self._object[leaves]]):
            mine = self._source_of[self._object[leaves]] == number
            self._upload(int(number), leaves[mine], levels[mine])
        self._flush()
        self.placed = np.sort(np.concatenate([np.zeros(0, np.int64), *self._filled]))

    def _upload(self, number: int, leaves: np.ndarray, levels: np.ndarray) -> None:
        """The same of one source."""
        source, kinds = self._sources[number], self._sources[number].levels.counts.shape[1]
        own = leaves - self._first[self._object[leaves]]
        pairs, copy_of = np.unique(own * kinds + levels, return_inverse=True)
        like = np.full(len(leaves), -1)  # a leaf that shows the same, or will
        alike = ~self.edited[self._object[leaves]] & self._drawing.shares_pages
        if alike.any() and np.count_nonzero(self._source_of == number) > 1:
            shown = self._shown(number, pairs // kinds, pairs % kinds)
            rows = np.flatnonzero(alike)[::-1]
            here = np.full(len(pairs), -1)
            here[copy_of[rows]] = leaves[rows]  # the first of each
            like = np.where(alike, np.where(shown >= 0, shown, here)[copy_of], -1)
        read = (like < 0) | (like == leaves)
        self._read_into(source, own[read], levels[read], leaves[read])
        self._flush()
        rest = ~read & (self._table.level[like] == levels)
        self._share(leaves[rest], levels[rest], like[rest])

    def _shown(self, number: int, leaves: np.ndarray, levels: np.ndarray) -> np.ndarray:
        """A leaf of an object that shows leaf (n,) of a source at level (n,) now; -1: there is
        none.
        """
        copies = self._first[:-1][(self._source_of == number) & ~self.edited]
        found = np.full(len(leaves), -1)
        for first in copies:
            there = self._table.level[first + leaves] == levels
            found = np.where((found < 0) & there, first + leaves, found)
        return found

    def _share(self, leaves: np.ndarray, levels: np.ndarray, like: np.ndarray) -> None:
        """Leaves (n,) show what others (n,) do, as many as fit."""
        counts = self._table.splats[like]
        fit = int(np.searchsorted(np.cumsum(pages_needed(counts)), self._table.room, "right"))
        leaves, levels, like, counts = (a[:fit] for a in (leaves, levels, like, counts))
        if len(leaves):
            before = self._table.pages_of(like)
            pages = self._table.reserve(leaves, levels, counts)
            owner = np.repeat(self._owner[self._object[leaves]], pages_needed(counts))
            self._drawing.share_pages(pages, owner, before)
            self._filled.append(pages)

    def _read_into(
        self, source: LeafSource, own: np.ndarray, levels: np.ndarray, leaves: np.ndarray
    ) -> None:
        """Leaves own (n,) of a source at levels (n,) for leaves (n,): each part read once."""
        kinds = source.levels.counts.shape[1]
        pairs, copy_of = np.unique(own * kinds + levels, return_inverse=True)
        for part in self._read(source, pairs // kinds, pairs % kinds):
            place = np.full(len(pairs), -1)
            given = part.leaves * kinds + part.levels
            place[np.searchsorted(pairs, given)] = np.arange(len(given))
            there = place[copy_of] >= 0
            self._place(part, place[copy_of][there], leaves[there])

    def _read(
        self, source: LeafSource, leaves: np.ndarray, levels: np.ndarray
    ) -> Iterator[LeafSplats]:
        """LeafSplats of all of these; coarsest levels are in memory already."""
        coarse = levels == source.levels.coarsest[leaves]
        if coarse.any():
            yield self._coarse[id(source)].picked(leaves[coarse], levels[coarse])
        if not coarse.all():
            yield from source.read(leaves[~coarse], levels[~coarse])

    def _place(self, part: LeafSplats, which: np.ndarray, leaves: np.ndarray) -> None:
        """Some leaves of a part into pages, as many as fit."""
        needed = np.cumsum(pages_needed(part.counts[which]))
        fit = int(np.searchsorted(needed, self._table.room, side="right"))
        which, leaves = which[:fit], leaves[:fit]
        owner = self._owner[self._object[leaves]]
        pages = self._table.reserve(leaves, part.levels[which], part.counts[which])
        self._waiting.append((pages, fill_pages(part, which, owner)))
        if sum(len(each) for each, _ in self._waiting) * PAGE >= AT_ONCE:
            self._flush()

    def _flush(self) -> None:
        """Uploads what waits: few large writes instead of one a file."""
        pages = np.concatenate([np.zeros(0, np.int64), *(each for each, _ in self._waiting)])
        if len(pages):
            self._drawing.place_pages(pages, *together([filled for _, filled in self._waiting]))
            self._filled.append(pages)
        self._waiting.clear()


class CoarseLevels:
    """The splats of a model by leaf."""

    def __init__(self, model: SplatLayers, source: LeafSource) -> None:
        self._model, leaf = model, source.coarse_leaf
        self._order = np.argsort(leaf, kind="stable")
        self._counts = np.bincount(leaf, minlength=len(source.part))
        self._starts = np.cumsum(self._counts) - self._counts

    def picked(self, leaves: np.ndarray, levels: np.ndarray) -> LeafSplats:
        """Leaves (n,), one after the other."""
        counts = self._counts[leaves]
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        rows = self._order[np.repeat(self._starts[leaves], counts) + within]
        m = self._model
        arrays = (array[rows] for array in (m.means, m.scales, m.wxyz, m.opacity, m.sh))
        return LeafSplats(leaves, levels, counts, *arrays)
