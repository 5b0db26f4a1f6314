"""Framebuffers around depth textures of the runtime: the few calls of GL that moderngl lacks."""

import ctypes
import sys
from collections.abc import Callable
from ctypes import CFUNCTYPE, c_char_p, c_int, c_uint, c_void_p

import moderngl

GL_FRAMEBUFFER, GL_TEXTURE_2D, GL_DEPTH_ATTACHMENT = 0x8D40, 0x0DE1, 0x8D00
GL_NONE, GL_FRAMEBUFFER_COMPLETE = 0, 0x8CD5
LOADERS = (("libEGL.so.1", "eglGetProcAddress", "eglGetCurrentContext"),
           ("libGLX.so.0", "glXGetProcAddressARB", "glXGetCurrentContext"),
           ("libGL.so.1", "glXGetProcAddressARB", "glXGetCurrentContext"))  # fmt: skip


class NoDepth(RuntimeError):
    """This driver draws no depth into the runtime's textures; the message says why."""


class DepthFramebuffers:
    """Framebuffers of depth alone, on the context that is current; release them at the end."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx, self._address = ctx, find_loader()
        self._made: list[int] = []

    def around(self, texture: int) -> moderngl.Framebuffer:
        """One whose depth is that texture.  Raises NoDepth."""
        before = self._ctx.fbo or self._ctx.detect_framebuffer(0)
        number = c_uint(0)
        self._call("glGenFramebuffers", None, (c_int, c_void_p), 1, ctypes.byref(number))
        self._made.append(number.value)
        self._call("glBindFramebuffer", None, (c_uint, c_uint), GL_FRAMEBUFFER, number.value)
        attach = (GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, texture, 0)
        kinds = (c_uint, c_uint, c_uint, c_uint, c_int)
        self._call("glFramebufferTexture2D", None, kinds, *attach)
        self._call("glDrawBuffer", None, (c_uint,), GL_NONE)
        self._call("glReadBuffer", None, (c_uint,), GL_NONE)
        whole = self._call("glCheckFramebufferStatus", c_uint, (c_uint,), GL_FRAMEBUFFER)
        before.use()
        if whole != GL_FRAMEBUFFER_COMPLETE:
            told = f"0x{whole:x}, {self._ctx.error}"  # which clears the error, too
            raise NoDepth(f"the driver does not draw into the runtime's depth ({told}).")
        return self._ctx.detect_framebuffer(number.value)

    def _call(self, name: str, result, kinds: tuple, *arguments):
        found = self._address(name)
        if not found:
            raise NoDepth(f"the driver has no {name}.")
        return CFUNCTYPE(result, *kinds)(found)(*arguments)

    def release(self) -> None:
        for number in self._made:
            self._call(
                "glDeleteFramebuffers", None, (c_int, c_void_p), 1, ctypes.byref(c_uint(number))
            )
        self._made.clear()


def find_loader() -> Callable[[str], int | None]:
    """What tells where a function of GL is, for the context that is current.  Raises NoDepth."""
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
    raise NoDepth("no OpenGL context of EGL or GLX is current.")


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
