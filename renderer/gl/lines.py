"""Line segments of objects over a finished picture: colliders in a debug view."""

from collections.abc import Iterable
from dataclasses import dataclass

import moderngl
import numpy as np

from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.scene.pose import View


@dataclass(frozen=True, eq=False)
class Wire:
    """Segments that move as one."""

    segments: np.ndarray  # (S, 2, 3) float32 metres, object frame; the same array = the same lines
    world_from_object: np.ndarray  # (4, 4)
    ink: tuple[float, float, float, float]  # display sRGB, straight alpha


class Lines:
    """Draws wires a pixel wide, through everything; keeps what it has sent to the device."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._program = gpu.program("lines.vert", "lines.frag")
        self._kept: dict[int, tuple[np.ndarray, moderngl.Buffer, moderngl.VertexArray]] = {}

    def draw(self, framebuffer: moderngl.Framebuffer, view: View, wires: Iterable[Wire]) -> None:
        """Blends the wires into the framebuffer's viewport, as `view` sees them."""
        wires = [wire for wire in wires if len(wire.segments)]
        clip_from_world = view.clip_from_eye() @ view.eye_from_world()
        ctx = self._gpu.ctx
        with self._gpu.drawing_into(framebuffer):
            ctx.enable_only(moderngl.BLEND)
            ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
            for wire in wires:
                matrix = clip_from_world @ wire.world_from_object
                self._program["clip_from_object"].write(matrix.T.astype("<f4").tobytes())
                self._program["ink"].value = wire.ink
                self._array(wire.segments).render(moderngl.LINES)
            ctx.enable_only(moderngl.NOTHING)
        self._forget({id(wire.segments) for wire in wires})

    def _array(self, segments: np.ndarray) -> moderngl.VertexArray:
        if id(segments) not in self._kept:
            buffer = self._gpu.upload(segments.astype("<f4"), "lines")
            array = self._gpu.ctx.vertex_array(self._program, [(buffer, "3f", "place")])
            self._kept[id(segments)] = segments, buffer, array
        return self._kept[id(segments)][2]

    def _forget(self, drawn: set[int]) -> None:
        """Frees what was not drawn this time."""
        for key in self._kept.keys() - drawn:
            _, buffer, array = self._kept.pop(key)
            array.release()
            buffer.release()

    def release(self) -> None:
        self._forget(set())
