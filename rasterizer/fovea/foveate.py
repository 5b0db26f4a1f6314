"""foveate: sharp where one looks, a quarter of the pixels elsewhere; the CPU form of drawing alone.

Projection, order and lists are those of the whole picture.  Tiles that lie wholly outside are drawn
at the corners that four pixels share, and the pixels between are made of these.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.fovea.fovea import Fovea
from shapeshift.rasterizer.project import Projected

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parents[1] / "kernels"


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
