"""What a runtime wants to know of the GL context that is current: EGL, GLX (Xlib) or WGL."""

import ctypes
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from ctypes import byref, c_char_p, c_int, c_uint, c_void_p
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from shapeshift.renderer.gl.layered import GlFunctions, NoFunction
from shapeshift.vr.openxr.instance import Instance, NoHeadset
from shapeshift.vr.shown import Blit

EGL_CONFIG_ID, EGL_NONE = 0x3028, 0x3038


def bind_current(instance: Instance):
    """The binding structure of the context that is current in this thread.

    It must live until the session is made.  NoHeadset where the runtime takes no such context.
    """
    if sys.platform == "win32":
        return _need(instance, "XR_KHR_opengl_enable", "a WGL") and _wgl(instance.xr)
    egl = _egl_library()
    if egl is not None and egl.eglGetCurrentContext():
        return _need(instance, "XR_MNDX_egl_enable", "an EGL") and _egl(instance.xr, egl)
    return _need(instance, "XR_KHR_opengl_enable", "a GLX") and _glx(instance.xr)


def check_requirements(instance: Instance) -> None:
    """Asks which OpenGL the runtime wants, as has to be done before a session is made."""
    xr = instance.xr
    # xr.ext.KHR.opengl_enable of pyopenxr 1.1.6501 cannot be imported on Linux.
    address = xr.get_instance_proc_addr(instance.handle, "xrGetOpenGLGraphicsRequirementsKHR")
    ask = ctypes.cast(address, xr.PFN_xrGetOpenGLGraphicsRequirementsKHR)
    requirements = xr.GraphicsRequirementsOpenGLKHR()
    with instance.asked("say which OpenGL it wants"):
        answer = xr.exception.check_result(
            ask(instance.handle, instance.system, byref(requirements))
        )
        if answer.is_exception():
            raise answer


def _need(instance: Instance, extension: str, kind: str) -> bool:
    if extension not in instance.extensions:
        cure = "start it where a window can be opened" if "EGL" in kind else "use SteamVR's"
        raise NoHeadset(
            f"{instance.runtime} takes no pictures of {kind} context (it has no {extension}); "
            f"{cure}."
        )
    return True


def _egl_library() -> ctypes.CDLL | None:
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return None
    egl.eglGetCurrentDisplay.restype = egl.eglGetCurrentContext.restype = c_void_p
    egl.eglQueryContext.argtypes = [c_void_p, c_void_p, c_int, c_void_p]
    egl.eglChooseConfig.argtypes = [c_void_p, c_void_p, c_void_p, c_int, c_void_p]
    egl.eglGetProcAddress.restype, egl.eglGetProcAddress.argtypes = c_void_p, [c_char_p]
    return egl


def _egl(xr, egl: ctypes.CDLL):
    display, context = egl.eglGetCurrentDisplay(), egl.eglGetCurrentContext()
    number, config, count = c_int(), c_void_p(), c_int()
    egl.eglQueryContext(display, context, EGL_CONFIG_ID, byref(number))
    wanted = (c_int * 3)(EGL_CONFIG_ID, number.value, EGL_NONE)
    egl.eglChooseConfig(display, wanted, byref(config), 1, byref(count))  # none: no-config context
    binding = xr.GraphicsBindingEGLMNDX()
    binding.get_proc_address = ctypes.cast(egl.eglGetProcAddress, xr.PFN_xrEglGetProcAddressMNDX)
    for name, value in (("display", display), ("config", config.value), ("context", context)):
        _set_pointer(binding, name, value)
    return binding


def _glx(xr):
    try:
        glx = ctypes.CDLL("libGLX.so.0")
    except OSError:
        glx = ctypes.CDLL("libGL.so.1")
    glx.glXGetCurrentDisplay.restype = glx.glXGetCurrentContext.restype = c_void_p
    glx.glXGetCurrentDrawable.restype = ctypes.c_ulong
    context = glx.glXGetCurrentContext()
    if not context:
        raise NoHeadset(
            "this OpenGL context is neither EGL's nor GLX's, and a runtime takes no other; "
            "leave --context at auto."
        )
    binding = xr.GraphicsBindingOpenGLXlibKHR()
    _set_pointer(binding, "x_display", glx.glXGetCurrentDisplay())
    _set_pointer(binding, "glx_context", context)
    binding.glx_drawable = glx.glXGetCurrentDrawable()
    return binding


