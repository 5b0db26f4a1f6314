"""decode: models -> splats in the arena; geometry on control change, colour on view change."""

import moderngl
import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.colors.false_colors import Shade, has_heat
from shapeshift.renderer.colors.palette import palette_colors
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, groups_for, overwrite
from shapeshift.renderer.gl.networks import GlBlocks, GlNetworks
from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.runtime_models.colors.color_memory import ColorMemory
from shapeshift.runtime_models.evaluate import Evaluator, only_fades
from shapeshift.runtime_models.model import AnchorModel, Model, SplatLayers
from shapeshift.runtime_models.stop_weights import Controls, is_each
from shapeshift.scene.appearance import Appearance

MLPS = ("gl", "onnxruntime")


class Decoder:
    """Decodes the objects of one arena.  Objects with the same model share what lies on the GPU.

    mlps "gl": networks run in compute passes; "onnxruntime": on the CPU, then uploaded (ten times
    faster where GL is software).  Either way GL decodes plain splats, and the CPU
    models that follow the eye.
    """

    def __init__(self, gpu: Gpu, arena: Arena, models: list[Model], mlps: str = "gl") -> None:
        if mlps not in MLPS:
            raise ValueError(f"there are no networks by {mlps!r}; choose {' or '.join(MLPS)}.")
        self._gpu, self._arena = gpu, arena
        # Its programs compile now, not in the first frame between a value stop and another.
        self._heater = Heater(gpu) if any(map(has_heat, models)) else None
        made: dict[int, Layers | GlNetworks | GlBlocks | Evaluator] = {}
        for model in models:
            if id(model) in made:
                continue
            if isinstance(model, SplatLayers) and only_fades(model) and model.leaves is None:
                made[id(model)] = Layers(gpu, model)
            elif mlps == "gl" and isinstance(model, BlockModel):
                made[id(model)] = GlBlocks(gpu, model)
            elif mlps == "gl" and isinstance(model, AnchorModel):
                made[id(model)] = GlNetworks(gpu, model)
            else:
                made[id(model)] = Evaluator(model, keep=True)
        self._models = [made[id(model)] for model in models]
        self._colors = {  # of what onnxruntime decodes
            i: ColorMemory(model) for i, model in enumerate(self._models)
            if isinstance(model, Evaluator)
        }  # fmt: skip
        for i, on_gpu in enumerate(self._models):
            if isinstance(on_gpu, Layers):
                on_gpu.upload(arena, i)

    def geometry(
        self,
        i: int,
        x: Controls,
        eye: np.ndarray | None = None,
        seen: np.ndarray | None = None,
    ) -> None:
        """Means, covariances and opacities of object i at control value x; (A,): one an anchor.

        eye: (3,) in the object's frame, and seen (A,), which anchors are there, for a model that
        follows it.
        """
        model, arena = self._models[i], self._arena
        if isinstance(model, Evaluator):
            arena.write_geometry(i, *model.geometry(x, unit=False, eye=eye, seen=seen))
        else:
            model.geometry(arena, arena.starts[i], x)

    def shade(
        self,
        i: int,
        shade: Shade,
        eye: np.ndarray,
        seen: np.ndarray | None = None,
        at_once: bool = False,
        grade: Appearance | None = None,
    ) -> None:
        """Colours of object i towards an eye (3,) in the object's frame, and what of them is heat;
        after geometry.

        seen: (A,) bool; the rest may keep what it has (compute passes colour all at once).
        at_once: the heat becomes colours of its palettes here.  grade: of what is not heat.
        """
        heater = self._heater
        for number, heat in enumerate(shade.heats):
            self.color(i, heat.control, eye, seen, number + 1)
            palette = palette_colors(heat.palette) if at_once else None
            assert heater is not None, "a model with such a stop has made it"
            heater.add(self._arena, i, heat.weights, palette, number == 0)
        layers = isinstance(self._models[i], Layers)
        if shade.rest is not None and not (shade.heats and layers):
            self.color(i, shade.rest, eye, seen)
        if grade is not None and shade.rest is not None:
            self._grade(i, grade)
        if i in self._colors:
            self._colors[i].forget_after(self._arena.set, len(shade.heats))
        if heater is not None and shade.heats:
            heater.blend(self._arena, i, at_once)
        elif heater is not None and self._arena.heated(i):
            heater.clear(self._arena, i)

    def _grade(self, i: int, grade: Appearance) -> None:
        """The appearance of colours that were just decoded."""
        arena, program = self._arena, self._gpu.compute("colors/grade.comp")
        rows = arena.starts[i + 1] - arena.starts[i]
        if rows:
            bind(color=arena.color)
            self._gpu.run(
                program, groups_for(rows, layout.WORKGROUP), count=rows, start=arena.starts[i],
                gain=tuple(grade.gain), power=grade.power,
            )  # fmt: skip

    def color(
        self,
        i: int,
        x: Controls,
        eye: np.ndarray,
        seen: np.ndarray | None = None,
        part: int = 0,
    ) -> None:
        """Colours of object i as they are decoded at x; part: which of several that are mixed."""
        model, arena = self._models[i], self._arena
        if isinstance(model, Evaluator):
            arena.write_color(i, self._colors[i].at((arena.set, part), x, eye, seen))
        elif isinstance(model, Layers):
            model.color(arena, arena.starts[i], eye)
        else:
            model.color(arena, arena.starts[i], x, eye)

    def release(self) -> None:
        for model in self._models:
            if not isinstance(model, Evaluator):
                model.release()
        if self._heater is not None:
            self._heater.release()
        self._models.clear()
        self._colors.clear()

    def __enter__(self) -> "Decoder":
        return self

    def __exit__(self, *failure) -> None:
        self.release()


