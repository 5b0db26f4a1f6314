"""Where VR has its GL context from: a window that shows what the headset sees, or none at all."""

from collections.abc import Iterator
from contextlib import contextmanager

import glfw
import moderngl

from shapeshift.renderer.gl.context import NEEDED, NoContext, open_context
from shapeshift.vr.shown import Blit, Inset, draw_eye

TITLE = "Shapeshift in the headset"
SIZE = (960, 720)
WITHOUT_WINDOW = ("egl", "surfaceless")  # contexts that runtimes take; not OSMesa's


class Mirror:
    """A window with the left eye's picture; waits for no screen, so the headset sets the pace."""

    def __init__(self, visible: bool) -> None:
        self._handle = _open_window(visible)
        self._visible = visible
        glfw.make_context_current(self._handle)
        glfw.swap_interval(0)
        self.ctx: moderngl.Context = moderngl.create_context(require=NEEDED)
        self._shown = Blit(self.ctx)

    @property
    def closing(self) -> bool:
        """Whether the person at the desk wants to end it: the window's cross, or Escape."""
        pressed = glfw.get_key(self._handle, glfw.KEY_ESCAPE) == glfw.PRESS
        return pressed or bool(glfw.window_should_close(self._handle))

    def show(self, texture: moderngl.Texture, inset: Inset | None = None) -> None:
        """An eye's picture, its middle where the window has another shape, and its sharp inset."""
        glfw.poll_events()
        if not self._visible or glfw.get_window_attrib(self._handle, glfw.ICONIFIED):
            return
        width, height = glfw.get_framebuffer_size(self._handle)
        if not (width and height):
            return
        draw_eye(self._shown, self.ctx.screen, (width, height), texture, inset)
        glfw.swap_buffers(self._handle)

    def rest(self) -> None:
        """While the headset wants no frames."""
        glfw.poll_events()

    def close(self) -> None:
        self._shown.release()
        self.ctx.release()
        glfw.destroy_window(self._handle)


class NoMirror:
    """A context without a window, where there is no display."""

    closing = False

    def __init__(self) -> None:
        self.ctx = _open_without_window()

    def show(self, texture: moderngl.Texture, inset: Inset | None = None) -> None:
        pass

    def rest(self) -> None:
        pass

    def close(self) -> None:
        self.ctx.release()


@contextmanager
def open_mirror(display: bool, visible: bool) -> Iterator[Mirror | NoMirror]:
    """A mirror where there is a display, hidden if not `visible`; else only a context."""
    mirror = Mirror(visible) if display else NoMirror()
    try:
        yield mirror
    finally:
        mirror.close()


def _open_without_window() -> moderngl.Context:
    reasons = []
    for kind in WITHOUT_WINDOW:
        try:
            return open_context(kind)
        except NoContext as reason:
            reasons.append(f"{kind}: {reason}")
    raise NoContext(f"no GL context for a headset ({' '.join(reasons)})")


def _open_window(visible: bool):
    """A glfw window with a GL 4.3 core context, X11's where there is a choice: runtimes on Linux
    know no other.
    """
    supported = getattr(glfw, "platform_supported", None)  # not of GLFW 3.3, which has no choice
    if supported is not None and supported(glfw.PLATFORM_X11):
        glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_X11)
    if not glfw.init():
        raise NoContext("no window could be opened (glfw finds no display).")
    major, minor = divmod(NEEDED // 10, 10)
    for hint, value in (
        (glfw.CONTEXT_VERSION_MAJOR, major), (glfw.CONTEXT_VERSION_MINOR, minor),
        (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE), (glfw.VISIBLE, visible),
    ):  # fmt: skip
        glfw.window_hint(hint, value)
    window = glfw.create_window(*SIZE, TITLE, None, None)
    if not window:
        raise NoContext("no window with OpenGL 4.3 could be opened; update the graphics driver.")
    return window
