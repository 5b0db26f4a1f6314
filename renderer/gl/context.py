"""Opens a GL 4.3 context without a window: EGL device, EGL surfaceless, OSMesa; or says why not."""

import ctypes
import sys
from collections.abc import Callable
from ctypes import CFUNCTYPE, POINTER, byref, c_char_p, c_int, c_uint, c_void_p

import moderngl

from shapeshift.rasterizer.device import check_fork

NEEDED = 430  # compute shaders and storage buffers
KINDS = ("egl", "surfaceless", "osmesa")  # the order of "auto": a GPU comes first where one is
SOFTWARE = (
    "llvmpipe", "softpipe", "swrast", "swr ", "software rasterizer",
    "gdi generic", "basic render driver",  # Windows without a graphics driver
)  # fmt: skip
INSTALL = {
    "libEGL.so.1": "apt install libegl1 libegl-mesa0 libgl1-mesa-dri",
    "libOSMesa.so.8": "apt install libosmesa6",
}

# EGL 1.5 and extension registry
EGL_PLATFORM_DEVICE, EGL_PLATFORM_SURFACELESS = 0x313F, 0x31DD
EGL_OPENGL_API, EGL_NONE = 0x30A2, 0x3038
EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, EGL_PBUFFER_BIT = 0x3040, 8, 0x3033, 1
EGL_MAJOR, EGL_MINOR, EGL_PROFILE, EGL_CORE_BIT = 0x3098, 0x30FB, 0x30FD, 1
# Asked for one after the other; 3.3 last, so that a driver that is too old answers and is named.
VERSIONS = ((4, 6), (4, 5), (4, 3), (3, 3))
# GL/osmesa.h
OSMESA_FORMAT, OSMESA_DEPTH_BITS, OSMESA_PROFILE, OSMESA_CORE = 0x22, 0x30, 0x33, 0x34
OSMESA_MAJOR, OSMESA_MINOR, GL_RGBA, GL_UNSIGNED_BYTE = 0x36, 0x37, 0x1908, 0x1401


class NoContext(RuntimeError):
    """No usable GL context.  The message says what was tried and what to install."""


def open_context(kind: str = "auto") -> moderngl.Context:
    """A current GL 4.3 core context without a window; "auto" tries KINDS in order.

    Raises NoContext with one sentence when there is none, and when GL is older than 4.3; NoDevice
    in a forked process.
    """
    check_fork()
    openers = {"egl": _open_egl, "surfaceless": _open_surfaceless, "osmesa": _open_osmesa}
    if kind in openers:
        return _moderngl(openers[kind]())
    if kind != "auto":
        raise NoContext(f"there is no context {kind!r}; choose one of auto, {', '.join(KINDS)}.")
    if sys.platform == "win32":
        return _open_wgl()
    kinds_of_reason: dict[str, list[str]] = {}
    for name, opener in openers.items():
        try:
            return _moderngl(opener())
        except NoContext as reason:
            kinds_of_reason.setdefault(str(reason).rstrip("."), []).append(name)
    reasons = "; ".join(f"{', '.join(kinds)}: {why}" for why, kinds in kinds_of_reason.items())
    raise NoContext(f"no GL context without a window ({reasons}).")


def describe(ctx: moderngl.Context) -> dict[str, str]:
    """What the driver calls itself: gl_renderer, gl_version, vendor."""
    info = ctx.info
    return {
        "gl_renderer": info["GL_RENDERER"],
        "gl_version": info["GL_VERSION"],
        "vendor": info["GL_VENDOR"],
    }


def is_software(ctx: moderngl.Context) -> bool:
    """True where GL runs on the CPU: llvmpipe, softpipe, swr, swrast."""
    name = ctx.info["GL_RENDERER"].lower() + " "
    return any(known in name for known in SOFTWARE)


