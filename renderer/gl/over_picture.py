"""heat_over_shape: two pictures of a window, laid over each other on the GPU."""

from collections.abc import Iterable
from dataclasses import dataclass

import moderngl
import numpy as np

from shapeshift.renderer.colors.heat_over_shape import blur_weights
from shapeshift.renderer.gl.gpu import Gpu, release_framebuffer
from shapeshift.scene.pose import View

MOST = 256  # weights that the shader has room for: of pictures up to 20,000 pixels high


class HeatOverShape:
    """The two passes, and the picture between them."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        name = ("full.vert", "colors/heat_over_shape.frag")
        self._passes = [gpu.program(*name, SECOND=second, MOST=MOST) for second in (0, 1)]
        self._triangles = [gpu.ctx.vertex_array(program, []) for program in self._passes]
        self._between: moderngl.Framebuffer | None = None  # luminance, blurred along x
        self._height = 0  # that the weights are for

    def draw(
        self, photo: moderngl.Texture, heat: moderngl.Texture, framebuffer: moderngl.Framebuffer,
        detail: float = 1.0,
    ) -> None:  # fmt: skip
        """Fills the framebuffer, as large as the two: what colors/heat_over_shape.py says."""
        between = self._room(photo.size)
        (blurred,) = between.color_attachments
        first, second = self._passes
        if self._height != photo.size[1]:
            self._height = photo.size[1]
            weights = blur_weights(self._height)
            for program in self._passes:
                program["weights"].write(np.pad(weights, (0, MOST - len(weights))))
                program["reach"].value = len(weights) - 1
        for unit, texture in enumerate((photo, blurred, heat)):
            texture.use(unit)
        first["photo"].value = second["photo"].value = 0
        second["blurred"].value, second["heat"].value = 1, 2
        second["detail"].value = detail
        for target, triangle in zip((between, framebuffer), self._triangles, strict=True):
            with self._gpu.drawing_into(target):
                self._gpu.ctx.enable_only(moderngl.NOTHING)
                triangle.render(moderngl.TRIANGLES, vertices=3)

    def _room(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        if self._between is None or self._between.size != size:
            self._release_between()
            ctx = self._gpu.ctx
            self._between = ctx.framebuffer([ctx.texture(size, 1, dtype="f4")])
        return self._between

    def _release_between(self) -> None:
        if self._between is not None:
            release_framebuffer(self._between)
            self._between = None

    def release(self) -> None:
        """The programs belong to the Gpu."""
        self._release_between()
        for triangle in self._triangles:
            triangle.release()


# Line segments of objects over a finished picture: colliders in a debug view.


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
