"""A window of the desktop as glfw opens it, the monitor on which it lies, and its place there."""

import warnings
from typing import Any

import glfw
import moderngl
from moderngl_window.context.glfw.window import Window as GlfwWindow

from shapeshift.renderer.gl.context import NoContext
from shapeshift.runtime_models.program import program

Place = tuple[int, int, int, int]  # left, top, width, height of a window on the desktop
LEAST_SEEN = 80  # pixels of a kept place, across and down, that a monitor has to show


def open_window(title: str, size: tuple[int, int]) -> GlfwWindow:
    """The glfw window, or NoContext in one sentence."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")  # pyGLFW reports through warnings
        try:
            return GlfwWindow(title=title, size=size, gl_version=(4, 3), vsync=True)
        except (ValueError, moderngl.Error, OSError) as error:
            reasons = [str(w.message).split(") ", 1)[-1].strip("'\" b") for w in said]
            reason = (reasons or [str(error)])[0].rstrip(".")
    raise NoContext(
        f"no window with OpenGL 4.3 could be opened ({reason}); "
        f"`{program()} headless` and `{program()} render` need none."
    )


def place_of(handle: Any) -> Place | None:
    """Where a window is; None: nowhere of its own, or the desktop does not tell."""
    filled = bool(glfw.get_window_monitor(handle))  # a pointer, which may be null
    hidden = glfw.get_window_attrib(handle, glfw.ICONIFIED)
    if filled or hidden or glfw.get_window_attrib(handle, glfw.MAXIMIZED) or not tells_places():
        return None
    return (*glfw.get_window_pos(handle), *glfw.get_window_size(handle))


def stand_window(handle: Any, place: Place | None, times: float) -> bool:
    """Where it was before; without that as many times larger as its text is, in the middle.

    Returns whether the desktop has less room than that takes, so that it is smaller.
    """
    if place is None:
        grow_window(handle, times)
        place = place_of(handle) or (0, 0, *glfw.get_window_size(handle))
    return put_window(handle, place)


def put_window(handle: Any, place: Place) -> bool:
    """Back to where it was, as large as there is room now; True where that is smaller.

    One that the monitors show whole, together, is left alone.  Else it goes onto the monitor that
    shows most of it, or, where none shows enough for a hand to take it, onto the first.
    """
    left, top, width, height = place
    areas = {work_area(monitor) for monitor in glfw.get_monitors()}
    known = tells_places() and any(_shows(area, place) for area in areas)
    if known and sum(_shared(area, place) for area in areas) >= width * height:
        glfw.set_window_size(handle, width, height)
        glfw.set_window_pos(handle, left, top)
        return False
    first = glfw.get_primary_monitor()
    if known:
        area = max(areas, key=lambda area: _shared(area, place))
    elif first:
        area = work_area(first)
    else:
        return False
    x, y, across, down = area
    edges = glfw.get_window_frame_size(handle)  # left, top, right, bottom; 0 where nobody tells
    wide = min(width, across - edges[0] - edges[2])
    high = min(height, down - edges[1] - edges[3])
    if not (wide >= LEAST_SEEN and high >= LEAST_SEEN):
        return False  # no work area that anybody could mean
    glfw.set_window_size(handle, wide, high)
    if known:
        right, low = x + across - edges[2] - wide, y + down - edges[3] - high
        at = (min(max(left, x + edges[0]), right), min(max(top, y + edges[1]), low))
        glfw.set_window_pos(handle, *at)
    elif tells_places():
        glfw.set_window_pos(handle, x + (across - wide) // 2, y + (down - high + edges[1]) // 2)
    return wide < width or high < height


def work_area(monitor: Any) -> Place:
    """What of the desktop a monitor leaves to windows."""
    left, top, width, height = glfw.get_monitor_workarea(monitor)
    return left, top, width, height


def _shows(area: Place, place: Place) -> bool:
    """Whether a work area shows enough of the upper edge of a place for a hand to take it."""
    left, top, width, _ = place
    x, y, across, down = area
    wide = min(left + width, x + across) - max(left, x)
    return wide >= LEAST_SEEN and y <= top <= y + down - LEAST_SEEN


def _shared(area: Place, place: Place) -> int:
    """Square pixels of a place that an area of the desktop shows."""
    left, top, width, height = place
    x, y, across, down = area
    wide = min(left + width, x + across) - max(left, x)
    high = min(top + height, y + down) - max(top, y)
    return max(wide, 0) * max(high, 0)


def monitor_height(handle: Any) -> tuple[float, float]:
    """Pixels and millimetres of the monitor that most of a window lies on; 0 for none."""
    monitor = _monitor_of(handle)
    if monitor is None:
        return 0.0, 0.0
    return glfw.get_video_mode(monitor).size.height, glfw.get_monitor_physical_size(monitor)[1]


def grow_window(handle: Any, times: float) -> None:
    """Makes a window larger, as far as the desktop leaves room, and puts it in the middle."""
    monitor = _monitor_of(handle)
    if monitor is None:
        return
    left, top, widest, highest = glfw.get_monitor_workarea(monitor)
    now = glfw.get_window_size(handle)
    width, height = min(round(now[0] * times), widest), min(round(now[1] * times), highest)
    if width > now[0] and height > now[1]:
        glfw.set_window_size(handle, width, height)
        if tells_places():
            glfw.set_window_pos(handle, left + (widest - width) // 2, top + (highest - height) // 2)


def tells_places() -> bool:
    """Whether a window may know and choose where on the desktop it is."""
    # GLFW 3.3, which imgui-bundle brings and which counts where that is loaded first, cannot be
    # asked: it is built for X11 alone.
    ask = getattr(glfw, "get_platform", None)
    return ask is None or ask() != glfw.PLATFORM_WAYLAND


def _monitor_of(handle: Any) -> Any:
    """The monitor that most of a window lies on; under Wayland, which does not tell, the first."""
    if not tells_places():
        return glfw.get_primary_monitor()
    place = (*glfw.get_window_pos(handle), *glfw.get_window_size(handle))

    def shared(monitor: Any) -> int:
        size = glfw.get_video_mode(monitor).size
        return _shared((*glfw.get_monitor_pos(monitor), size.width, size.height), place)

    return max(glfw.get_monitors(), key=shared, default=None)