class _Current:
    """What moderngl wants of a context that somebody else made: load, make current, release.

    In a `with` it is the current one of this thread, and afterwards what was current before.
    """

    def __init__(self, load, make_current, is_current, let_go, destroy) -> None:
        self._load, self._make_current, self._destroy = load, make_current, destroy
        self._is_current, self.let_go = is_current, let_go
        self._others: list[bool] = []  # of each `with` that is open: it was not current before
        make_current()

    def load_opengl_function(self, name: str) -> int:
        return self._load(name.encode()) or 0

    load = load_opengl_function

    def __enter__(self) -> "_Current":
        self._others.append(not self._is_current())
        self._make_current()
        return self

    def __exit__(self, *failure) -> None:
        if self._others.pop():
            self.let_go()

    def release(self) -> None:
        self._destroy()


def let_go(ctx: moderngl.Context) -> None:
    """No context is current in this thread any more, so that another thread may use this one."""
    if isinstance(ctx.extra, _Current):
        ctx.extra.let_go()
    elif sys.platform == "win32":
        ctypes.WinDLL("opengl32").wglMakeCurrent(None, None)


def _moderngl(current: _Current) -> moderngl.Context:
    ctx = moderngl.create_context(context=current, require=0)
    ctx.extra = current
    if not ctx.version_code >= NEEDED:
        name, (major, minor) = ctx.info["GL_RENDERER"], divmod(ctx.version_code // 10, 10)
        ctx.release()
        raise NoContext(
            f"GL 4.3 needed, this driver offers {major}.{minor} ({name}); "
            "update the graphics driver, or install Mesa 22 or newer."
        )
    return ctx


def _library(name: str) -> ctypes.CDLL:
    try:
        return ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)
    except OSError as missing:
        raise NoContext(f"{name} is not installed ({INSTALL[name]}).") from missing


def _egl_library() -> ctypes.CDLL:
    egl = _library("libEGL.so.1")
    for name, result, arguments in (
        ("eglGetProcAddress", c_void_p, [c_char_p]),
        ("eglInitialize", c_uint, [c_void_p, c_void_p, c_void_p]),
        ("eglBindAPI", c_uint, [c_uint]),
        ("eglChooseConfig", c_uint, [c_void_p, c_void_p, c_void_p, c_int, c_void_p]),
        ("eglCreateContext", c_void_p, [c_void_p, c_void_p, c_void_p, c_void_p]),
        ("eglMakeCurrent", c_uint, [c_void_p, c_void_p, c_void_p, c_void_p]),
        ("eglGetCurrentContext", c_void_p, []),
        ("eglDestroyContext", c_uint, [c_void_p, c_void_p]),
        ("eglGetError", c_int, []),
    ):
        function = getattr(egl, name)
        function.restype, function.argtypes = result, arguments
    return egl


def _egl_extension(egl: ctypes.CDLL, name: str, result, *arguments):
    address = egl.eglGetProcAddress(name.encode())
    if not address:
        raise NoContext(f"this EGL has no {name}; update the graphics driver.")
    return CFUNCTYPE(result, *arguments)(address)


def _open_egl() -> _Current:
    """The first EGL device that makes a context; drivers list GPUs before software."""
    egl = _egl_library()
    query = _egl_extension(egl, "eglQueryDevicesEXT", c_uint, c_int, c_void_p, POINTER(c_int))
    platform = _egl_extension(egl, "eglGetPlatformDisplayEXT", c_void_p, c_uint, c_void_p, c_void_p)
    count, devices = c_int(0), (c_void_p * 16)()
    query(len(devices), devices, byref(count))
    reasons = []
    for i in range(count.value):
        try:
            return _egl_current(egl, platform(EGL_PLATFORM_DEVICE, devices[i], None))
        except NoContext as reason:
            reasons.append(f"device {i}: {reason}")
    raise NoContext("; ".join(reasons) or f"EGL lists no device ({INSTALL['libEGL.so.1']}).")


def _open_surfaceless() -> _Current:
    egl = _egl_library()
    platform = _egl_extension(egl, "eglGetPlatformDisplayEXT", c_void_p, c_uint, c_void_p, c_void_p)
    return _egl_current(egl, platform(EGL_PLATFORM_SURFACELESS, None, None))


