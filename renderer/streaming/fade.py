"""A leaf's old level goes as its new one comes: over some frames both are drawn, by parts.

Parts add up to 1; what a part of a splat is, project_arena.cl says.
"""

import numpy as np

from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.streaming.pages import PageTable

FRAMES = 3  # that show both levels: the new one is there alone in the frame after them


class Fades:
    """The leaves of a page table whose level changes."""

    def __init__(self, drawing: Drawing, table: PageTable) -> None:
        self._drawing, self._table = drawing, table
        self._age = np.full(len(table.level), -1)  # frames that showed both; -1: one is there

    @property
    def leaves(self) -> np.ndarray:
        """(L,) bool: those that change."""
        return self._age >= 0

    def begin(self, leaves: np.ndarray) -> None:
        """Of leaves (n,) with new pages in the table, and old ones that are leaving."""
        if len(leaves):
            self._age[leaves] = 0
            self._weigh(leaves)

    def advance(self) -> np.ndarray:
        """The next frame; what was shown FRAMES times is over: which leaves."""
        leaves = np.flatnonzero(self.leaves)
        self._age[leaves] += 1
        done = self._age[leaves] >= FRAMES
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
        for age in np.unique(self._age[leaves]):
            part = (age + 1) / (FRAMES + 1)
            mine = leaves[self._age[leaves] == age]
            self._drawing.weigh_pages(self._table.pages_of(mine), part)
            self._drawing.weigh_pages(self._table.leaving(mine), 1 - part)
