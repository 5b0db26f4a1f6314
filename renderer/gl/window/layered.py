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
        self._program = gpu.program("window/layer.vert", "window/layer.frag")
        self._corners = gpu.ctx.buffer(reserve=4096, dynamic=True)
        self._boxes = gpu.ctx.vertex_array(self._program, [(self._corners, "2f4", "corner")])
        self._picture, self._whole = WindowBytes(gpu), WindowBytes(gpu)
        self._holds = False  # the whole is the picture with the layer over it

    @property
    def works(self) -> bool:
        """Whether this context has what it needs."""
        return self._whole.works

    def keep(self, window: moderngl.Framebuffer) -> None:
        """The window has a picture, and nothing over it yet."""
        self._picture.copy_window(window)
        self._holds = False

    def keep_bytes(self, pixels: np.ndarray) -> None:
        """The same of a picture that no window has yet, (H, W, 4) uint8 as a window has them."""
        self._picture.upload(pixels)
        self._holds = False

    def show_bytes(self, pixels: np.ndarray, window: moderngl.Framebuffer) -> None:
        """Fills the window with a picture and all that is over it."""
        self._whole.upload(pixels)
        self._whole.show(window)
        self._holds = False

    def show_picture(self, window: moderngl.Framebuffer) -> bool:
        """Puts the kept picture into the window; False where none of its size is kept."""
        if self._picture.size != window.viewport[2:]:
            return False
        self._picture.show(window)
        return True

    def lay_over_window(
        self, window: moderngl.Framebuffer, layer: moderngl.Texture, boxes: list[PixelBox]
    ) -> None:
        """Puts the layer, premultiplied, row 0 at the bottom, over what the window has, in these
        boxes, of which no two share a pixel.
        """
        self._whole.copy_window(window)
        self._blend(layer, boxes)
        self._whole.show(window)
        self._holds = False

    def lay_over_picture(
        self, window: moderngl.Framebuffer, layer: moderngl.Texture,
        covered: list[PixelBox], changed: list[PixelBox],
    ) -> None:  # fmt: skip
        """The window gets the kept picture and the layer over it, which covers some boxes and has
        changed in others since the last time; both as in lay_over_window.
        """
        whole = self._whole
        if not self._holds:
            width, height = self._picture.size
            whole.lay_out((width, height))
            whole.copy_box(self._picture, (0, 0, width, height))
            changed, self._holds = covered, True
        else:
            for box in changed:
                whole.copy_box(self._picture, box)
        self._blend(layer, changed)
        whole.show(window)

    def _blend(self, layer: moderngl.Texture, boxes: list[PixelBox]) -> None:
        """Into the whole and not into the window, for which llvmpipe takes three times as long."""
        if not boxes:
            return
        sides = np.array(boxes, np.float32)  # (B, 4)
        corners = np.ascontiguousarray(sides[:, CORNERS])  # (B, 6, 2) pixels from the upper left
        if corners.nbytes > self._corners.size:
            self._corners.orphan(corners.nbytes)
        self._corners.write(corners)
        ctx, program = self._gpu.ctx, self._program
        layer.filter = (moderngl.NEAREST, moderngl.NEAREST)
        layer.use(0)
        program["layer"].value, program["size"].value = 0, layer.size
        with self._gpu.drawing_into(self._whole.framebuffer):
            ctx.enable_only(moderngl.BLEND)
            ctx.blend_equation = moderngl.FUNC_ADD
            ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
            self._boxes.render(moderngl.TRIANGLES, vertices=6 * len(boxes))

    def release(self) -> None:
        for part in (self._boxes, self._corners, self._picture, self._whole):
            part.release()
