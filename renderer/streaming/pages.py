"""Which leaf lies in which pages of the arena, at which level."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.rasterizer.paging.pages import PAGE
from shapeshift.renderer.streaming.choose import NOT_DRAWN
from shapeshift.runtime_models.leaf_levels import LeafSplats

ROOM = 1.25  # rows over the budget's splats: pages are not shared, so the last one is not full


class PageTable:
    """Pages that are free, and what the others hold."""

    def __init__(self, pages: int, leaves: int) -> None:
        self.leaf_of = np.full(pages, -1, np.int64)  # of each page; -1: it is free
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

    def reserve(self, leaves: np.ndarray, levels: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """Pages for so many splats of each leaf (n,), one leaf after the other.

        ValueError where there are not as many free.
        """
        needed = -(-counts // PAGE)
        free = np.flatnonzero(self.leaf_of < 0)
        if not needed.sum() <= len(free):
            raise ValueError(f"{needed.sum()} pages are wanted, {len(free)} are free.")
        pages = free[: needed.sum()]
        self.leaf_of[pages] = np.repeat(leaves, needed)
        self.level[leaves], self.splats[leaves] = levels, counts
        return pages

    def pages_of(self, leaves: np.ndarray) -> np.ndarray:
        """All pages of leaves (n,), one leaf after the other, in the order of their splats."""
        order = np.argsort(self.leaf_of, kind="stable")
        of = self.leaf_of[order]
        first, last = np.searchsorted(of, leaves, "left"), np.searchsorted(of, leaves, "right")
        counts = last - first
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        return order[np.repeat(first, counts) + within]

    @property
    def room(self) -> int:
        """Pages that are free."""
        return int(np.count_nonzero(self.leaf_of < 0))


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