# SplatLayers on the GPU: opacity weighed by x, harmonics to colour; no CPU work a view.

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


# heat: what value stops have in the colours of splats, apart from what the other stops have.


class Heater:
    """The two passes and their buffers; made when the first object is between two such stops."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._add, self._blend = (gpu.compute("colors/heat.comp", BLEND=blend) for blend in (0, 1))
        self._palette = gpu.reserve(16 * 256, "palette")
        self._weights: moderngl.Buffer | None = None

    def add(
        self,
        arena: Arena,
        i: int,
        weights: np.ndarray,
        palette: np.ndarray | None = None,
        first: bool = True,
    ) -> None:
        """Heat of object i from its colours, just decoded at a value stop.

        weights (n,) 0..1, one for as many splats side by side each; palette (256, 3): colours
        instead of values; first: what is there is of no use, else it is added to.
        """
        rows = arena.starts[i + 1] - arena.starts[i]
        if not rows:
            return
        weights = np.ascontiguousarray(weights, np.float32)
        if self._weights is None or self._weights.size < weights.nbytes:
            if self._weights is not None:
                self._weights.release()
            self._weights = self._gpu.reserve(weights.nbytes, "weights of a value stop")
        overwrite(self._weights, weights)
        if palette is not None:
            overwrite(self._palette, np.pad(np.float32(palette), ((0, 0), (0, 1))))
        bind(color=arena.color, heat=arena.heat, palette=self._palette, tint=self._weights)
        self._add["first"].value, self._add["colored"].value = first, palette is not None
        self._gpu.run(
            self._add, groups_for(rows, layout.WORKGROUP),
            count=rows, start=arena.starts[i], per_weight=-(-rows // len(weights)),
        )  # fmt: skip
        arena.note_heat(i, True)

    def clear(self, arena: Arena, i: int) -> None:
        """Object i has no heat any more: anything times 0, and nothing that was there."""
        self.add(arena, i, np.zeros(1, np.float32))
        arena.note_heat(i, False)

    def blend(self, arena: Arena, i: int, into_color: bool = False) -> None:
        """Leaves of the colours of object i, just decoded, what its heat does not take.

        into_color: adds the heat's own colours, made with palettes, and takes the heat away.
        """
        rows = arena.starts[i + 1] - arena.starts[i]
        if not rows:
            return
        bind(color=arena.color, heat=arena.heat)
        self._blend["into_color"].value = into_color
        groups = groups_for(rows, layout.WORKGROUP)
        self._gpu.run(self._blend, groups, count=rows, start=arena.starts[i])

    def release(self) -> None:
        for buffer in (self._palette, self._weights):
            if buffer is not None:
                buffer.release()
