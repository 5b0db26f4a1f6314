"""The few functions of GL that moderngl lacks, found in the context that is current."""

import ctypes
import sys
from collections.abc import Callable
from ctypes import CFUNCTYPE, c_char_p, c_void_p
from typing import Any

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
