"""Leaves at their levels into pages: each read and uploaded once, however many copies show it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.rasterizer.pages import PAGE
from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.streaming.choose import NOT_DRAWN
from shapeshift.runtime_models.leaf_levels import LeafSource, LeafSplats
from shapeshift.runtime_models.model import SplatLayers

# Which leaf lies in which pages of the arena, at which level.

ROOM = 1.25  # rows over the budget's splats: pages are not shared, so the last one is not full


class PageTable:
    """Pages that are free, and what the others hold."""

    def __init__(self, pages: int, leaves: int) -> None:
        self.leaf_of = np.full(pages, -1, np.int64)  # of each page; -1: it is free, or leaving
        self.left = np.full(pages, -1, np.int64)  # the leaf that a page is leaving; -1: none
        self.level = np.full(leaves, NOT_DRAWN)  # at which each leaf is there
        self.splats = np.zeros(leaves, np.int64)  # of each leaf there

    def free(self, leaves: np.ndarray) -> np.ndarray:
        """Takes leaves (n,) out; the pages that they had."""
        gone = np.zeros(len(self.level), bool)
        gone[leaves] = True
        pages = np.flatnonzero((self.leaf_of >= 0) & gone[np.maximum(self.leaf_of, 0)])
        self.leaf_of[pages] = -1
        self.level[leaves], self.splats[leaves] = NOT_DRAWN, 0
        return pages

    def retire(self, leaves: np.ndarray) -> None:
        """The pages of leaves (n,) stay until they are released; the leaves may get others."""
        pages = self.pages_of(leaves)
        self.left[pages], self.leaf_of[pages] = self.leaf_of[pages], -1
        self.level[leaves], self.splats[leaves] = NOT_DRAWN, 0

    def leaving(self, leaves: np.ndarray) -> np.ndarray:
        """The pages that leaves (n,) had before."""
        gone = np.zeros(len(self.level), bool)
        gone[leaves] = True
        return np.flatnonzero((self.left >= 0) & gone[np.maximum(self.left, 0)])

    def release(self, leaves: np.ndarray) -> np.ndarray:
        """Frees these; which they were."""
        pages = self.leaving(leaves)
        self.left[pages] = -1
        return pages

    @property
    def is_free(self) -> np.ndarray:
        """(P,) bool"""
        return (self.leaf_of < 0) & (self.left < 0)

    def reserve(self, leaves: np.ndarray, levels: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """Pages for so many splats of each leaf (n,), one leaf after the other.

        ValueError where there are not as many free.
        """
        needed = -(-counts // PAGE)
        free = np.flatnonzero(self.is_free)
        if not needed.sum() <= len(free):
            raise ValueError(f"{needed.sum()} pages are wanted, {len(free)} are free.")
        pages = free[: needed.sum()]
        self.leaf_of[pages] = np.repeat(leaves, needed)
        self.level[leaves], self.splats[leaves] = levels, counts
        return pages

    def pages_of(self, leaves: np.ndarray) -> np.ndarray:
        """All pages of leaves (n,), one leaf after the other, in the order of their splats."""
        wanted = np.zeros(len(self.level), bool)
        wanted[leaves] = True
        order = np.flatnonzero((self.leaf_of >= 0) & wanted[np.maximum(self.leaf_of, 0)])
        order = order[np.argsort(self.leaf_of[order], kind="stable")]
        of = self.leaf_of[order]
        first, last = np.searchsorted(of, leaves, "left"), np.searchsorted(of, leaves, "right")
        counts = last - first
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        return order[np.repeat(first, counts) + within]

    @property
    def room(self) -> int:
        """Pages that are free."""
        return int(np.count_nonzero(self.is_free))


def pages_needed(counts: np.ndarray) -> np.ndarray:
    """(n,) pages of leaves with so many splats."""
    return -(-counts // PAGE)


@dataclass(frozen=True)
class Filled:
    """Splats as they go into pages."""

    owner: np.ndarray  # (P,) the object of each page
    splats: LeafSplats  # (P PAGE,) rows, of opacity 0 where a page is not full


def fill_pages(part: LeafSplats, which: np.ndarray, owner: np.ndarray) -> Filled:
    """Pages of leaves which (n,) of a part, for the objects owner (n,), one after the other."""
    counts = part.counts[which]
    pages = pages_needed(counts)
    starts = (np.cumsum(part.counts) - part.counts)[which]
    row = np.arange(PAGE * pages.sum()) - np.repeat(PAGE * (np.cumsum(pages) - pages), PAGE * pages)
    there = row < np.repeat(counts, PAGE * pages)
    rows = np.where(there, row + np.repeat(starts, PAGE * pages), 0)

    def picked(array: np.ndarray) -> np.ndarray:
        return np.asarray(array, np.float32)[rows]

    opacity = np.where(there, picked(part.opacity), np.float32(0))
    splats = LeafSplats(
        part.leaves[which], part.levels[which], counts, picked(part.means), picked(part.scales),
        picked(part.wxyz), opacity, picked(part.sh),
    )  # fmt: skip
    return Filled(np.repeat(owner, pages), splats)


def together(parts: Sequence[Filled]) -> tuple[np.ndarray, LeafSplats]:
    """The owners of the pages of all parts, and their splats; of the most harmonics among them."""
    most = max(part.splats.sh.shape[1] for part in parts)

    def column(name: str) -> np.ndarray:
        return np.concatenate([getattr(part.splats, name) for part in parts])

    sh = [np.pad(p.splats.sh, ((0, 0), (0, most - p.splats.sh.shape[1]), (0, 0))) for p in parts]
    splats = LeafSplats(
        column("leaves"), column("levels"), column("counts"), column("means"), column("scales"),
        column("wxyz"), column("opacity"), np.concatenate(sh),
    )  # fmt: skip
    return np.concatenate([part.owner for part in parts]), splats


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
