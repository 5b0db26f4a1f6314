"""The real window: glfw through moderngl-window, ImGui on top, input as a list of plain events."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import glfw
import moderngl
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.clean_texts import clean_texts
from shapeshift.app.editor.panels.widgets.overlay_renderer import Textures
from shapeshift.app.editor.state.user.settings import default_text_size
from shapeshift.app.editor.window.monitor import Place, monitor_height, open_window, stand_window
from shapeshift.app.editor.window.overlay.presented import Presented
from shapeshift.app.paths import plain
from shapeshift.runtime_models.files.plain_text import one_line

BUTTONS = {0: "left", 1: "right", 2: "middle"}
DOUBLE_CLICK_S = 0.3
CLICK_PIXELS = 4.0  # a press that moves further is a drag, not a click
SETTLE_FRAMES = 3  # ImGui hands out queued input over this many frames
HIDDEN_S = 0.5  # between two looks at what has become of a hidden window; events wake it at once
HOVER_S = 0.35  # after the mouse came to rest tooltips are due, so there is a frame for them
MODIFIERS = {
    imgui.Key.mod_shift: (glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT),
    imgui.Key.mod_ctrl: (glfw.KEY_LEFT_CONTROL, glfw.KEY_RIGHT_CONTROL),
    imgui.Key.mod_alt: (glfw.KEY_LEFT_ALT, glfw.KEY_RIGHT_ALT),
}
TEXT_KEYS = {  # what typing a number into a slider needs
    glfw.KEY_LEFT: imgui.Key.left_arrow, glfw.KEY_RIGHT: imgui.Key.right_arrow,
    glfw.KEY_HOME: imgui.Key.home, glfw.KEY_END: imgui.Key.end,
    glfw.KEY_DELETE: imgui.Key.delete, glfw.KEY_BACKSPACE: imgui.Key.backspace,
    glfw.KEY_ENTER: imgui.Key.enter, glfw.KEY_KP_ENTER: imgui.Key.enter,
    glfw.KEY_ESCAPE: imgui.Key.escape, glfw.KEY_TAB: imgui.Key.tab,
    glfw.KEY_A: imgui.Key.a, glfw.KEY_C: imgui.Key.c,
    glfw.KEY_V: imgui.Key.v, glfw.KEY_X: imgui.Key.x,
    glfw.KEY_Y: imgui.Key.y, glfw.KEY_Z: imgui.Key.z,
}  # fmt: skip
SHORTCUTS = ("z", "y", "s", "d", "o", "n", "+", "=", "-", "0")  # with Ctrl, as printed on the key
REPEATING = (glfw.KEY_LEFT, glfw.KEY_RIGHT)  # held down they go on
MOVING = (glfw.KEY_W, glfw.KEY_A, glfw.KEY_S, glfw.KEY_D, glfw.KEY_Q, glfw.KEY_E)


@dataclass(frozen=True)
class KeyDown:
    key: int  # glfw.KEY_*: the physical key, named after what is printed there on a US keyboard
    shift: bool
    shortcut: str = ""  # one of SHORTCUTS, with Ctrl: the letter that is printed on the key
    ctrl: bool = False


@dataclass(frozen=True)
class Drag:
    button: str  # left, right or middle
    dx: float  # logical pixels since the last event, right and down positive
    dy: float
    x: float = 0.0  # logical pixels from the top left, where it is now
    y: float = 0.0


@dataclass(frozen=True)
class Press:
    button: str  # left, right or middle
    x: float  # logical pixels from the top left
    y: float


@dataclass(frozen=True)
class Release:
    button: str


@dataclass(frozen=True)
class Wheel:
    notches: float


@dataclass(frozen=True)
class DoubleClick:
    x: float  # logical pixels from the top left
    y: float


@dataclass(frozen=True)
class Drop:
    paths: tuple[Path, ...]


Event = KeyDown | Press | Drag | Release | Wheel | DoubleClick | Drop


class Window:
    """An open window with a GL 4.3 context and an ImGui overlay; use it in a `with`.

    `events` is what the scene gets: input that the overlay wants for itself is not in it.
    """

    def __init__(self, title: str, size: tuple[int, int], text_size: float | None = None) -> None:
        self._window = open_window(title, size)
        self.handle = self._window._window  # glfw's own, private in moderngl-window
        self._window.exit_key = None  # Escape belongs to the overlay
        self.ctx: moderngl.Context = self._window.ctx
        clean_texts()
        self._imgui = imgui.create_context()
        imgui.get_io().set_ini_filename("")  # leaves no imgui.ini behind
        self._chosen_size = text_size  # None: by the monitor
        self._monitor_size = self._size_for_monitor()
        theme.apply(self.ui_scale)
        self._restyle = False  # the next frame's type has another size
        self.every_letter = False  # of all languages: their list has been opened
        self.presented = Presented(self.ctx, lambda: self.size)
        self.textures = Textures(self.ctx, self.presented.renderer)
        self.covered: tuple[theme.Box, ...] = ()  # where the overlay is, set by who draws it
        self.popup_open = False  # a list or a box is open, and the next click is for it
        # Heard first: a key or the left button (None) is down, the button is up; a frame is drawn.
        self.on_press: Callable[[int | None], None] = lambda key: None
        self.on_release: Callable[[], None] = lambda: None
        self.on_drawn: Callable[[imgui.ImDrawData], None] = lambda data: None
        self._raw: list[Event] = []
        self._chorded: set[int] = set()  # keys that are down for a shortcut, not for moving
        self._pressed: str | None = None  # the button whose drag the scene owns
        self._cursor, self._last_click = (0.0, 0.0), (0.0, 0.0, -1.0)  # x, y; and seconds
        self._unsettled, self._look_again = SETTLE_FRAMES, np.inf  # frames; seconds by glfw
        self._clock = glfw.get_time()
        self._listen()

    def __enter__(self) -> "Window":
        return self

    def __exit__(self, *failure) -> None:
        self.presented.release()
        imgui.destroy_context(self._imgui)
        self._window.destroy()

    @property
    def size(self) -> tuple[int, int]:
        """Framebuffer pixels."""
        return self._window.buffer_size

    @property
    def ui_scale(self) -> float:
        """Logical pixels a unit of the overlay: what the desktop asks for, times the text size."""
        return self._desktop_scale * self.text_size

    @property
    def _desktop_scale(self) -> float:
        """What is set for the monitor; where input is in finer units already (macOS), 1."""
        content = glfw.get_window_content_scale(self.handle)[0]
        return max(1.0, content / self._window.pixel_ratio)

    @property
    def text_size(self) -> float:
        """1: as large as the desktop asks for."""
        return self._chosen_size or self._monitor_size

    @text_size.setter
    def text_size(self, size: float | None) -> None:
        """None: as the monitor asks for."""
        self._chosen_size = size
        self.restyle()

    def restyle(self, every_letter: bool = False) -> None:
        """The next frame has other letters: another language, or those of all from now on."""
        self._restyle = True
        self.every_letter |= every_letter
        self.note()

    def _size_for_monitor(self) -> float:
        """What the monitor under the window asks for, where nobody has chosen a size."""
        high_px, high_mm = monitor_height(self.handle)
        return default_text_size(high_px / self._window.pixel_ratio, high_mm, self._desktop_scale)

    @property
    def logical_size(self) -> tuple[int, int]:
        """What input and overlay are measured in."""
        return self._window.size

    def stand(self, place: Place | None) -> bool:
        """Where it was before, or as large as its text; True: the desktop has less room."""
        return stand_window(self.handle, place, self.text_size)

    @property
    def closing(self) -> bool:
        return self._window.is_closing

    @property
    def hidden(self) -> bool:
        """Whether nobody can see it: minimised, or not on the screen at all."""
        gone = glfw.get_window_attrib(self.handle, glfw.ICONIFIED)
        return bool(gone) or not glfw.get_window_attrib(self.handle, glfw.VISIBLE) or 0 in self.size

    def close(self) -> None:
        self._window.is_closing = True

    def keep_open(self) -> None:
        """Takes back that somebody has asked to close it; minimised, it comes back to say why."""
        self._window.is_closing = False
        if glfw.get_window_attrib(self.handle, glfw.ICONIFIED):
            glfw.restore_window(self.handle)

    @property
    def cursor(self) -> tuple[float, float]:
        """Where the mouse is, logical pixels from the top left."""
        return self._cursor

    @property
    def on_scene(self) -> bool:
        """Whether the mouse is over the picture rather than over the overlay."""
        return not self._over_overlay(*self._cursor)

    @property
    def title(self) -> str:
        """What stands in its bar."""
        return self._window.title

    def set_title(self, title: str) -> None:
        self._window.title = one_line(title)

    def held(self, key: int) -> bool:
        """Whether a key is down right now and not typed into the overlay."""
        busy = imgui.get_io().want_text_input or key in self._chorded
        return not busy and glfw.get_key(self.handle, key) == glfw.PRESS

    def wait(self, seconds: float) -> bool:
        """Takes input, sleeping up to that long for it; True when the overlay must be redrawn.

        A hidden window sleeps HIDDEN_S whatever is asked, and nothing of it must be redrawn.
        """
        if self.hidden:
            glfw.wait_events_timeout(HIDDEN_S)
            return False
        seconds = min(seconds, self._look_again - glfw.get_time())
        if self._unsettled > 0 or seconds <= 0:
            glfw.poll_events()
        else:
            glfw.wait_events_timeout(seconds)
        if glfw.get_time() >= self._look_again:
            self._look_again = np.inf
            self.note()
        return self._unsettled > 0

    def begin_frame(self, early: bool = False) -> list[Event]:
        """Starts an overlay frame; returns the input since the last one that is for the scene.

        `early`: there is no scene yet, so the first frame that has one is given it.
        """
        if self._restyle:
            self._restyle = False
            theme.apply(self.ui_scale, every_letter=self.every_letter)
        io = imgui.get_io()
        io.display_size = imgui.ImVec2(*self.logical_size)
        io.display_framebuffer_scale = imgui.ImVec2(*[self._window.pixel_ratio] * 2)
        now = glfw.get_time()
        io.delta_time = max(now - self._clock, 1e-4)
        self._clock = now
        for modifier, keys in MODIFIERS.items():
            down = any(glfw.get_key(self.handle, key) == glfw.PRESS for key in keys)
            io.add_key_event(modifier, down)
        self._unsettled = max(self._unsettled - 1, 0)
        imgui.new_frame()
        if self.popup_open and imgui.is_key_pressed(imgui.Key.escape, False):
            imgui.internal.close_popups_except_modals()  # ImGui does so by its own keys alone
        events, self._raw = self._raw, self._raw if early else []
        return events

    def end_frame(self) -> None:
        """Draws the overlay over whatever the scene has drawn into `screen()`."""
        self.popup_open = imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
        imgui.render()
        self.presented.lay_over(imgui.get_draw_data())
        self.on_drawn(imgui.get_draw_data())

    def screen(self) -> moderngl.Framebuffer:
        """The window's framebuffer with the viewport on all of it."""
        return self.presented.screen()

    def swap(self) -> None:
        self.presented.swap(self.handle)

    def picture(self) -> np.ndarray:
        """(H, W, 3) uint8 of all that has been drawn and not yet swapped, row 0 on top."""
        return self.presented.read()

    def _listen(self) -> None:
        """Registers the callbacks; each only notes what happened."""
        handle = self.handle
        glfw.set_key_callback(handle, self.on_key)
        glfw.set_char_callback(handle, self.on_char)
        glfw.set_cursor_pos_callback(handle, self.on_cursor)
        glfw.set_mouse_button_callback(handle, self.on_button)
        glfw.set_scroll_callback(handle, self.on_scroll)
        # The annotations of glfw say (window, int, str); what comes is (window, list of paths).
        glfw.set_drop_callback(handle, self.on_drop)  # type: ignore[arg-type]
        glfw.set_window_refresh_callback(handle, lambda _: self.expose())
        glfw.set_framebuffer_size_callback(handle, lambda *_: self.expose())
        glfw.set_window_content_scale_callback(handle, self._on_content_scale)

    def note(self, event: Event | None = None) -> None:
        """Something of the overlay has changed, by an event or by itself: it is drawn."""
        self._unsettled = SETTLE_FRAMES
        if event is not None:
            self._raw.append(event)

    def expose(self) -> None:
        """The screen has lost what the window showed."""
        self.presented.due = True
        self.note()

    def on_key(self, handle, key: int, scancode: int, action: int, mods: int) -> None:
        io = imgui.get_io()
        self.note()
        if key in TEXT_KEYS:
            io.add_key_event(TEXT_KEYS[key], action != glfw.RELEASE)
        if action == glfw.RELEASE:
            self._chorded.discard(key)
        repeats = action == glfw.REPEAT and key not in REPEATING
        typed = io.want_text_input and not glfw.KEY_F1 <= key <= glfw.KEY_F25
        if action == glfw.RELEASE or typed or repeats:
            return
        if key == glfw.KEY_F11:
            self._window.fullscreen = not self._window.fullscreen
        if key == glfw.KEY_ESCAPE and self.popup_open:
            return  # for what is open
        self.on_press(key)
        shortcut = self._shortcut(key, scancode, mods)
        if shortcut:
            self._chorded.add(key)
        ctrl = bool(mods & (glfw.MOD_CONTROL | glfw.MOD_SUPER))
        self.note(KeyDown(key, bool(mods & glfw.MOD_SHIFT), shortcut, ctrl))

    def _shortcut(self, key: int, scancode: int, mods: int) -> str:
        """The letter of a shortcut; "" while keys are held to move, where Ctrl means slowly."""
        moving = any(other != key and self.held(other) for other in MOVING)
        letter = (glfw.get_key_name(key, scancode) or "").lower()
        with_ctrl = mods & (glfw.MOD_CONTROL | glfw.MOD_SUPER)
        return letter if with_ctrl and letter in SHORTCUTS and not moving else ""

    def on_char(self, handle, codepoint: int) -> None:
        imgui.get_io().add_input_character(codepoint)
        self.note()

    def on_cursor(self, handle, x: float, y: float) -> None:
        imgui.get_io().add_mouse_pos_event(x, y)
        dx, dy = x - self._cursor[0], y - self._cursor[1]
        self._cursor = (x, y)
        self._look_again = glfw.get_time() + HOVER_S
        self.note(Drag(self._pressed, dx, dy, x, y) if self._pressed else None)

    def on_button(self, handle, button: int, action: int, mods: int) -> None:
        if button not in BUTTONS:
            return
        io, (x, y) = imgui.get_io(), self._cursor
        if button == glfw.MOUSE_BUTTON_LEFT:
            self.on_press(None) if action == glfw.PRESS else self.on_release()
        io.add_mouse_button_event(button, action == glfw.PRESS)
        self.note()
        if action == glfw.RELEASE:
            if self._pressed == BUTTONS[button]:
                self._pressed = None
                self.note(Release(BUTTONS[button]))
            return
        if self._over_overlay(x, y):
            self._last_click = (x, y, -1.0)  # clicks with one on a panel between are two clicks
            return
        if self._pressed is not None:  # one button at a time: who had the first one hears its end
            self.note(Release(self._pressed))
        self._pressed = BUTTONS[button]
        self.note(Press(BUTTONS[button], x, y))
        if button == glfw.MOUSE_BUTTON_LEFT:
            last_x, last_y, when = self._last_click
            close = abs(x - last_x) + abs(y - last_y) <= CLICK_PIXELS
            now = glfw.get_time()
            if close and 0 <= now - when <= DOUBLE_CLICK_S and when >= 0:
                self.note(DoubleClick(x, y))
                now = -1.0  # a third click starts anew
            self._last_click = (x, y, now)

    def on_scroll(self, handle, dx: float, dy: float) -> None:
        imgui.get_io().add_mouse_wheel_event(dx, dy)
        self.note(None if self._over_overlay(*self._cursor) else Wheel(dy))

    def _on_content_scale(self, handle, x: float, y: float) -> None:
        """The desktop's scale has changed, or the window has gone to another monitor."""
        self._monitor_size = self._size_for_monitor()
        self.restyle()

    def on_drop(self, handle, paths: list[str]) -> None:
        self.note(Drop(tuple(map(plain, paths))))

    def _over_overlay(self, x: float, y: float) -> bool:
        """Whether the overlay takes input at that place.

        Not ImGui's want_capture_mouse: it is of the last frame and of the place where the mouse
        was then, which may be 100 ms ago where there is no GPU.
        """
        inside = (left <= x < right and top <= y < low for left, top, right, low in self.covered)
        return self.popup_open or any(inside)
