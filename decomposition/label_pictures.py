"""What a labelled model shows of each label in a view: shares of pixels, and label maps."""

from collections.abc import Iterator, Sequence

import numpy as np

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.pack import pack
from shapeshift.rasterizer.project import Camera
from shapeshift.rasterizer.project_arena import project_arena
from shapeshift.rasterizer.raster import rasterize_rgba
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import MOST_LABEL, Model, is_antialiased
from shapeshift.runtime_models.parts import BACKGROUND, splat_labels
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.pose import View

CHANNELS = 3  # labels that one drawing tells apart: as red, green and blue


class LabelPictures:
    """Drawings of one labelled model in which each label is a colour of its own."""

    def __init__(self, device: Device, model: Model, labels: np.ndarray | None = None) -> None:
        """labels: (N,) of the splats, instead of the model's own."""
        self._device, self._model = device, model
        found = splat_labels(model) if labels is None else labels
        if found is None:
            raise ValueError("the model has no labels")
        if len(found) and not 0 <= found.min() <= found.max() <= MOST_LABEL:
            raise ValueError(f"the model has the label {found.max()}, the largest is {MOST_LABEL}")
        self._labels, count = found, model.splat_count
        self._evaluator = Evaluator(model)
        self._x: tuple[Controls] | None = None
        self._means, self._covariance = device.zeros((count, 4)), device.zeros((count, 8))
        self._object = device.zeros(count, np.int32)
        self._antialiased = (True,) if is_antialiased(model) else ()

    def shares(self, view: View, x: Controls, labels: Sequence[int]) -> np.ndarray:
        """(labels, H, W) float32: the part of each pixel that splats of each label show.

        What shows through all of them is missing: it belongs to nothing.
        """
        groups = list(self._groups(view, x, labels))
        return np.concatenate([shown for _, shown in groups])

    def label_map(self, view: View, x: Controls) -> np.ndarray:
        """(H, W) uint8: the label that shows most; what shows through counts as the background."""
        objects = [int(label) for label in np.unique(self._labels) if label != BACKGROUND]
        rest = np.ones(view.size[::-1], np.float32)  # what no object shows
        most = np.zeros_like(rest)
        out = np.zeros(rest.shape, np.uint8)
        for there, shown in self._groups(view, x, objects):
            for label, share in zip(there, shown, strict=True):
                better = share > most
                out[better], most[better] = label, share[better]
                rest -= share
        out[rest >= most] = BACKGROUND
        return out

    def _groups(
        self, view: View, x: Controls, labels: Sequence[int]
    ) -> Iterator[tuple[Sequence[int], np.ndarray]]:
        """A few labels after the others, and their shares (n, H, W)."""
        if self._x is None or x != self._x[0]:
            pack(self._device, self._evaluator.geometry(x), 0, self._means, self._covariance)
            self._x = (x,)
        camera = Camera(*view.pinhole(), view.size, view.near, view.widest_tangents())
        tiles = None
        for first in range(0, len(labels), CHANNELS):
            there = labels[first : first + CHANNELS]
            color = np.zeros((len(self._labels), 4), np.float32)
            color[:, : len(there)] = self._labels[:, None] == np.asarray(there)
            projected = project_arena(
                self._device, self._means, self._covariance, self._device.upload(color),
                self._object, np.eye(4)[None], [camera], antialiased=self._antialiased,
            )[0]  # fmt: skip
            tiles = tiles or bin_tiles(self._device, projected, view.size)
            rgba = rasterize_rgba(self._device, projected, tiles, view.size)
            yield there, np.moveaxis(rgba[..., : len(there)], 2, 0).copy()
