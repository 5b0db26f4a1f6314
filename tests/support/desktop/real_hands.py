"""A mouse and a keyboard for the tests of the window: events that the X server itself sends.

XTEST moves the pointer and presses buttons and keys as a device would, so that an event goes the
whole way: server, GLFW, our callbacks, ImGui.
"""

import time
from types import TracebackType

import glfw
from Xlib import XK, X
from Xlib.display import Display
from Xlib.ext import xtest

from shapeshift.app.editor.window import window
from tests.support.desktop.desktop_stand import run_frames

PATIENCE_S = 5.0  # longest wait until an event has come through
BUTTONS = {"left": 1, "middle": 2, "right": 3}


class RealHands:
    """The pointer and the keys of the display on which a viewer's window lies.

    Its clicks are clicks however quickly they come: on a fast machine two at one place would be a
    double click, on a slow one not.
    """

    def __init__(self, viewer, display: str) -> None:
        self.viewer = viewer
        self._display = Display(display)
        # On a busy machine a key stays down long enough for the server to repeat it.
        self._display.change_keyboard_control(auto_repeat_mode=X.AutoRepeatModeOff)

    def __enter__(self) -> "RealHands":
        self._usual_s, window.DOUBLE_CLICK_S = window.DOUBLE_CLICK_S, -1.0
        return self

    def __exit__(
        self, kind: type | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        window.DOUBLE_CLICK_S = self._usual_s
        self._display.close()

    def move(self, x: float, y: float) -> None:
        """The pointer goes to logical pixels from the window's upper left."""
        left, top = glfw.get_window_pos(self.viewer.window.handle)
        x, y = round(x), round(y)
        xtest.fake_input(self._display, X.MotionNotify, x=left + x, y=top + y)
        self._settle()
        assert self.viewer.window.cursor == (x, y), "the pointer did not arrive"

    def button(self, down: bool, name: str = "left") -> None:
        kind = X.ButtonPress if down else X.ButtonRelease
        xtest.fake_input(self._display, kind, BUTTONS[name])
        self._settle()

    def click(self, x: float, y: float) -> None:
        self.move(x, y)
        self.button(True)
        self.button(False)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 6) -> None:
        """Press at one place, go evenly to the other, let go there."""
        self.move(*start)
        self.button(True)
        for step in range(1, steps + 1):
            part = step / steps
            self.move(*(a + (b - a) * part for a, b in zip(start, end, strict=True)))
        self.button(False)

    def flick(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press, move and let go before the program draws another frame."""
        left, top = glfw.get_window_pos(self.viewer.window.handle)
        self.move(*start)
        xtest.fake_input(self._display, X.ButtonPress, BUTTONS["left"])
        for part in (0.3, 0.7, 1.0):
            x, y = (round(a + (b - a) * part) for a, b in zip(start, end, strict=True))
            xtest.fake_input(self._display, X.MotionNotify, x=left + x, y=top + y)
        xtest.fake_input(self._display, X.ButtonRelease, BUTTONS["left"])
        self._settle()

    def key(self, name: str, *held: str) -> None:
        """One press of a key by its X name ("Left", "KP_1", "s") while others are held."""
        for modifier in held:
            self.hold_key(modifier, True)
        self.hold_key(name, True)
        self.hold_key(name, False)
        for modifier in reversed(held):
            self.hold_key(modifier, False)

    def type(self, text: str) -> None:
        names = {".": "period", " ": "space", ",": "comma", "/": "slash", "-": "minus"}
        for letter in text:
            shifted = letter.isupper() or letter == "_"
            name = "minus" if letter == "_" else names.get(letter, letter)
            self.key(name, *["Shift_L"] * shifted)

    def hold_key(self, name: str, down: bool) -> None:
        code = self._display.keysym_to_keycode(XK.string_to_keysym(name))
        assert code, f"the keyboard has no {name}"
        xtest.fake_input(self._display, X.KeyPress if down else X.KeyRelease, code)
        self._settle()

    def _settle(self) -> None:
        """Until the window has had the event and the overlay has drawn what follows from it."""
        self._display.sync()
        end = time.monotonic() + PATIENCE_S
        for _ in range(3):
            run_frames(self.viewer, 1)
        # Frames that ImGui still needs: to the eye the window may look settled before.
        while self.viewer.window._unsettled > 0 and time.monotonic() < end:
            run_frames(self.viewer, 1)
