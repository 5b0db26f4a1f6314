"""The monitor on which a window lies, as glfw tells of it."""

import glfw


def monitor_height(handle: object) -> tuple[float, float]:
    """Pixels and millimetres of the monitor that most of a window lies on; 0 for none."""
    monitor = _monitor_of(handle)
    if monitor is None:
        return 0.0, 0.0
    return glfw.get_video_mode(monitor).size.height, glfw.get_monitor_physical_size(monitor)[1]


def work_area(handle: object) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of what bars of the desktop leave of it; zeros for none."""
    monitor = _monitor_of(handle)
    if monitor is None:
        return 0, 0, 0, 0
    left, top, width, height = glfw.get_monitor_workarea(monitor)
    return left, top, left + width, top + height


def _monitor_of(handle: object) -> object | None:
    """The monitor that most of a window lies on."""
    left, top = glfw.get_window_pos(handle)
    width, height = glfw.get_window_size(handle)

    def shared(monitor: object) -> int:
        """Square pixels of the window that the monitor shows."""
        x, y = glfw.get_monitor_pos(monitor)
        size = glfw.get_video_mode(monitor).size
        across = min(left + width, x + size.width) - max(left, x)
        down = min(top + height, y + size.height) - max(top, y)
        return max(across, 0) * max(down, 0)

    return max(glfw.get_monitors(), key=shared, default=None)
