"""What a runtime wants to know of the GL context that is current: EGL, GLX (Xlib) or WGL."""

import ctypes
import sys
from ctypes import byref, c_char_p, c_int, c_void_p

from shapeshift.vr.openxr.instance import Instance, NoHeadset

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
