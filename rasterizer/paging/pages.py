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

KERNEL = Path(__file__).parents[1] / "kernels" / "paging" / "pages.cl"
PAGE = 32  # rows: the coarsest level of a leaf has 32 to 64 splats, and pages are not shared
GROUP = 64  # work-items


@dataclass(frozen=True)
class PageMap:
    """Which rows of an arena are drawn, a page after the other: one may be drawn for several
    objects.
    """

    sources: "Array"  # (pages,) int32: the arena's page; -1: nothing is drawn
    weights: "Array"  # (pages,) float32: of the optical depth of its splats; 1: all

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
