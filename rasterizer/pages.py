"""pages: rows of the arena that come and go in pages, each anywhere."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from shapeshift.rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

    # mean_opacity (N, 4), covariance (N, 8), object_index (rows drawn,) and where these lie.
    Arena: TypeAlias = "tuple[Array, Array, Array, PageMap | None]"

KERNEL = Path(__file__).parent / "kernels" / "paging" / "pages.cl"
PAGE = 32  # rows: the coarsest level of a leaf has 32 to 64 splats, and pages are not shared
GROUP = 64  # work-items


@dataclass(frozen=True)
class PageMap:
    """Which rows of an arena are drawn, a page after the other: one may be drawn for several
    objects.
    """

    sources: "Array"  # (pages,) int32: the arena's page; -1: nothing is drawn
    weights: "Array"  # (pages,) float32: the part of its splats that is drawn; 1: all

    @property
    def arrays(self) -> tuple["Array", "Array"]:
        return self.sources, self.weights


def defines_of_pages(pages: PageMap | None) -> dict[str, int]:
    """What kernels that read an arena are built with."""
    return {"PAGED": 1, "PAGE": PAGE} if pages else {}


def scatter_pages(device: Device, given: "Array", pages: np.ndarray, array: "Array") -> None:
    """Writes rows given (n PAGE, w) to the pages (n,) of an array (N, w), of 32-bit numbers.

    Widths are those of PAGE rows: an array of blocks of eight rows, as shade_sh reads it, too.
    """
    _copy(device, "scatter_pages", pages, given, array, given.size)


def gather_pages(device: Device, array: "Array", pages: np.ndarray, out: "Array") -> None:
    """Reads the pages (n,) of an array (N, w) into out (n PAGE, w)."""
    _copy(device, "gather_pages", pages, array, out, out.size)


def _copy(
    device: Device, kernel: str, pages: np.ndarray, source: "Array", into: "Array", count: int
) -> None:
    if len(pages):
        where = device.constants(np.asarray(pages, np.int32))
        device.launch(
            device.program(KERNEL)[kernel], count, GROUP,
            count, count // len(pages), where, source, into,
        )  # fmt: skip


# drawn pages: which splats each page of a frame shows, for which object, how much of them.

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
