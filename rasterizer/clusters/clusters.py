"""clusters: boxes around rows of an arena that lie side by side; project_arena leaves out those
that no view sees, of which nothing is read then.

Boxes are true until means, covariances or opacities change; poses may change.  Where rows that
follow each other do not lie together (a file in no order of space), boxes are large and nothing is
gained.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.paging.pages import PageMap, defines_of_pages

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parents[1] / "kernels" / "clusters"
CLUSTER = 256  # rows; common/limits.cl has it, too
BOUNDS = 12  # floats of a cluster
GROUP = 64  # work-items


@dataclass(frozen=True)
class Clusters:
    """Boxes of CLUSTER rows each, in the frame of their object."""

    bounds: "Array"  # (C, 12) float32: see kernels/clusters/bound_clusters.cl
    min_alpha: float  # fainter splats are in no box


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
    device: Device, clusters: Clusters, views: int, pose: int, frame, unseen: "Array", again: bool
) -> None:
    """Fills unseen (C,) int32 with flags as kernels/clusters/find_unseen.cl has them.

    frame: that of project_arena, with so many views and floats an object.  again: what is not 0 in
    `unseen` is true of the arrays that a projection will fill.
    """
    kernel = device.program(KERNELS / "find_unseen.cl")["find_unseen"]
    count = clusters.bounds.shape[0]
    device.launch(kernel, count, GROUP, count, views, pose, again, frame, clusters.bounds, unseen)
