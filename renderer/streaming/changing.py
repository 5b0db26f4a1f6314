"""Parents that come where their children go, and the other way round: which nodes fade together."""

import numpy as np

from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.streaming.choose import NOT_DRAWN, downwards, upwards
from shapeshift.renderer.streaming.pages import PageTable
from shapeshift.runtime_models.splats.parents import NodeTree

NONE = np.zeros(0, np.int64)


def patient(
    tree: NodeTree | None, wanted: np.ndarray, level: np.ndarray, fading: np.ndarray
) -> np.ndarray:
    """(N,) wanted levels, but those that are there where a node, one above or one below fades: one
    change after the other.
    """
    if tree is None or not fading.any():
        return wanted
    return np.where(fading | related(tree, fading), level, wanted)


def swapped(
    tree: NodeTree | None, wanted: np.ndarray, level: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n,) that go because some above or below them come, and these (m,)."""
    gone, new = (
        (here == NOT_DRAWN) & (there != NOT_DRAWN)
        for here, there in ((wanted, level), (level, wanted))
    )
    if tree is None or not (gone.any() and new.any()):
        return NONE, NONE
    return np.flatnonzero(gone & related(tree, new)), np.flatnonzero(new & related(tree, gone))


def comes_finer(tree: NodeTree | None, level: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(N,) bool: a leaf at a finer level than before, a parent where its children come, a child
    where its parents go, and what comes alone.
    """
    new, gone = (
        (there != NOT_DRAWN) & (other == NOT_DRAWN)
        for there, other in ((level, before), (before, level))
    )
    if tree is not None:
        opened = gone & upwards(tree, np.logical_or, new)
        new = new & ~upwards(tree, np.logical_or, gone)  # a parent that comes is coarser
        return opened | new | ((level != NOT_DRAWN) & (level < before))
    return new | ((level != NOT_DRAWN) & (level < before))


def related(tree: NodeTree, nodes: np.ndarray) -> np.ndarray:
    """(N,) bool: above or below one of nodes (N,) bool, or one of them."""
    return upwards(tree, np.logical_or, nodes) | downwards(tree, np.logical_or, nodes)


# A leaf's old level goes as its new one comes: over some frames both are drawn, by parts.
#
# Parts add up to 1; what a part of a splat is, project_arena.cl says. A leaf that comes where
# none was, or goes and leaves nothing, fades against what is behind it.

# Of the finer level, frame by frame as it comes; what comes coarser is the rest, backwards.  A
# quarter of fine splats changes a picture by 2.7 times what its last quarter does: with these parts
# no step is much larger than another (docs/bench/switching.csv).
PARTS = (0.10, 0.33, 0.66)


class Fades:
    """The leaves of a page table whose level changes."""

    def __init__(self, drawing: Drawing, table: PageTable) -> None:
        self._drawing, self._table = drawing, table
        self._age = np.full(len(table.level), -1)  # frames that showed both; -1: one is there
        self._finer = np.zeros(len(table.level), bool)  # what comes, than what goes

    @property
    def leaves(self) -> np.ndarray:
        """(L,) bool: those that change."""
        return self._age >= 0

    def begin(self, leaves: np.ndarray, finer: np.ndarray) -> None:
        """Of leaves (n,) with new pages in the table, old ones that are leaving, or both; finer:
        (n,) bool, whether what comes is; of those that come alone it is, of those that go not.
        """
        if len(leaves):
            self._age[leaves], self._finer[leaves] = 0, finer
            self._weigh(leaves)

    def advance(self) -> np.ndarray:
        """The next frame; what was shown as often as there are PARTS is over: which leaves."""
        leaves = np.flatnonzero(self.leaves)
        self._age[leaves] += 1
        done = self._age[leaves] >= len(PARTS)
        self._weigh(leaves[~done])
        return self.end(leaves[done])

    def end(self, leaves: np.ndarray) -> np.ndarray:
        """The new levels alone, at once, of those of leaves (n,) that change; which these are."""
        leaves = leaves[self._age[leaves] >= 0]
        if len(leaves):
            self._age[leaves] = -1
            self._drawing.clear_pages(self._table.release(leaves))
            self._drawing.weigh_pages(self._table.pages_of(leaves), 1.0)
        return leaves

    def _weigh(self, leaves: np.ndarray) -> None:
        new = parts_of(self._age[leaves], self._finer[leaves])
        for part in np.unique(new):
            mine = leaves[new == part]
            self._drawing.weigh_pages(self._table.pages_of(mine), float(part))
            self._drawing.weigh_pages(self._table.leaving(mine), 1 - float(part))


def parts_of(age: np.ndarray, finer: np.ndarray) -> np.ndarray:
    """(n,) the part of what comes, after so many frames (n,)."""
    parts = np.array(PARTS)
    return np.where(finer, parts[age], 1 - parts[::-1][age])
