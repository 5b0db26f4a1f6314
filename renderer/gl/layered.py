"""A window's picture and a layer over it, kept on software GL: only what changes is drawn anew."""

import ctypes
import sys
from collections.abc import Callable
from ctypes import CFUNCTYPE, c_char_p, c_int, c_uint, c_void_p
from typing import Any

import moderngl
import numpy as np

from shapeshift.renderer.gl.gpu import Gpu, release_framebuffer

GL_TEXTURE0, GL_TEXTURE_2D, GL_RGBA, GL_BGRA = 0x84C0, 0x0DE1, 0x1908, 0x80E1
GL_UNSIGNED_INT_8_8_8_8_REV, GL_NEAREST, GL_COLOR_BUFFER_BIT = 0x8367, 0x2600, 0x4000
GL_READ_FRAMEBUFFER = 0x8CA8

PixelBox = tuple[int, int, int, int]  # left, top, right, bottom; the upper left pixel is 0, 0


# The few functions of GL that moderngl lacks, found in the context that is current.

LOADERS = (("libEGL.so.1", "eglGetProcAddress", "eglGetCurrentContext"),
           ("libGLX.so.0", "glXGetProcAddressARB", "glXGetCurrentContext"),
           ("libGL.so.1", "glXGetProcAddressARB", "glXGetCurrentContext"))  # fmt: skip


class NoFunction(RuntimeError):
    """A function of GL was not found; the message says which, or that there is no context."""


class GlFunctions:
    """Calls by name, with their types; raises NoFunction where no context is current."""

    def __init__(self) -> None:
        self._address = find_loader()
        self._found: dict[str, Any] = {}

    def call(self, name: str, result, kinds: tuple, *arguments):
        """What the function returns.  Raises NoFunction."""
        if name not in self._found:
            address = self._address(name)
            if not address:
                raise NoFunction(f"the driver has no {name}.")
            self._found[name] = CFUNCTYPE(result, *kinds)(address)
        return self._found[name](*arguments)


def find_loader() -> Callable[[str], int | None]:
    """What tells where a function of GL is, for the context that is current.  Raises NoFunction."""
    if sys.platform == "win32":
        return _windows_loader()
    for library, function, current in LOADERS:
        try:
            loaded = ctypes.CDLL(library)
        except OSError:
            continue
        asks = getattr(loaded, current)
        asks.restype = c_void_p
        if not asks():
            continue
        find = getattr(loaded, function)
        find.restype, find.argtypes = c_void_p, [c_char_p]
        return lambda name: find(name.encode())
    raise NoFunction("no OpenGL context of EGL or GLX is current.")


def _windows_loader() -> Callable[[str], int | None]:
    """wglGetProcAddress knows what came after OpenGL 1.1, the library itself what was there."""
    opengl = getattr(ctypes, "WinDLL")("opengl32")  # noqa: B009  only there
    opengl.wglGetProcAddress.restype = c_void_p
    opengl.wglGetProcAddress.argtypes = [c_char_p]

    def address(name: str) -> int | None:
        found = opengl.wglGetProcAddress(name.encode())
        if found and found > 3:  # some drivers say 1, 2, 3 or -1 for none
            return found
        return ctypes.cast(getattr(opengl, name), c_void_p).value

    return address


