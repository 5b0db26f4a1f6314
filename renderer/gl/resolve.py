"""resolve: a float image over a background, palette applied, into any framebuffer."""

from collections.abc import Callable
from functools import partial

import moderngl
import numpy as np

from shapeshift.renderer.gl.gpu import Gpu, release_framebuffer
from shapeshift.renderer.gl.layered import WindowBytes
from shapeshift.scene.appearance import Background, Sky, up_of_eye
from shapeshift.scene.pose import View

STEPS = 256  # colours of a palette
MakeBytes = Callable[..., np.ndarray]  # presentable_bytes of drawing.py without its first arguments
# May keep what would fill the viewport of a window, as a function that makes its bytes, until it is
# known what lies over it.  False: they are to be copied there now.
WindowTaker = Callable[[MakeBytes, moderngl.Framebuffer], bool]


class Resolve:
    """Shows images: GL textures of the splatter, or arrays from elsewhere."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._program = gpu.program("full.vert", "resolve.frag")
        self._triangle = gpu.ctx.vertex_array(self._program, [])
        self._palette = gpu.ctx.texture((STEPS, 1), 3, dtype="f4")
        self._palette_now: np.ndarray | None = None
        self._uploaded: dict[int, moderngl.Texture] = {}  # colours, heat
        self._bytes: moderngl.Framebuffer | None = None
        self._window = WindowBytes(gpu)
        gpu.allocations += 1

    def draw(
        self,
        source: moderngl.Texture | np.ndarray,
        framebuffer: moderngl.Framebuffer,
        background: Background,
        palette: np.ndarray | None = None,
        heat: moderngl.Texture | np.ndarray | None = None,
        unit: float = 1.0,
        view: View | None = None,
    ) -> None:
        """Fills the framebuffer's viewport: palette applied, over the background.

        source: premultiplied; a texture has row 0 at the bottom, an array (H, W, 4) on top.
        palette: (256, 3) display sRGB; None: the colours are final.  heat: of the same kind as
        source, value and weight times alpha first, of which the palette makes colours; None: it
        makes them of the source.  unit: the display value that 1 in these stands for.  view: whose
        directions a sky is seen in.
        """
        from_array = isinstance(source, np.ndarray)
        images = [source] if heat is None or palette is None else [source, heat]
        textures: list[moderngl.Texture] = [
            self._upload(each, i) if isinstance(each, np.ndarray) else each
            for i, each in enumerate(images)
        ]
        same_size = textures[0].size == tuple(framebuffer.viewport[2:])
        for texture in textures:
            texture.filter = (moderngl.NEAREST,) * 2 if same_size else (moderngl.LINEAR,) * 2
            texture.repeat_x = texture.repeat_y = False
        if palette is not None and palette is not self._palette_now:
            self._palette.write(np.ascontiguousarray(palette, np.float32))
            self._palette_now = palette
        self._palette.use(1)
        textures[0].use(0)
        textures[-1].use(2)
        program = self._program
        program["image"].value, program["palette"].value, program["heat"].value = 0, 1, 2
        program["use_palette"].value = palette is not None
        program["use_heat"].value = len(textures) > 1
        set_background(program, background, view)
        program["top_first"].value, program["unit"].value = from_array, unit
        with self._gpu.drawing_into(framebuffer):
            self._gpu.ctx.enable_only(moderngl.NOTHING)
            self._triangle.render(moderngl.TRIANGLES, vertices=3)

    def takes_bytes(self, framebuffer: moderngl.Framebuffer, size: tuple[int, int]) -> bool:
        """Whether pixels of 8 bits and this size fill the framebuffer's viewport as they are."""
        parts = framebuffer.color_attachments
        if parts is None:  # not made here: a window has 8 bits, of others nothing is known
            eight_bits = framebuffer.glo == 0
        else:
            eight_bits = all(part.dtype == "f1" and part.components == 4 for part in parts)
        left, below, *shown = framebuffer.viewport
        anywhere = self.is_window(framebuffer) or (left, below) == (0, 0)
        return eight_bits and framebuffer.samples == 0 and tuple(shown) == size and anywhere

    def is_window(self, framebuffer: moderngl.Framebuffer) -> bool:
        """Whether it is a window's, which is filled fastest by bytes as its own memory has them."""
        return framebuffer.glo == 0 and self._window.works

    def copy(
        self, make: MakeBytes, framebuffer: moderngl.Framebuffer, taker: WindowTaker | None = None
    ) -> None:
        """Fills a framebuffer that takes_bytes with (H, W, 4) uint8, opaque.

        For a window that is_window blue is first and row 0 on top, else red and at the bottom: so
        software GL copies, and does not draw (0.2 CPU ms at 1280x720; draw() takes 11, a window's
        bytes in GL's order 2.6).
        """
        if self.is_window(framebuffer):
            make = partial(make, as_window=True)
            if taker is None or not taker(make, framebuffer):
                with self._gpu.drawing_into(framebuffer):
                    self._window.copy(make(), framebuffer)
            return
        pixels = make()
        size = (pixels.shape[1], pixels.shape[0])
        if self._bytes is None or self._bytes.size != size:
            self._release_bytes()
            self._bytes = self._gpu.ctx.framebuffer([self._gpu.ctx.texture(size, 4)])
            self._gpu.allocations += 1
        (texture,) = self._bytes.color_attachments
        texture.write(pixels)
        if all(have >= want for have, want in zip(framebuffer.size, size, strict=True)):
            with self._gpu.drawing_into(framebuffer):
                self._gpu.ctx.copy_framebuffer(framebuffer, self._bytes)
        else:  # a window that has grown: moderngl copies no more than it had when it was opened
            self.draw(texture, framebuffer, (0.0, 0.0, 0.0))

    def _release_bytes(self) -> None:
        if self._bytes is not None:
            release_framebuffer(self._bytes)
            self._bytes = None

    def _upload(self, image: np.ndarray, which: int) -> moderngl.Texture:
        """The array as a texture; made anew only when the size changes."""
        height, width, parts = image.shape
        texture = self._uploaded.get(which)
        if texture is None or texture.size != (width, height):
            if texture is not None:
                texture.release()
            texture = self._uploaded[which] = self._gpu.ctx.texture(
                (width, height), parts, dtype="f4"
            )
            self._gpu.allocations += 1
        texture.write(np.ascontiguousarray(image, np.float32))
        return texture

    def release(self) -> None:
        self._triangle.release()
        self._palette.release()
        self._release_bytes()
        self._window.release()
        for texture in self._uploaded.values():
            texture.release()
        self._uploaded.clear()

    def __enter__(self) -> "Resolve":
        return self

    def __exit__(self, *failure) -> None:
        self.release()


def set_background(program: moderngl.Program, background: Background, view: View | None) -> None:
    """The uniforms of what is behind everything; a sky needs the view that it is seen in."""
    program["has_sky"].value = isinstance(background, Sky)
    if not isinstance(background, Sky):
        program["background"].value = tuple(background)
        return
    assert view is not None, "a sky is seen from somewhere"
    program["background"].value = background.horizon
    program["zenith"].value, program["ground"].value = background.zenith, background.ground
    program["tangents"].value = view.tangents
    program["up"].value = tuple(up_of_eye(view))
