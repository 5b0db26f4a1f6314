"""drawn pages: which splats each page of a frame shows, for which object, how much of them."""

import numpy as np

GROWTH = 1.5  # times the pages that are stored, where there are too few


class DrawnPages:
    """The books of pages that come and go: of what lies in a device's memory they know no more.

    Splats lie in stored pages; a page that is drawn shows one of these, for one object.  Copies of
    an object draw the same stored pages, until one of them is changed.
    """

    def __init__(self, pages: int, stored: int) -> None:
        self.pages = pages
        self.owner = np.full(pages, -1, np.int32)  # object of each page that is drawn; -1: none
        self.stored = np.full(pages, -1)  # where its splats are
        self.weight = np.ones(pages, np.float32)  # the part of each that is drawn
        self.uses = np.zeros(stored, int)  # of each stored page: how many are drawn from it
        self.changes = 0  # how often what is drawn has changed

    def lacking(self, count: int) -> int:
        """Stored pages to grow to where `count` more are wanted; 0: there are enough."""
        used = int(np.count_nonzero(self.uses))
        if used + count <= len(self.uses):
            return 0
        return max(used + count, min(int(GROWTH * len(self.uses)), self.pages))

    def grow(self, stored: int) -> None:
        """To so many stored pages."""
        self.uses = np.pad(self.uses, (0, stored - len(self.uses)))

    def free(self, count: int) -> np.ndarray:
        """(count,) stored pages that nothing is drawn from, rising."""
        return np.flatnonzero(self.uses == 0)[:count]

    def draw(self, pages: np.ndarray, owner: np.ndarray, stored: np.ndarray) -> None:
        """Pages (n,), of which nothing was drawn, show stored ones (n,) for objects (n,)."""
        self.owner[pages], self.stored[pages], self.weight[pages] = owner, stored, 1
        np.add.at(self.uses, stored, 1)
        self.changes += 1

    def clear(self, pages: np.ndarray) -> None:
        """Nothing is drawn in these pages (n,)."""
        there = self.stored[pages]
        np.subtract.at(self.uses, there[there >= 0], 1)
        self.owner[pages] = self.stored[pages] = -1
        self.changes += 1

    def weigh(self, pages: np.ndarray, weight: float) -> None:
        """Pages (n,) are drawn as a part of themselves, until they are cleared."""
        self.weight[pages] = weight
        self.changes += 1

    def shared(self, i: int) -> np.ndarray:
        """The pages of object i whose splats others draw as well."""
        pages = self.pages_of(i)
        return pages[self.uses[self.stored[pages]] > 1]

    def part(self, pages: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pages (n,) show free stored ones from now on; which they showed, and which they do."""
        before, stored = self.stored[pages], self.free(len(pages))
        np.subtract.at(self.uses, before, 1)
        self.stored[pages], self.uses[stored] = stored, 1
        self.changes += 1
        return before, stored

    def pages_of(self, i: int) -> np.ndarray:
        """The pages that are drawn of object i, rising."""
        return np.flatnonzero(self.owner == i)
