"""decode: models -> splats in the arena; geometry on control change, colour on view change."""

import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.colors.false_colors import Shade, has_heat
from shapeshift.renderer.colors.heat import Heater
from shapeshift.renderer.colors.palette import palette_colors
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, groups_for
from shapeshift.renderer.gl.layers import Layers
from shapeshift.renderer.gl.networks import GlBlocks, GlNetworks
from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.runtime_models.colors.color_memory import ColorMemory
from shapeshift.runtime_models.evaluate import Evaluator, only_fades
from shapeshift.runtime_models.model import AnchorModel, Model, SplatLayers
from shapeshift.runtime_models.stop_weights import Controls
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
        else:
            self._arena.clear_heat(i)

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
