"""decode: models -> splats in the arena; geometry on control change, colour on view change."""

import numpy as np

from renderer.buffers import Arena
from renderer.gpu import Gpu
from renderer.layers import Layers
from renderer.networks import Networks
from runtime_models.evaluate import Evaluator, follows_eye
from runtime_models.model import Model, SplatLayers
from runtime_models.stop_weights import Controls

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
        self._arena = arena
        # Of what onnxruntime decodes, (N, 3): by object and set of colours.
        self._colors: dict[tuple[int, int], np.ndarray] = {}
        made: dict[int, Layers | Networks | Evaluator] = {}
        for model in models:
            if id(model) in made:
                continue
            if isinstance(model, SplatLayers):
                made[id(model)] = Layers(gpu, model)
            elif mlps == "gl" and not follows_eye(model):
                made[id(model)] = Networks(gpu, model)
            else:
                made[id(model)] = Evaluator(model, keep=True)
        self._models = [made[id(model)] for model in models]
        for i, on_gpu in enumerate(self._models):
            if isinstance(on_gpu, Layers):
                on_gpu.place(arena, i)

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

    def color(self, i: int, x: Controls, eye: np.ndarray, seen: np.ndarray | None = None) -> None:
        """Colours of object i at x towards an eye (3,) in the object's frame; after geometry.

        seen: (A,) bool; the rest may keep what it has (compute passes colour all at once).
        """
        model, arena = self._models[i], self._arena
        if isinstance(model, Evaluator):
            key = (i, arena.set)
            self._colors[key] = model.color(x, eye, seen, self._colors.get(key))
            arena.write_color(i, self._colors[key])
        elif isinstance(model, Layers):
            model.color(arena, arena.starts[i], eye)
        else:
            model.color(arena, arena.starts[i], x, eye)

    def release(self) -> None:
        for model in self._models:
            if not isinstance(model, Evaluator):
                model.release()
        self._models.clear()
        self._colors.clear()

    def __enter__(self) -> "Decoder":
        return self

    def __exit__(self, *failure) -> None:
        self.release()
