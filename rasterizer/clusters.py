"""clusters: boxes around rows of an arena that lie side by side; project_arena leaves out those
that no view sees, of which nothing is read then.

Boxes are true until means, covariances or opacities change; poses may change.  Where rows that
follow each other do not lie together (a file in no order of space), boxes are large and nothing is
gained.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.pages import PageMap, defines_of_pages

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels" / "clusters"
CLUSTER = 256  # rows; common/limits.cl has it, too
BOUNDS = 12  # floats of a cluster
GROUP = 64  # work-items
INFINITE = np.float32(np.inf).view(np.int32)


@dataclass(frozen=True)
class Occluders:
    """How deep in the order tiles are thought to be done, and what was left out behind them."""

    limits: tuple  # buffers, of each view (tiles,) float32 metres, inf: not at all
    nearest: "tuple[Array, ...]"  # of each view (tiles,) int32: see kernels/clusters/find_unseen.cl
    reached: "Array"  # (views, C, 4) int32 tiles: columns from and to, rows from and to
    hidden: "Array"  # (C,) int32: splats that are hidden, not out of view

    @classmethod
    def of(cls, device: Device, limits: list[np.ndarray], clusters: int) -> "Occluders":
        """limits: (tiles down, tiles across) of each view."""
        flat = [np.ravel(limit).astype(np.float32) for limit in limits]
        return cls(
            tuple(device.constants(limit) for limit in flat),
            tuple(device.zeros(len(limit), np.int32) for limit in flat),
            device.empty((len(limits), clusters, 4), np.int32),
            device.empty(clusters, np.int32),
        )

    def nearest_boxes(self, device: Device) -> list[np.ndarray]:
        """Of each view (tiles,) float32 metres in the order, inf where no box was left out."""
        return [
            (INFINITE - device.view(each).astype(np.int32)).view(np.float32)
            for each in self.nearest
        ]


@dataclass(frozen=True)
class Clusters:
    """Boxes of CLUSTER rows each, in the frame of their object."""

    bounds: "Array"  # (C, 12) float32: see kernels/clusters/bound_clusters.cl
    min_alpha: float  # fainter splats are in no box
    occluders: Occluders | None = None  # of one frame


@dataclass(frozen=True)
class Chosen:
    """Clusters that are projected once more, into arrays that hold the others."""

    unseen: "Array"  # (C,) int32 as find_unseen.cl has them: 0 for those that are projected


def clusters_of(count: int) -> int:
    """How many clusters so many rows are."""
    return -(-count // CLUSTER)


def bound_clusters(
    device: Device, mean_opacity: "Array", covariance: "Array", object_index: "Array",
    min_alpha: float, pages: PageMap | None = None,
) -> Clusters:  # fmt: skip
    """The boxes of an arena as project_arena takes it."""
    count = object_index.shape[0]
    bounds = device.empty((clusters_of(count), BOUNDS))
    kernel = device.program(KERNELS / "bound_clusters.cl", **defines_of_pages(pages))[
        "bound_clusters"
    ]
    arrays = (mean_opacity, covariance, object_index, pages and pages.sources, bounds)
    device.launch(kernel, clusters_of(count), 1, count, float(min_alpha), *arrays)
    return Clusters(bounds, float(min_alpha))


def find_unseen(
    device: Device, clusters: Clusters, views: int, orders: int, pose: int, frame,
    unseen: "Array", again: bool,
) -> None:  # fmt: skip
    """Fills unseen (C,) int32 with flags as kernels/clusters/find_unseen.cl has them.

    frame: that of project_arena, with so many views, orders and floats an object.  again: what is
    not 0 in `unseen` is true of the arrays that a projection will fill.
    """
    kernel = device.program(KERNELS / "find_unseen.cl")["find_unseen"]
    count, given = clusters.bounds.shape[0], clusters.occluders
    behind: tuple = (None,) * 6
    if given is not None:
        second = [each[-1] if views > 1 else None for each in (given.limits, given.nearest)]
        behind = (given.limits[0], second[0], given.nearest[0], second[1])
        behind += (given.reached, given.hidden)
    shared = (count, views, orders, pose, again, frame)
    device.launch(kernel, count, GROUP, *shared, clusters.bounds, unseen, *behind)
