"""Views of one size, projected and put into lists, as pictures in memory."""

import logging
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.bin import Tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.fovea.foveate import rasterize_foveated
from shapeshift.rasterizer.heat import compile_heat
from shapeshift.rasterizer.project import Projected
from shapeshift.rasterizer.raster import compile_with_heat, rasterize_with_heat
from shapeshift.renderer.colors.false_colors import has_heat
from shapeshift.renderer.foveation import foveas_of
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import Model
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from pyopencl.array import Array


def blend_views(
    device: Device, drawn: "list[tuple[Projected, Tiles]]", heats: "list[Array]",
    views: Sequence[View], settings: RenderSettings,
) -> tuple[list[np.ndarray], list[np.ndarray]]:  # fmt: skip
    """(H, W, 4) of each view, and (H, W, 2) of its heat where any is given."""
    size, least = views[0].size, settings.min_transmittance
    foveas = foveas_of(views, settings)
    if foveas and device.kind == "gpu":
        say_whole()
    elif foveas:
        return rasterize_foveated(device, drawn, heats, size, foveas, least)
    return rasterize_with_heat(device, drawn, heats, size, min_transmittance=least)


@cache
def say_whole() -> None:
    """Once."""
    logging.getLogger("renderer").warning(
        "tiles on an OpenCL GPU are drawn in all pixels, whatever foveation says; quads follow it."
    )


class HeatAhead:
    """Compiles what the first frame with heat would, with the second frame of a set of models.

    Not with the first, which is there 0.4 s sooner where no kernel was ever compiled.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._counts: set[int] = set()  # splats of those models that have heat

    def open(self, models: list[Model]) -> None:
        """Another set of models."""
        self._frames = 0
        self._counts = {m.splat_count for m in models if m.splat_count and has_heat(m)}

    def next_frame(self, device: Device) -> None:
        self._frames += 1
        if self._frames == 2 and self._counts:
            for count in {min(self._counts), max(self._counts)}:
                compile_heat(device, count)
            compile_with_heat(device, min_transmittance=RenderSettings().min_transmittance)