def _wgl(xr):
    gl = ctypes.WinDLL("opengl32")
    gl.wglGetCurrentDC.restype = gl.wglGetCurrentContext.restype = c_void_p
    binding = xr.GraphicsBindingOpenGLWin32KHR()
    _set_pointer(binding, "h_dc", gl.wglGetCurrentDC())
    _set_pointer(binding, "h_glrc", gl.wglGetCurrentContext())
    return binding


def _set_pointer(binding, name: str, value: int | None) -> None:
    """Sets a field of any pointer type; c_void_p takes the number as it is."""
    kinds = {field: kind for each in type(binding).__mro__ for field, kind, *_ in
             getattr(each, "_fields_", ())}  # fmt: skip
    kind = kinds[name]
    setattr(binding, name, value if kind is c_void_p else ctypes.cast(c_void_p(value), kind))


# The runtime's images: colours with their one conversion on the way, and depths.

WAIT_NS = 1_000_000_000  # for an image that the runtime still reads


@dataclass(frozen=True)
class SwapchainFormat:
    """A format of OpenGL; `linear`: runtimes take its values for light, not for display values."""

    gl: int
    name: str
    linear: bool
    dtype: str  # moderngl's


# The order of wanting: eight bits that are display values hold all that our pictures hold;
# of light, eight bits would show bands in the dark.
FORMATS = (
    SwapchainFormat(0x8C43, "SRGB8_ALPHA8", False, "f1"),
    SwapchainFormat(0x881A, "RGBA16F", True, "f2"),
    SwapchainFormat(0x805B, "RGBA16", True, "f2"),
    SwapchainFormat(0x8C3A, "R11F_G11F_B10F", True, "f2"),
    SwapchainFormat(0x8059, "RGB10_A2", True, "f1"),
    SwapchainFormat(0x8058, "RGBA8", True, "f1"),
)


def choose_format(
    offered: list[int], wanted: str = "", formats: Sequence[SwapchainFormat] = FORMATS
) -> SwapchainFormat:
    """The best of `formats` among the runtime's, or the one that is named; ValueError for none."""
    known = [each for each in formats if each.gl in offered]
    if wanted:
        known = [each for each in known if each.name == wanted]
    if not known:
        names = ", ".join(hex(each) for each in offered)
        raise ValueError(f"no format of {wanted or 'ours'} among the runtime's ({names}).")
    return known[0]


# Of depth, the finest first: floats keep what is far apart.
DEPTH_FORMATS = (
    SwapchainFormat(0x8CAC, "DEPTH_COMPONENT32F", True, "f4"),
    SwapchainFormat(0x81A6, "DEPTH_COMPONENT24", True, "f4"),
    SwapchainFormat(0x81A5, "DEPTH_COMPONENT16", True, "f4"),
)


