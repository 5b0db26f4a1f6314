"""Pictures of a model with the OpenCL tiles, one view after the other."""

import numpy as np

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import Camera, project
from shapeshift.rasterizer.raster import rasterize_rgba
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.pose import View


class ModelPictures:
    """Draws a model that stays as it is; pictures of one x in a row are quicker."""

    def __init__(self, device: Device, model: AnchorModel) -> None:
        self._device, self._evaluator = device, Evaluator(model)
        self._empty = model.splat_count == 0
        self._x: Controls | None = None
        self._geometry: list = []
        self._means = np.zeros((0, 3))  # (N, 3) metres

    def draw(self, view: View, x: Controls) -> np.ndarray:
        """(H, W, 4) float32, premultiplied."""
        if self._empty:
            width, height = view.size
            return np.zeros((height, width, 4), np.float32)
        self._decode(x)
        eye = np.asarray(view.world_from_eye.position, np.float32)
        return self._rasterize(view, self._evaluator.color(x, eye))

    def heights(self, view: View, x: Controls, normal: np.ndarray, offset: float) -> np.ndarray:
        """(H, W) metres above the plane normal . p = offset of the splats seen, by their share.

        NaN where nothing is seen.
        """
        width, height = view.size
        if self._empty:
            return np.full((height, width), np.nan)
        self._decode(x)
        above = self._means @ normal - offset  # drawn as a colour: shares are the picture's own
        color = np.zeros((len(above), 3), np.float32)
        color[:, 0] = above
        picture = self._rasterize(view, color).astype(np.float64)
        seen = picture[..., 3] > 0
        return np.where(seen, picture[..., 0] / np.where(seen, picture[..., 3], 1), np.nan)

    def _decode(self, x: Controls) -> None:
        """Geometry at x, kept on the device."""
        if self._x is None or x != self._x:
            columns = self._evaluator.geometry(x)
            self._means = np.asarray(columns[0], np.float64)
            self._geometry = [self._device.upload(np.asarray(c, np.float32)) for c in columns]
            self._x = x

    def _rasterize(self, view: View, color: np.ndarray) -> np.ndarray:
        """(H, W, 4) with these colours (N, 3)."""
        means, scales, wxyz, opacity = self._geometry
        colors = self._device.upload(np.asarray(color, np.float32))
        camera = Camera(*view.pinhole(), view.size, view.near)
        projected = project(self._device, means, scales, wxyz, opacity, colors, camera)
        tiles = bin_tiles(self._device, projected, view.size)
        return rasterize_rgba(self._device, projected, tiles, view.size).copy()


def over(picture: np.ndarray, background: np.ndarray | tuple[float, float, float]) -> np.ndarray:
    """(H, W, 3) of a premultiplied picture (H, W, 4) before a colour."""
    return picture[..., :3] + (1 - picture[..., 3:]) * np.asarray(background, np.float32)
