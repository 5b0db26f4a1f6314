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

    def draw(self, view: View, x: Controls) -> np.ndarray:
        """(H, W, 4) float32, premultiplied."""
        width, height = view.size
        if self._empty:
            return np.zeros((height, width, 4), np.float32)
        if self._x is None or x != self._x:
            columns = self._evaluator.geometry(x)
            self._geometry = [self._device.upload(np.asarray(c, np.float32)) for c in columns]
            self._x = x
        color = self._evaluator.color(x, np.asarray(view.world_from_eye.position, np.float32))
        means, scales, wxyz, opacity = self._geometry
        colors = self._device.upload(np.asarray(color, np.float32))
        camera = Camera(*view.pinhole(), view.size, view.near)
        projected = project(self._device, means, scales, wxyz, opacity, colors, camera)
        tiles = bin_tiles(self._device, projected, view.size)
        return rasterize_rgba(self._device, projected, tiles, view.size).copy()


def over(picture: np.ndarray, background: np.ndarray | tuple[float, float, float]) -> np.ndarray:
    """(H, W, 3) of a premultiplied picture (H, W, 4) before a colour."""
    return picture[..., :3] + (1 - picture[..., 3:]) * np.asarray(background, np.float32)
