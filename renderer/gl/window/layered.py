"""A window's picture and a layer over it, kept on software GL: only what changes is drawn anew."""

import moderngl
import numpy as np

from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.window.window_bytes import PixelBox, WindowBytes

CORNERS = np.array([(0, 1), (2, 1), (2, 3), (0, 1), (2, 3), (0, 3)])  # of two triangles


class Layered:
    """What a window shows, as bytes of its own: the picture alone, and with the layer over it."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._program = gpu.program("layer.vert", "layer.frag")
        self._corners = gpu.ctx.buffer(reserve=4096, dynamic=True)
        self._boxes = gpu.ctx.vertex_array(self._program, [(self._corners, "2f4", "corner")])
        self._picture, self._whole = WindowBytes(gpu), WindowBytes(gpu)

    @property
    def works(self) -> bool:
        """Whether this context has what it needs."""
        return self._whole.works

    def keep(self, window: moderngl.Framebuffer) -> None:
        """The window has a picture, and nothing over it yet."""
        self._picture.take(window)

    def show_picture(self, window: moderngl.Framebuffer) -> bool:
        """Puts the kept picture into the window; False where none of its size is kept."""
        if self._picture.size != window.viewport[2:]:
            return False
        self._picture.show(window)
        return True

    def lay_over(
        self, layer: moderngl.Texture, boxes: list[PixelBox], below: moderngl.Framebuffer | None
    ) -> None:
        """Puts the layer, premultiplied, row 0 at the bottom, over the picture in these boxes, of
        which no two share a pixel.

        below: the window, where it holds another picture than before; None: what lies below is the
        kept one, and outside of the boxes all is as it was.
        """
        if below is not None:
            self._whole.take(below)
        else:
            for box in boxes:
                self._whole.take_box(self._picture, box)
        if not boxes:
            return
        corners = np.ascontiguousarray(
            np.array(boxes, np.float32)[:, CORNERS]
        )  # (B, 6, 2) pixels from the upper left
        if corners.nbytes > self._corners.size:
            self._corners.orphan(corners.nbytes)
        self._corners.write(corners)
        ctx, program = self._gpu.ctx, self._program
        layer.filter = (moderngl.NEAREST, moderngl.NEAREST)
        layer.use(0)
        program["layer"].value, program["size"].value = 0, self._whole.size
        with self._gpu.drawing_into(self._whole.framebuffer):
            ctx.enable_only(moderngl.BLEND)
            ctx.blend_equation = moderngl.FUNC_ADD
            ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
            self._boxes.render(moderngl.TRIANGLES, vertices=6 * len(boxes))

    def show(self, window: moderngl.Framebuffer) -> None:
        """Puts the picture with what lies over it into the window."""
        self._whole.show(window)

    def release(self) -> None:
        for part in (self._boxes, self._corners, self._picture, self._whole):
            part.release()
