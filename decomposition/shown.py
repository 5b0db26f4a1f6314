"""What a view shows of a model's anchors, inside masks and out of them, and pictures of values that
anchors have: the two ways between photos and the scene.
"""

import numpy as np

from shapeshift.rasterizer.bin import Tiles, bin_tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.evidence import Evidence
from shapeshift.rasterizer.pack import pack
from shapeshift.rasterizer.project import Camera, Projected
from shapeshift.rasterizer.project_arena import project_arena
from shapeshift.rasterizer.raster import rasterize_rgba
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel, SplatLayers, is_antialiased
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.pose import View

AT_ONCE = 7  # masks of one launch: each combination of them is a label, 127 at most


class ShownAnchors:
    """Of one model, in its own frame; what is computed for a control is kept for the next view."""

    def __init__(self, device: Device, model: AnchorModel | SplatLayers) -> None:
        self.device, self.model = device, model
        self.each = model.splats_per_anchor if isinstance(model, AnchorModel) else 1
        self.count = model.splat_count // self.each  # A: anchors, or splats of plain layers
        self._evaluator = Evaluator(model)
        self._x: Control | None = None  # what the arrays are of
        splats = model.splat_count
        self._means, self._covariance = device.zeros((splats, 4)), device.zeros((splats, 8))
        self._color, self._object = device.zeros((splats, 4)), device.zeros(splats, np.int32)
        self._antialiased = (True,) if is_antialiased(model) else ()
        self._projected: list[Projected] | None = None

    def masks(
        self, view: View, x: Control, masks: list[np.ndarray]
    ) -> tuple[list[np.ndarray], np.ndarray]:
        """For each mask (H, W) bool the pixels (A,) float64 that an anchor shows within it, and
        those that it shows at all: sums of alpha T (OWD section 3.3).
        """
        projected, tiles = self._tiles(view, x)
        inside: list[np.ndarray] = []
        shown = np.zeros(self.count)
        for first in range(0, max(len(masks), 1), AT_ONCE):
            here = masks[first : first + AT_ONCE]
            codes = np.zeros(view.size[::-1], np.uint8)
            for bit, mask in enumerate(here):
                codes |= mask.astype(np.uint8) << bit
            there, labels = np.unique(codes, return_inverse=True)
            evidence = Evidence(self.device, self.model.splat_count, len(there), self.each)
            evidence.add(projected, tiles, labels.reshape(codes.shape).astype(np.uint8))
            sums = evidence.sums()  # (A, labels)
            shown = sums.sum(1)
            for bit in range(len(here)):
                inside.append(sums[:, (there >> bit & 1).astype(bool)].sum(1))
        return inside, shown

    def picture(self, view: View, x: Control, values: np.ndarray) -> np.ndarray:
        """(H, W, 3) of values (A, 3) 0 to 1 of anchors, blended as colours are; over 0."""
        return self._drawn(view, x, np.repeat(values, self.each, axis=0))

    def look(self, view: View, x: Control) -> np.ndarray:
        """(H, W, 3) display sRGB: the model itself; over black."""
        eye = view.world_from_eye.position.astype(np.float32)
        return self._drawn(view, x, self._evaluator.color(x, eye))

    def places(self, view: View, x: Control, means: np.ndarray) -> np.ndarray:
        """(H, W, 3) metres: where what a pixel shows is, blended as colours are; NaN where less
        than half of it is covered.  means: (A, 3) metres of the anchors.
        """
        rgba = self._rgba(view, x, np.repeat(means, self.each, axis=0))
        shown = rgba[..., 3:]
        return np.where(shown > 0.5, rgba[..., :3] / np.maximum(shown, 0.5), np.nan)

    def _drawn(self, view: View, x: Control, values: np.ndarray) -> np.ndarray:
        return self._rgba(view, x, values)[..., :3].copy()

    def _rgba(self, view: View, x: Control, values: np.ndarray) -> np.ndarray:
        """(H, W, 4) of values (splats, 3); the device's own memory, until the next call."""
        color = np.zeros((self.model.splat_count, 4), np.float32)
        color[:, :3] = values
        self._color.set(color)
        projected, tiles = self._tiles(view, x)
        return rasterize_rgba(self.device, projected, tiles, view.size)

    def _tiles(self, view: View, x: Control) -> tuple[Projected, Tiles]:
        if self._projected is None or x != self._x:
            pack(self.device, self._evaluator.geometry(x), 0, self._means, self._covariance)
            self._x = x
        camera = Camera(*view.pinhole(), view.size, view.near, view.widest_tangents())
        self._projected = project_arena(
            self.device, self._means, self._covariance, self._color, self._object,
            np.eye(4)[None], [camera], into=self._projected, antialiased=self._antialiased,
        )  # fmt: skip
        projected = self._projected[0]
        return projected, bin_tiles(self.device, projected, view.size)
