"""SplatLayers on the GPU: opacity weighed by x, harmonics to colour; no CPU work a view."""

import moderngl
import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, groups_for, overwrite
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.stop_weights import Controls, is_each

SH_ALIGN = 64  # splats; keeps parts of the coefficients to whole work groups


class Layers:
    """One model's coefficients, opacities and layers; the rest lies in the arena."""

    def __init__(self, gpu: Gpu, model: SplatLayers) -> None:
        self._gpu, self._model = gpu, model
        self._weigh = gpu.compute("weigh.comp", OWN_CONTROL=0)
        self._own_weights: moderngl.Buffer | None = None  # (N,), made when splats differ in x
        self._shade = gpu.compute("colors/shade_sh.comp")
        count, coefficients, _ = model.sh.shape
        self._coefficients = coefficients
        self._opacity = gpu.upload(np.asarray(model.opacity, np.float32))
        self._layer = gpu.upload(np.asarray(model.layer, np.uint32))
        self._weights = gpu.reserve(4 * len(model.stops))
        # Coefficients of many splats pass the driver's block limit: in parts, each (M * 3, n), so
        # that neighbouring invocations read neighbouring floats.
        fit = max(gpu.max_block // (12 * coefficients) // SH_ALIGN * SH_ALIGN, SH_ALIGN)
        self._parts = []  # (first splat, splats, buffer)
        for first in range(0, count, fit):
            rows = np.asarray(model.sh[first : first + fit], np.float32)
            buffer = gpu.upload(rows.reshape(len(rows), -1).T, "spherical harmonics")
            self._parts.append((first, len(rows), buffer))

    def upload(self, arena: Arena, i: int) -> None:
        """Means and covariances of object i, which never change."""
        model = self._model
        arena.write_geometry(i, model.means, model.scales, model.wxyz, model.opacity)

    def geometry(self, arena: Arena, start: int, x: Controls) -> None:
        """Opacities of the layers that there are at x, or at (N,) one a splat -> rows start..."""
        model = self._model
        program, weights = self._weigh, self._weights
        if not is_each(x):
            overwrite(weights, model.weights(x))
        else:
            program = self._gpu.compute("weigh.comp", OWN_CONTROL=1)
            if self._own_weights is None:
                self._own_weights = self._gpu.reserve(4 * model.splat_count, "weights")
            weights = self._own_weights
            overwrite(weights, model.weights(x)[model.layer, np.arange(model.splat_count)])
        bind(mean_opacity=arena.mean_opacity, layer=self._layer)
        bind(layer_weights=weights, own_opacity=self._opacity)
        groups = groups_for(model.splat_count, layout.WORKGROUP)
        self._gpu.run(program, groups, count=model.splat_count, start=start)

    def color(self, arena: Arena, start: int, eye: np.ndarray) -> None:
        """Colours towards an eye (3,) in the object's frame -> rows start... of the arena."""
        self._shade["eye"].value = tuple(float(v) for v in eye)
        bind(mean_opacity=arena.mean_opacity, color=arena.color)
        for first, count, coefficients in self._parts:
            bind(sh=coefficients)
            self._gpu.run(
                self._shade, groups_for(count, layout.WORKGROUP),
                count=count, start=start + first, coefficients=self._coefficients,
            )  # fmt: skip

    def release(self) -> None:
        for buffer in (self._opacity, self._layer, self._weights, self._own_weights):
            if buffer is not None:
                buffer.release()
        for _, _, buffer in self._parts:
            buffer.release()
