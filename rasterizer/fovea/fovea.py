"""The part of a picture that is drawn sharp, since somebody looks at it."""

from dataclasses import dataclass

import numpy as np

from shapeshift.rasterizer.project import TILE

SHARP, COARSE, SEAM = 0, 1, 2  # kinds of tiles as draw_cpu.cl has them


@dataclass(frozen=True)
class Fovea:
    """An ellipse of a picture: where it is sharp, and where it is no longer."""

    centre: tuple[float, float]  # pixels, row 0 on top
    unit: tuple[float, float]  # of the radii, an x and a y pixel
    inner: float  # all pixels nearer than that are what they are without a fovea
    outer: float  # from there on there are only samples

    def kinds_of_tiles(self, size: tuple[int, int]) -> np.ndarray:
        """(rows, columns) uint8 of a picture's tiles: SHARP, COARSE or SEAM."""
        nearest, farthest = [], []
        for centre, unit, side in zip(self.centre, self.unit, size, strict=True):
            first = np.arange(0, side, TILE) + 0.5  # pixel centres
            last = np.minimum(first + TILE, side + 0.5) - 1
            nearest.append(unit * (np.clip(centre, first, last) - centre))
            # Samples of a pixel's neighbours are asked for, too.
            farthest.append(unit * (2 + np.maximum(abs(first - centre), abs(last - centre))))
        near, far = (np.hypot(x[None], y[:, None]) for x, y in (nearest, farthest))
        kinds = np.where(near >= self.outer, COARSE, np.where(far > self.inner, SEAM, SHARP))
        return kinds.astype(np.uint8)