class WindowBytes:
    """A picture in a texture that is laid out as a window's memory is: software GL copies between
    the two, where it draws from any other.  Of no stated size, and given blue first.  Blitted
    upside down it needs no turn, since GL counts rows from below and a window's memory from above.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._source: moderngl.Framebuffer | None = None
        try:
            self._functions: GlFunctions | None = GlFunctions()
        except NoFunction:
            self._functions = None

    @property
    def works(self) -> bool:
        """Whether there are the functions that this needs; GL's own order of bytes does without."""
        return self._functions is not None

    @property
    def size(self) -> tuple[int, int]:
        """Of what it holds; (0, 0) before the first."""
        return (0, 0) if self._source is None else self._source.size

    @property
    def framebuffer(self) -> moderngl.Framebuffer:
        """What draws into it; the upper row comes first."""
        assert self._source is not None, "nothing was laid out"
        return self._source

    def lay_out(self, size: tuple[int, int]) -> None:
        """Takes room for a picture of that size, undefined, if what is there has another one."""
        if self.size != size:
            self.release()
            self._source = self._gpu.ctx.framebuffer([self._gpu.ctx.texture(size, 4)])
            self._gpu.allocations += 1
            self._write(None, *size)

    def copy(self, pixels: np.ndarray, framebuffer: moderngl.Framebuffer) -> None:
        """Fills the viewport of a window's, which is bound, with (H, W, 4) uint8 of its size."""
        self.upload(pixels)
        self._show(framebuffer)

    def show(self, framebuffer: moderngl.Framebuffer) -> None:
        """Fills the viewport of a window's framebuffer, which is as large as this is."""
        with self._gpu.drawing_into(framebuffer):
            self._show(framebuffer)

    def _show(self, framebuffer: moderngl.Framebuffer) -> None:
        (width, height), (left, below) = self.size, framebuffer.viewport[:2]
        shown = (left, below + height, left + width, below)  # upside down
        self._blit(self.framebuffer, (0, 0, width, height), shown)

    def copy_window(self, framebuffer: moderngl.Framebuffer) -> None:
        """Keeps what is in the viewport of a window's framebuffer."""
        left, below, width, height = framebuffer.viewport
        self.lay_out((width, height))
        with self._gpu.drawing_into(self.framebuffer):
            taken = (left, below + height, left + width, below)
            self._blit(framebuffer, taken, (0, 0, width, height))

    def upload(self, pixels: np.ndarray) -> None:
        """Holds (H, W, 4) uint8 from now on."""
        height, width = pixels.shape[:2]
        self.lay_out((width, height))
        self._write(np.ascontiguousarray(pixels).ctypes.data, width, height)

    def read_box(self, box: PixelBox) -> np.ndarray:
        """(H, W, 4) uint8 of a part of what was drawn into it by GL's rules: row 0 on top."""
        left, top, right, low = box
        pixels = np.empty((low - top, right - left, 4), np.uint8)
        place = (left, self.size[1] - low, right - left, low - top)
        order = (GL_BGRA, GL_UNSIGNED_INT_8_8_8_8_REV, pixels.ctypes.data)
        with self._gpu.drawing_into(self.framebuffer):
            kinds = (*(c_int,) * 4, c_uint, c_uint, c_void_p)
            self._call("glReadPixels", kinds, *place, *order)
        return pixels[::-1]

    def copy_box(self, other: "WindowBytes", box: PixelBox) -> None:
        """Copies a part of another one of this size to the same place."""
        with self._gpu.drawing_into(self.framebuffer):
            self._blit(other.framebuffer, box, box)

    def _blit(self, source: moderngl.Framebuffer, of: PixelBox, to: PixelBox) -> None:
        """From a framebuffer into the one that is bound."""
        self._call("glBindFramebuffer", (c_uint, c_uint), GL_READ_FRAMEBUFFER, source.glo)
        how = (GL_COLOR_BUFFER_BIT, GL_NEAREST)
        self._call("glBlitFramebuffer", (c_int,) * 8 + (c_uint,) * 2, *of, *to, *how)

    def _write(self, data: int | None, width: int, height: int) -> None:
        """Into the texture; None: lays it out."""
        (texture,) = self.framebuffer.color_attachments
        unit = GL_TEXTURE0 + self._gpu.ctx.default_texture_unit  # where moderngl writes, too
        self._call("glActiveTexture", (c_uint,), unit)
        self._call("glBindTexture", (c_uint, c_uint), GL_TEXTURE_2D, texture.glo)
        order = (GL_BGRA, GL_UNSIGNED_INT_8_8_8_8_REV, data)
        kinds = (c_uint, *(c_int,) * 5, c_uint, c_uint, c_void_p)
        if data is None:
            self._call("glTexImage2D", kinds, GL_TEXTURE_2D, 0, GL_RGBA, width, height, 0, *order)
        else:
            place = (0, 0, 0, width, height)
            self._call("glTexSubImage2D", kinds, GL_TEXTURE_2D, *place, *order)

    def _call(self, name: str, kinds: tuple, *arguments) -> None:
        assert self._functions is not None
        self._functions.call(name, None, kinds, *arguments)

    def release(self) -> None:
        if self._source is not None:
            release_framebuffer(self._source)
            self._source = None


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