class Images:
    """Images of (width, height) pixels of the runtime's, and their turn-taking."""

    def __init__(
        self,
        instance: Instance,
        session: Any,
        ctx: moderngl.Context,
        size: tuple[int, int],
        pixels: SwapchainFormat,
    ) -> None:
        xr = self._xr = instance.xr
        self.size, self.pixels, self._ctx = size, pixels, ctx
        self._instance = instance
        use = xr.SwapchainUsageFlags
        deep = pixels in DEPTH_FORMATS
        drawn = use.DEPTH_STENCIL_ATTACHMENT_BIT if deep else use.COLOR_ATTACHMENT_BIT
        info = xr.SwapchainCreateInfo(
            usage_flags=drawn | use.SAMPLED_BIT,
            format=pixels.gl, sample_count=1, width=size[0], height=size[1],
            face_count=1, array_size=1, mip_count=1,
        )  # fmt: skip
        try:
            with instance.asked("make images for an eye"):
                self.handle = xr.create_swapchain(session, info)
        except xr.exception.SwapchainFormatUnsupportedError:
            raise NoHeadset(f"{instance.runtime} refuses its own format {pixels.name}.") from None
        ctx.__enter__()  # SteamVR on Linux leaves its own context current here
        images = xr.enumerate_swapchain_images(self.handle, xr.SwapchainImageOpenGLKHR)
        self.textures = [int(image.image) for image in images]  # GL's names

    @contextmanager
    def acquired(self) -> Iterator[int]:
        """Within it the image of that number is ours; afterwards the runtime has it."""
        xr = self._xr
        with self._instance.asked("take a picture"):
            number = xr.acquire_swapchain_image(self.handle, xr.SwapchainImageAcquireInfo())
            xr.wait_swapchain_image(self.handle, xr.SwapchainImageWaitInfo(timeout=WAIT_NS))
            self._ctx.__enter__()  # as above
            yield number
            xr.release_swapchain_image(self.handle, xr.SwapchainImageReleaseInfo())

    @property
    def whole(self) -> Any:
        """The latest image that was handed over, as layers name it."""
        xr = self._xr
        rect = xr.Rect2Di(xr.Offset2Di(0, 0), xr.Extent2Di(*self.size))
        return xr.SwapchainSubImage(self.handle, rect, 0)

    def close(self) -> None:
        """The textures are the runtime's."""
        try:
            self._xr.destroy_swapchain(self.handle)
        except self._xr.exception.ErrorResult:
            pass  # lost with its session


class Swapchain(Images):
    """Colours: the picture of an eye, or of a layer."""

    def __init__(self, *made: Any) -> None:
        super().__init__(*made)
        self._framebuffers = [
            self._ctx.framebuffer(
                [self._ctx.external_texture(texture, self.size, 4, 0, self.pixels.dtype)]
            )
            for texture in self.textures
        ]

    def show(self, texture: moderngl.Texture, shown: Blit, keep: bool = False):
        """Hands a display-encoded picture over, row 0 at the bottom.

        With `keep` the runtime's image is read back, (H, W, 4) float32 with row 0 on top and the
        values that lie in it; else None.
        """
        with self.acquired() as number:
            framebuffer = self._framebuffers[number]
            framebuffer.viewport = (0, 0, *self.size)
            shown.draw(texture, framebuffer, linear=self.pixels.linear)
            return read_color(framebuffer, 4) if keep else None

    def close(self) -> None:
        for framebuffer in self._framebuffers:
            framebuffer.release()
        super().close()


class DepthSwapchain(Images):
    """Depths of an eye's picture, 0 at near and 1 at far."""

    def __init__(self, *made: Any) -> None:
        super().__init__(*made)
        self._made = DepthFramebuffers(self._ctx)
        self._framebuffers = [self._made.around(texture) for texture in self.textures]

    def fill(self, write: Callable[[moderngl.Framebuffer], None], keep: bool = False):
        """Hands over what `write` draws; with `keep` also returns it, (H, W) float32, row 0 on top,
        else None.
        """
        with self.acquired() as number:
            framebuffer = self._framebuffers[number]
            framebuffer.viewport = (0, 0, *self.size)
            write(framebuffer)
            return read_depth(framebuffer, self.size) if keep else None

    def close(self) -> None:
        self._made.release()
        super().close()


def read_color(framebuffer: moderngl.Framebuffer, parts: int = 3) -> np.ndarray:
    """(H, W, parts) float32 of what lies in it, row 0 on top."""
    width, height = framebuffer.size
    data = framebuffer.read(components=parts, alignment=1, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(height, width, parts)[::-1]


def read_depth(framebuffer: moderngl.Framebuffer, size: tuple[int, int]) -> np.ndarray:
    """(H, W) float32 of its depth, row 0 on top."""
    width, height = size
    area = (0, 0, width, height)
    data = framebuffer.read(area, components=1, attachment=-1, alignment=1, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(height, width)[::-1]


# Framebuffers around depth textures of the runtime: the few calls of GL that moderngl lacks.

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
