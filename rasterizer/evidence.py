"""evidence: how much each splat shows of each label of pictures: sums of alpha T over pixels.

Object-Wise Decomposition, section 3.3: a splat's contribution to the pixels labelled as an object.
"""

from pathlib import Path

import numpy as np

from shapeshift.rasterizer.bin import Tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import TILE, Projected
from shapeshift.rasterizer.raster import MIN_TRANSMITTANCE

KERNELS = Path(__file__).parent / "kernels"
FORMS = {"cpu": (KERNELS / "evidence_cpu.cl", 1), "gpu": (KERNELS / "evidence_gpu.cl", 256)}
SILENT = 255  # of a label map: the pixel says nothing
LABELS_A_PASS = 16  # of a tile, as the kernels have it
STEPS = 1024  # of a pixel: what is less than half of one in every tile is not seen
LARGEST = 2**32 - 1  # of the table's numbers


class Evidence:
    """(rows, labels) sums over views of alpha T in pixels; any order of tiles leaves them equal."""

    def __init__(
        self,
        device: Device,
        splats: int,
        labels: int,
        each: int = 1,
        min_transmittance: float = MIN_TRANSMITTANCE,
    ) -> None:
        """labels: 0 to labels - 1 are summed.  each: splats a row, in a row: k of an anchor model.
        min_transmittance: a pixel with less left shows nothing more, as in drawing.

        Raises ValueError, and NoMemory where the table does not fit.
        """
        if not 1 <= labels <= SILENT:
            raise ValueError(f"{labels} labels are asked for; 1 to {SILENT} are summed")
        if each < 1 or splats % each:
            raise ValueError(f"{splats} splats are no whole number of rows of {each}")
        self._device, self._each, self._splats = device, each, splats
        self._stop = float(min_transmittance)
        self._table = device.zeros((splats // each, labels), np.uint32)
        self._sums: np.ndarray | None = None  # what the table had before it was emptied
        self._steps, self._most = STEPS, 0  # of the table; what no number of it is above

    def add(
        self, projected: Projected, tiles: Tiles, labels: np.ndarray, form: str | None = None
    ) -> None:
        """One view with its label map (H, W) uint8, SILENT where nothing is known.

        form: "cpu" or "gpu", by default the device's kind.  Raises ValueError.
        """
        grid, columns = tiles.grid, self._table.shape[1]
        if labels.dtype != np.uint8 or grid != (
            -(-labels.shape[1] // TILE),
            -(-len(labels) // TILE),
        ):
            raise ValueError(f"a label map of {labels.shape} {labels.dtype} is not of this view")
        if projected.record.shape[0] != self._splats:
            raise ValueError(f"{projected.record.shape[0]} splats are drawn, not {self._splats}")
        there = np.bincount(labels.ravel(), minlength=256)
        if there[columns:SILENT].any():
            wrong = columns + int(np.flatnonzero(there[columns:SILENT])[0])
            raise ValueError(f"a label map has the label {wrong}, the largest is {columns - 1}")
        self._make_room(labels.size, grid[0] * grid[1])
        on_device = self._device.upload(labels)
        file, group = FORMS[form or self._device.kind]
        kernel = self._device.program(file, STOP=self._stop, EACH=self._each)["evidence"]
        for first in range(0, most_in_a_tile(labels), LABELS_A_PASS):
            self._device.launch(
                kernel, grid[0] * grid[1] * group, group,
                labels.shape[1], labels.shape[0], grid[0], tiles.starts, tiles.intersections,
                projected.record, on_device, first, columns, float(self._steps),
                self._table,
            )  # fmt: skip

    def _make_room(self, pixels: int, tiles: int) -> None:
        """Empties the table before a view could make one of its 32 bits' numbers wrap.

        No row shows more than the whole picture, and each tile rounds each splat's share up by
        half a step at most.
        """

        def most(steps: int) -> int:
            return pixels * steps + tiles * self._each

        steps = STEPS
        while most(steps) > LARGEST:  # pictures of more than four million pixels
            steps //= 2
        if steps != self._steps or self._most + most(steps) > LARGEST:
            self._empty()
        self._steps, self._most = steps, self._most + most(steps)

    def _empty(self) -> None:
        self._sums = self.sums()
        self._device.clear(self._table)
        self._most = 0

    def sums(self) -> np.ndarray:
        """(rows, labels) float64 pixels, of all views so far."""
        now = self._device.download(self._table) / self._steps
        return now if self._sums is None else now + self._sums


def most_in_a_tile(labels: np.ndarray) -> int:
    """How many labels the tile with most of them has; SILENT counts, too: it may be one less."""
    if np.count_nonzero(np.bincount(labels.ravel())) <= LABELS_A_PASS:
        return LABELS_A_PASS
    height, width = (-(-side // TILE) * TILE for side in labels.shape)
    padded = np.full((height, width), SILENT, np.uint8)
    padded[: labels.shape[0], : labels.shape[1]] = labels
    tiles = padded.reshape(height // TILE, TILE, width // TILE, TILE).swapaxes(1, 2)
    ordered = np.sort(tiles.reshape(-1, TILE * TILE), axis=1)
    return int((np.diff(ordered, axis=1) != 0).sum(axis=1).max()) + 1
