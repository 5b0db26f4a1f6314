"""A person at the window: real mouse and keys by XTEST, eyes on the screen's pixels.

They live in a thread beside the program's own loop; buttons are found by their words among what is
drawn.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import glfw
from imgui_bundle import imgui
from Xlib import XK, X
from Xlib.display import Display
from Xlib.ext import xtest

SIZE = (1280, 720)
PANEL, MOST_TURNS = (150.0, 400.0), 12  # where the wheel is turned; so often for one item
SECOND = 1.0
PATIENCE_S = 60.0  # for a window on a busy machine to draw what it has to
KINDS = ("button", "checkbox", "selectable", "combo", "invisible_button", "tree_node_ex",
         "arrow_button", "input_text", "slider_float", "slider_int")  # fmt: skip


@contextmanager
def screen() -> Iterator[str]:
    """The name of an X display in memory."""
    read_end, write_end = os.pipe()
    words = ["Xvfb", "-displayfd", str(write_end), "-screen", "0", "{}x{}x24".format(*SIZE)]
    server = subprocess.Popen(words, pass_fds=[write_end], stderr=subprocess.DEVNULL)
    os.close(write_end)
    with os.fdopen(read_end) as pipe:
        number = pipe.readline().strip()
    try:
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


class Items:
    """Where what can be pressed was drawn last, by its words in English."""

    def __init__(self) -> None:
        self.places: dict[str, tuple[float, float, int]] = {}  # x, y, number of the frame
        self.newest = 0
        for kind in KINDS:
            setattr(imgui, kind, self._watched(getattr(imgui, kind)))

    def _watched(self, function: Callable) -> Callable:
        def call(label: str, *values, **named):
            done = function(label, *values, **named)
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            if imgui.is_rect_visible(low, high):
                word = label.rpartition("###")[2] if "###" in label else label
                middle = (low.x + high.x) / 2, (low.y + high.y) / 2
                self.newest = imgui.get_frame_count()
                self.places[word] = (*middle, self.newest)
            return done

        return call


@dataclass
class Job:
    """What was counted of one."""

    name: str
    actions: int = 0
    silent: list[str] = field(default_factory=list)
    done: bool = False
    cpu_s: float = 0.0  # of the program, from the first press to the result


class Person:
    """Hands and eyes, in a thread beside the program's own."""

    def __init__(self, viewer, display: str, items: Items) -> None:
        self.viewer, self.items = viewer, items
        self._x = Display(display)
        self.job = Job("")
        self.rounds, self._scrolled = 0, False
        viewer.window.wait = self._count_rounds(viewer.window.wait)
        self._corner = glfw.get_window_pos(viewer.window.handle)  # of the window on the screen

    def begin(self, job: Job) -> None:
        """What is pressed from now on is of that."""
        self.job, self._scrolled = job, False

    # ---- eyes

    def look(self) -> bytes:
        """All pixels of the screen, which the window fills."""
        image = self._x.screen().root.get_image(0, 0, *SIZE, X.ZPixmap, 0xFFFFFFFF)
        return image.data

    def rest(self, least_s: float = 0.5) -> None:
        """Until the window has drawn all that it has been asked for, and explanations are up."""
        began, rounds = time.monotonic(), self.rounds
        while time.monotonic() - began < PATIENCE_S:
            time.sleep(0.03)
            if self.rounds >= rounds + 3 and time.monotonic() - began >= least_s:
                return

    def _count_rounds(self, wait: Callable[[float], bool]) -> Callable[[float], bool]:
        """The window's wait: each time that it has nothing more to draw is a round."""

        def counted(seconds: float) -> bool:
            redraw = wait(seconds)
            self.rounds += not redraw
            return redraw

        return counted

    def until(self, holds: Callable[[], bool], seconds: float = 300.0) -> bool:
        end = time.monotonic() + seconds
        while not holds() and time.monotonic() < end:
            time.sleep(0.05)
        return holds()

    # ---- hands

    def _go(self, x: float, y: float) -> None:
        left, top = self._corner
        xtest.fake_input(self._x, X.MotionNotify, x=left + round(x), y=top + round(y))
        self._x.sync()

    def move(self, x: float, y: float) -> None:
        self._go(x, y)
        self.rest()

    def _watched(self, what: str, act: Callable[[], None]) -> None:
        """A press, and whether anything differs after it."""
        self.job.actions += 1
        before = self.look()
        act()
        pressed = time.monotonic()
        while time.monotonic() - pressed < SECOND:
            time.sleep(0.05)
            if self.look() != before and time.monotonic() - pressed > 0.3:
                return
        self.rest()
        if self.look() == before:
            self.job.silent.append(what)
            sys.stderr.write(f"{self.job.name}: silent: {what}\n")

    def _button(self, down: bool) -> None:
        xtest.fake_input(self._x, X.ButtonPress if down else X.ButtonRelease, 1)
        self._x.sync()

    def click(self, x: float, y: float, what: str) -> None:
        self.move(x, y)

        def act() -> None:
            self._button(True)
            time.sleep(0.08)
            self._button(False)

        self._watched(what, act)
        self.rest()

    def press(self, word: str) -> None:
        """An item by its words."""
        for _ in range(MOST_TURNS):
            found = self.items.places.get(word)
            if found is not None and found[2] >= self.items.newest - 1:
                self.click(found[0], found[1], f"click {word}")
                return
            self._scroll()
        raise SystemExit(f"{self.job.name}: nothing is called '{word}' among what is drawn")

    def _scroll(self) -> None:
        """The wheel over the panel, down; all of it is one action."""
        self.job.actions += not self._scrolled
        self._scrolled = True
        self.move(*PANEL)
        for _ in range(3):
            for kind in (X.ButtonPress, X.ButtonRelease):
                xtest.fake_input(self._x, kind, 5)
        self._x.sync()
        self.rest()

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.move(*start)

        def act() -> None:
            self._button(True)
            for step in range(1, 9):
                part = step / 8
                x, y = (a + (b - a) * part for a, b in zip(start, end, strict=True))
                self._go(x, y)
                time.sleep(0.06)
            self._button(False)

        self._watched("drag", act)
        self.rest()

    def strike(self, name: str, *held: str) -> None:
        codes = [self._x.keysym_to_keycode(XK.string_to_keysym(each)) for each in (*held, name)]
        for code in codes:
            xtest.fake_input(self._x, X.KeyPress, code)
        self._x.sync()
        time.sleep(0.08)
        for code in reversed(codes):
            xtest.fake_input(self._x, X.KeyRelease, code)
        self._x.sync()

    def key(self, name: str, *held: str) -> None:
        self._watched("+".join((*held, name)), lambda: self.strike(name, *held))
        self.rest()

    def type(self, text: str) -> None:
        """A word: one action."""
        names = {"/": "slash", ".": "period", "-": "minus", "_": "underscore"}

        def act() -> None:
            for letter in text:
                shifted = letter.isupper() or letter == "_"
                self.strike(names.get(letter, letter), *["Shift_L"] * shifted)

        self._watched(f"type {text}", act)
        self.rest()
