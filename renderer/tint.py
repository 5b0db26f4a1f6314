"""tint: colours in the arena -> mixed towards a palette, each splat by its anchor's weight."""

import moderngl
import numpy as np

from renderer import layout
from renderer.buffers import Arena, bind
from renderer.gpu import Gpu, groups_for


class Tinter:
    """The pass and its two buffers; made when the first object is tinted."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._program = gpu.compute("tint.comp")
        self._palette = gpu.reserve(16 * 256, "palette")
        self._weights: moderngl.Buffer | None = None

    def tint(self, arena: Arena, i: int, palette: np.ndarray, weights: np.ndarray) -> None:
        """Colours of object i, just decoded; palette (256, 3), weights (A,) 0..1 an anchor."""
        rows = arena.starts[i + 1] - arena.starts[i]
        if not rows:
            return
        if self._weights is None or self._weights.size < weights.nbytes:
            if self._weights is not None:
                self._weights.release()
            self._weights = self._gpu.reserve(weights.nbytes, "weights of a palette")
        self._weights.write(np.ascontiguousarray(weights, np.float32))
        self._palette.write(np.pad(np.float32(palette), ((0, 0), (0, 1))))
        bind(color=arena.color, palette=self._palette, tint=self._weights)
        self._gpu.run(
            self._program, groups_for(rows, layout.WORKGROUP),
            count=rows, start=arena.starts[i], splats_per_anchor=rows // len(weights),
        )  # fmt: skip

    def release(self) -> None:
        for buffer in (self._palette, self._weights):
            if buffer is not None:
                buffer.release()
