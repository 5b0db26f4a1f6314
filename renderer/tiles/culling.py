"""When clusters of splats that no view sees are left out, and which splats need no colours for it.

Boxes are made once a scene has rested for some frames: while x moves they would be made anew each
time, and cost as much as they save.  Where hardly anything is out of view nobody is asked, for some
frames.  Either way the picture and its counts are the same to the bit.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.clusters.clusters import CLUSTER, Clusters, bound_clusters
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project_arena import clusters_unseen
from shapeshift.renderer.resample import scaled
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.tiles.inputs import camera_of, limits_of
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from pyopencl.array import Array

    from shapeshift.rasterizer.paging.pages import Arena

RESTS = 4  # frames with the same splats before boxes are made: these cost as one projection
LEAST_SPLATS = 1 << 16  # left out: to ask takes as long as to project a third of them
PAUSE = 8  # frames until it is asked again


class Culling:
    """The boxes of one arena, and whether they are used."""

    def __init__(self) -> None:
        self.allowed = True  # off: what tests and tools compare with
        self.left_out: int | None = None  # clusters of the last frame's last views; None: not asked
        self._clusters: Clusters | None = None
        self._rested = self._paused = 0

    def forget(self) -> None:
        """Splats moved, grew or faded."""
        self._clusters, self._rested, self._paused = None, 0, 0

    def boxes(self, min_alpha: float) -> Clusters | None:
        """The boxes, where they are true."""
        made = self._clusters if self.allowed else None
        return made if made is not None and made.min_alpha == min_alpha else None

    def in_use(self, min_alpha: float) -> Clusters | None:
        """The same where they were of use."""
        return None if self._paused else self.boxes(min_alpha)

    def next_frame(self, device: Device, arena: "Arena", least: float) -> None:
        """Once a frame; arena: mean_opacity, covariance, object_index, pages; least: alpha."""
        self._paused = max(0, self._paused - 1)
        if self._clusters is not None and self._clusters.min_alpha != least:
            self.forget()
        self._rested += 1
        due = self._clusters is None and self._rested > RESTS
        if due and arena[2].shape[0] >= LEAST_SPLATS:
            self._clusters = bound_clusters(device, *arena[:3], least, arena[3])

    def note(self, device: Device, unseen: "Array | None") -> None:
        """What a projection left out, (C,) as find_unseen.cl has it."""
        self.left_out = None
        if unseen is not None:
            self.left_out = int(np.count_nonzero(device.view(unseen)))
            if self.left_out * CLUSTER < LEAST_SPLATS:
                self._paused = PAUSE

    def seen_rows(
        self, device: Device, views: Sequence[View], settings: RenderSettings,
        world_from_objects: np.ndarray, rows: slice,
    ) -> np.ndarray | None:  # fmt: skip
        """(n,) bool: which of these rows of the arena the views may see; None: not asked."""
        clusters = self.in_use(settings.min_alpha)
        if clusters is None:
            return None
        cameras = [camera_of(scaled(view, settings.render_scale)) for view in views]
        unseen = clusters_unseen(device, clusters, cameras, limits_of(settings), world_from_objects)
        first, last = rows.start // CLUSTER, -(-rows.stop // CLUSTER)
        seen = np.repeat(~unseen[first:last], CLUSTER)
        return seen[rows.start - first * CLUSTER :][: rows.stop - rows.start]
