"""seen: in how many pixels each leaf is seen, what hides it counted: a small coarse picture.

The coarsest levels of all leaves are drawn in a quarter of the pixels a side; a leaf's pixels are
the sums of alpha times transmittance of its splats.
"""

from collections.abc import Sequence

import numpy as np

from shapeshift.rasterizer.bin import bin_tiles, sort_order
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.evidence import Evidence
from shapeshift.rasterizer.pack import pack
from shapeshift.rasterizer.project_arena import Limits, SortFrames, project_arena
from shapeshift.renderer.streaming.sight import look_view
from shapeshift.renderer.tiles.inputs import camera_of
from shapeshift.runtime_models.model import SplatLayers, is_antialiased
from shapeshift.scene.pose import View

PART = 4  # of the picture's sides
MOST = 1 << 20  # splats of a look; objects beyond are taken by what their boxes cover


class CoarseLook:
    """The coarsest levels of a scene's leaves on an OpenCL device."""

    def __init__(self, device: Device, models: Sequence[SplatLayers], first: np.ndarray) -> None:
        """first: (O,) the number of the first leaf of each model, over all of them."""
        self._device = device
        ends = np.cumsum([model.splat_count for model in models])
        self.objects = int(np.searchsorted(ends, MOST, side="right"))  # that take part
        mine = models[: self.objects]
        self.leaves = int(first[self.objects])  # the first so many are theirs
        size = sum(model.splat_count for model in mine)
        self._mean_opacity, self._covariance = device.empty((size, 4)), device.empty((size, 8))
        self._color, start = device.zeros((size, 4)), 0
        leaf = np.zeros(size, np.int64)
        for model, before in zip(mine, first, strict=False):
            assert model.leaves is not None
            rows = (model.means, model.scales, model.wxyz, model.opacity)
            pack(device, rows, start, self._mean_opacity, self._covariance)
            leaf[start : start + model.splat_count] = before + model.leaves.coarse_leaf
            start += model.splat_count
        counts = [model.splat_count for model in mine]
        self._leaf = leaf
        self._index = device.upload(np.repeat(np.arange(len(mine), dtype=np.int32), counts))
        self._antialiased = tuple(map(is_antialiased, mine))

    def pixels(
        self, views: Sequence[View], world_from_objects: Sequence[np.ndarray], leaves: int
    ) -> np.ndarray:
        """(leaves,) pixels of the views that each leaf is seen in, and WIDER around them.

        A pose full of NaN hides its object.
        """
        if not len(self._leaf):
            return np.zeros(leaves)
        device, view = self._device, look_view(views, PART)
        camera = camera_of(view)
        (projected,) = project_arena(
            device, self._mean_opacity, self._covariance, self._color, self._index,
            np.array(world_from_objects[: self.objects]), [camera], Limits(),
            SortFrames((camera.camera_from_world,)), None, self._antialiased,
        )  # fmt: skip
        order = sort_order(device, projected.in_tiles)
        tiles = bin_tiles(device, projected, view.size, order=order)
        evidence = Evidence(device, len(self._leaf), 1)
        evidence.add(projected, tiles, np.zeros(view.size[::-1], np.uint8))
        return np.bincount(self._leaf, evidence.sums()[:, 0], leaves) * PART**2
