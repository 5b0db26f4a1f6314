"""foveate: sharp where one looks, a quarter of the pixels elsewhere; the CPU form of drawing alone.

Projection, order and lists are those of the whole picture.  Tiles that lie wholly outside are drawn
at the corners that four pixels share, and the pixels between are made of these.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import TILE, Projected

if TYPE_CHECKING:
    from pyopencl.array import Array


# The part of a picture that is drawn sharp, since somebody looks at it.

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


KERNELS = Path(__file__).parent / "kernels"


def rasterize_foveated(
    device: Device,
    views: list[tuple[Projected, Tiles]],
    heats: "list[Array]",
    size: tuple[int, int],
    foveas: list[Fovea],
    min_transmittance: float,
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """What rasterize_with_heat gives in its CPU form, sharp within the foveas, one a view."""
    width, height = size
    half = ((height + 1) // 2, (width + 1) // 2)
    pictures = [(device.empty((height, width, 4)), device.empty((*half, 4))) for _ in views]
    hot = [(device.empty((height, width, 2)), device.empty((*half, 2))) for _ in heats]
    inputs: list[list] = []
    for i, (projected, tiles) in enumerate(views):
        image, halved = pictures[i]
        given = [tiles.starts, tiles.intersections, projected.record, image, None, None]
        beside = [heats[i], hot[i][0]] if heats else []
        kinds = device.constants(foveas[i].kinds_of_tiles(size))
        inputs.append([*given, *beside, kinds, halved, *([hot[i][1]] if heats else [])])
    defines = {"FOVEATED": 1} | ({"HEAT": 1} if heats else {})
    kernel = device.program(KERNELS / "draw_cpu.cl", **defines)["draw"]
    for first in range(0, len(views), 2):
        across, down = views[first][1].grid
        left, right = [*inputs[first : first + 2], [None] * len(inputs[first])][:2]
        least = float(min_transmittance)
        device.launch(kernel, across * down, 1, *size, across, least, *left, *right)
    for channels, pairs in ((4, pictures), (2, hot)):
        for (image, halved), fovea in zip(pairs, foveas, strict=False):
            fill = device.program(KERNELS / "fovea" / "foveate.cl", CHANNELS=channels)["foveate"]
            where = (*fovea.centre, *fovea.unit, fovea.inner, fovea.outer)
            device.launch(fill, (height + 1) // 2, 1, *size, *map(float, where), halved, image)
    return [device.view(image) for image, _ in pictures], [device.view(image) for image, _ in hot]
