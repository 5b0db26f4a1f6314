"""The monitor on which a window lies, as glfw tells of it."""

from typing import Any

import glfw


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
    left, top = glfw.get_window_pos(handle)
    width, height = glfw.get_window_size(handle)

    def shared(monitor: Any) -> int:
        """Square pixels of the window that the monitor shows."""
        x, y = glfw.get_monitor_pos(monitor)
        size = glfw.get_video_mode(monitor).size
        across = min(left + width, x + size.width) - max(left, x)
        down = min(top + height, y + size.height) - max(top, y)
        return max(across, 0) * max(down, 0)

    return max(glfw.get_monitors(), key=shared, default=None)