def _egl_current(egl: ctypes.CDLL, display: int | None) -> _Current:
    """A current core context on an EGL display, without a surface."""

    def need(success, what: str):
        if not success:
            raise NoContext(f"{what} failed (EGL error 0x{egl.eglGetError():x}).")
        return success

    need(display, "eglGetPlatformDisplay")
    need(egl.eglInitialize(display, None, None), "eglInitialize")
    need(egl.eglBindAPI(EGL_OPENGL_API), "eglBindAPI")
    wanted = (c_int * 5)(
        EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_NONE
    )
    config, count = c_void_p(), c_int(0)
    found = egl.eglChooseConfig(display, wanted, byref(config), 1, byref(count))
    need(found and count.value, "eglChooseConfig")

    def create(major: int, minor: int) -> int | None:
        version = (c_int * 7)(
            EGL_MAJOR, major, EGL_MINOR, minor, EGL_PROFILE, EGL_CORE_BIT, EGL_NONE
        )  # fmt: skip
        return egl.eglCreateContext(display, config, None, version)

    made = need(create_newest(create), "eglCreateContext")

    def let_go() -> None:
        egl.eglMakeCurrent(display, None, None, None)

    def destroy() -> None:
        let_go()
        egl.eglDestroyContext(display, made)

    return _Current(
        egl.eglGetProcAddress,
        lambda: need(egl.eglMakeCurrent(display, None, None, made), "eglMakeCurrent"),
        lambda: egl.eglGetCurrentContext() == made,
        let_go,
        destroy,
    )


def create_newest(create: Callable[[int, int], int | None]) -> int | None:
    """What `create` makes of the newest version that it takes; None: of none.

    Mesa gives its newest whatever is asked for, NVIDIA's driver just what is asked for.
    """
    return next(filter(None, (create(*version) for version in VERSIONS)), None)


def _open_osmesa() -> _Current:
    """Mesa drawing to memory: works without any display system."""
    mesa = _library("libOSMesa.so.8")
    create, make = mesa.OSMesaCreateContextAttribs, mesa.OSMesaMakeCurrent
    create.restype, create.argtypes = c_void_p, [c_void_p, c_void_p]
    make.argtypes = [c_void_p, c_void_p, c_uint, c_int, c_int]
    address = mesa.OSMesaGetProcAddress
    address.restype, address.argtypes = c_void_p, [c_char_p]
    wanted = (c_int * 11)(
        OSMESA_FORMAT, GL_RGBA, OSMESA_DEPTH_BITS, 24, OSMESA_PROFILE, OSMESA_CORE,
        OSMESA_MAJOR, 3, OSMESA_MINOR, 3, 0,
    )  # fmt: skip
    made = create(wanted, None)
    if not made:
        raise NoContext(f"OSMesa made no context ({INSTALL['libOSMesa.so.8']}).")
    screen = (ctypes.c_ubyte * (64 * 64 * 4))()  # OSMesa wants a default framebuffer in memory

    def make_current() -> None:
        if not make(made, screen, GL_UNSIGNED_BYTE, 64, 64):
            raise NoContext("OSMesaMakeCurrent failed.")

    mesa.OSMesaGetCurrentContext.restype = c_void_p
    return _Current(
        address,
        make_current,
        lambda: mesa.OSMesaGetCurrentContext() == made,
        lambda: make(None, None, GL_UNSIGNED_BYTE, 0, 0),
        lambda: mesa.OSMesaDestroyContext(c_void_p(made)),
    )


def _open_wgl() -> moderngl.Context:
    """Windows: the hidden window that glcontext makes."""
    try:
        return moderngl.create_context(standalone=True, require=NEEDED)
    except Exception as reason:  # glcontext raises nothing narrower
        raise NoContext(f"no GL 4.3 ({reason}); update the graphics driver.") from reason
