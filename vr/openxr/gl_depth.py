"""Framebuffers around depth textures of the runtime: the few calls of GL that moderngl lacks."""

import ctypes
from ctypes import c_int, c_uint, c_void_p

import moderngl

from shapeshift.renderer.gl.functions import GlFunctions, NoFunction

GL_FRAMEBUFFER, GL_TEXTURE_2D, GL_DEPTH_ATTACHMENT = 0x8D40, 0x0DE1, 0x8D00
GL_NONE, GL_FRAMEBUFFER_COMPLETE = 0, 0x8CD5


class NoDepth(RuntimeError):
    """This driver draws no depth into the runtime's textures; the message says why."""


class DepthFramebuffers:
    """Framebuffers of depth alone, on the context that is current; release them at the end."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        try:
            self._functions = GlFunctions()
        except NoFunction as error:
            raise NoDepth(str(error)) from error
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
        try:
            return self._functions.call(name, result, kinds, *arguments)
        except NoFunction as error:
            raise NoDepth(str(error)) from error

    def release(self) -> None:
        for number in self._made:
            self._call(
                "glDeleteFramebuffers", None, (c_int, c_void_p), 1, ctypes.byref(c_uint(number))
            )
        self._made.clear()
