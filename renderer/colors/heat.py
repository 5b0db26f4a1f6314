"""heat: what value stops have in the colours of splats, apart from what the other stops have."""

import moderngl
import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, groups_for, overwrite


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
