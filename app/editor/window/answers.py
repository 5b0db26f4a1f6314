"""No press without an answer: where a key or a click changes nothing, why so, and what would help.

A press is watched where it comes in, whatever it is for: what the window showed before it is
compared with what it shows two frames after it.  While all moves by itself, what the press changed
in the tools is compared instead.  A note that is there already is told with a count.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import fields, is_dataclass
from types import FunctionType, MethodType
from typing import NamedTuple

import glfw
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.panel_rows import LastTip
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.touch_state import NO_BODIES
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.overlay.triangles import read_lists
from shapeshift.app.editor.window.shown import FrameRequest
from shapeshift.app.editor.window.window import CLICK_PIXELS, MOVING, KeyDown, Window

FRAMES = 3  # after a press: it acts, what follows from that is drawn, what flashed is gone
NEAR = 1e-6  # of a number: nearer is the same place
QUIET = {  # held while others are pressed, or the desktop's
    glfw.KEY_UNKNOWN, glfw.KEY_CAPS_LOCK, glfw.KEY_NUM_LOCK, glfw.KEY_SCROLL_LOCK, glfw.KEY_F11,
    glfw.KEY_PRINT_SCREEN, glfw.KEY_PAUSE, glfw.KEY_MENU, *range(340, 348),
}  # fmt: skip
EMPTY = "Nothing is open: Ctrl+O opens a scene, or drop a file here."
WAITS = "A box waits for an answer; Esc takes it away."
NOTHING = "{key}: there is nothing to do by it now. F1 shows all keys."
NO_CHANGE = "Nothing changes by that now."
ONE_THING = "Drag to look about. What is open is one thing: O takes things out of it."
NOT_THERE = "Drag to look about. Nothing lies there to be chosen."
AT_VIEW = "The view is that already."
CHOOSE = "Nothing is chosen: click an object, or its name in Objects."


class Why(NamedTuple):
    """A row of the table of keys by state: said where one of the keys changes nothing."""

    keys: tuple[int, ...]
    words: str
    holds: Callable[[EditorState], bool] = lambda state: True


DIGITS = tuple(range(glfw.KEY_1, glfw.KEY_9 + 1))
BODIES = (glfw.KEY_R, glfw.KEY_X, glfw.KEY_J, glfw.KEY_T)
VIEWS = (glfw.KEY_F, glfw.KEY_KP_1, glfw.KEY_KP_3, glfw.KEY_KP_7, glfw.KEY_KP_5)
TABLE = (  # the first row whose key and state are so
    Why(
        (*MOVING, *DIGITS, *BODIES, *VIEWS, glfw.KEY_B, glfw.KEY_C, glfw.KEY_COMMA, glfw.KEY_DELETE,
         glfw.KEY_ENTER, glfw.KEY_G, glfw.KEY_I, glfw.KEY_KP_ENTER, glfw.KEY_L, glfw.KEY_LEFT,
         glfw.KEY_M, glfw.KEY_O, glfw.KEY_PERIOD, glfw.KEY_RIGHT, glfw.KEY_SPACE, glfw.KEY_U,
         glfw.KEY_V, glfw.KEY_Y, glfw.KEY_Z),
        EMPTY, lambda state: not state.scene.objects,
    ),
    Why(MOVING, "Hold it down to move; with Shift faster, with Ctrl slower."),
    Why(VIEWS, AT_VIEW),
    Why((glfw.KEY_B,), "B is a brush as long as it is held: drag over the picture."),
    Why((glfw.KEY_LEFT, glfw.KEY_RIGHT, glfw.KEY_SPACE, glfw.KEY_C, glfw.KEY_COMMA,
         glfw.KEY_PERIOD), "This scene has one stop; a slider wants two or more.",
        lambda state: not state.movable),
    Why((glfw.KEY_LEFT, glfw.KEY_RIGHT), "The slider is at its end."),
    Why((glfw.KEY_C,), "Two stops at once are not to be had here."),
    Why((glfw.KEY_COMMA, glfw.KEY_PERIOD), "There is no line to move: C shows two stops at once.",
        lambda state: not state.split.on or state.split.over),
    Why((glfw.KEY_COMMA, glfw.KEY_PERIOD), "The line is at the edge."),
    Why((glfw.KEY_Y, glfw.KEY_Z),
        "Nothing here has values to mark; that wants a stop of heat, or of other values.",
        lambda state: not state.has_legend),
    Why((glfw.KEY_Y, glfw.KEY_Z), "The values of these objects do not agree; show one."),
    Why((glfw.KEY_U,), "U is of the tool Parts, which O opens."),
    Why((glfw.KEY_DELETE, glfw.KEY_BACKSPACE, glfw.KEY_D), CHOOSE),
    Why((glfw.KEY_ENTER, glfw.KEY_KP_ENTER),
        "Enter ends what a tool has begun: O takes things out, Shift+Y measures."),
    Why((glfw.KEY_ESCAPE,), "There is nothing to leave: no tool, no box, nothing chosen."),
    Why((glfw.KEY_R,), "Everything is where it was.", lambda state: state.world is not None),
    Why((glfw.KEY_X,), "The ray meets nothing: put the mouse on an object.",
        lambda state: state.world is not None),
    Why((glfw.KEY_T, glfw.KEY_J), "Nothing moves in this step: all is at rest.",
        lambda state: state.world is not None),
)  # fmt: skip


class Answers:
    """Watches a window; what is missing is said by the state's notes."""

    def __init__(
        self, window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks
    ) -> None:
        self._window, self._state, self._viewpoint, self._hooks = window, state, viewpoint, hooks
        self._request: FrameRequest | None = None  # what the window shows under the overlay
        self._key: KeyDown | None = None  # that was pressed; None: the mouse
        self._place = window.cursor
        self._before: tuple | None = None  # what there was to be seen then
        self._said = 0  # notes up to then
        self._spoke = False  # the key has said something
        self._left = 0  # frames until it is judged; 0: nothing is watched
        self._down = False  # the button is held
        self._last, self._times = "", 1  # what was answered last
        window.on_press, window.on_release = self.pressed, self.released
        window.on_drawn = self.drawn
        hooks.over.append(self._see)

    # ---- what is seen

    def _see(self, request: FrameRequest) -> None:
        self._request = request

    def _look(self, data: imgui.ImDrawData | None) -> tuple:
        request = self._request
        if request is None or data is None:
            return ()
        beside = request.beside and (request.beside.scene.objects, request.beside.cut)
        picture = (request.scene.objects, request.view, request.settings, beside)
        lists = sorted(
            read_lists(data, ()), key=lambda each: each.vertices
        )  # a click reorders them
        return tuple(lists), picture

    @property
    def _moves(self) -> bool:
        """Whether the picture changes by itself."""
        state = self._state
        living = state.running and not state.bodies.living.resting
        return state.playing or living or self._viewpoint.moving or self._viewpoint.sliding

    # ---- what is pressed

    def pressed(self, key: int | None) -> None:
        """A key or the left button (None) goes down, before anybody knows of it."""
        if key in QUIET or (self._left and key is not None):
            return  # held while others are pressed; two in one frame: one answer
        self._key, self._place, self._down = None, self._window.cursor, key is None
        self._before, self._said = self._look(imgui.get_draw_data()), self._state.messages.count
        self._left = FRAMES if self._before else 0
        LastTip.text = ""

    def released(self) -> None:
        self._down = False
        self._left = FRAMES if self._left else 0

    def key(self, event: KeyDown, act: Callable[[KeyDown], None]) -> None:
        """Lets a key act.  While all moves, what is behind the picture is compared at once."""
        parts = list(self._parts()) if self._moves and event.key not in QUIET else []
        before, count = [contents(part) for part in parts], self._state.messages.count
        act(event)
        self._key, self._spoke = event, self._state.messages.count != count
        if not parts:
            return
        self._left = 0
        held = event.key in MOVING  # they act while they are held
        if not (self._spoke or held) and all(map(same, before, map(contents, parts))):
            self._answer(self._why_key(event))

    def _parts(self) -> Iterable[object]:
        """All that handlers of events have, and what that has: no tool is forgotten."""
        seen = {id(self), id(self._window), id(self._hooks)}
        found: list[object] = [self._state, self._viewpoint, *self._hooks.event_handlers]
        for depth in range(3):
            fresh = [part for part in found if id(part) not in seen and is_ours(part)]
            seen |= {id(part) for part in fresh}
            yield from fresh
            found = [each for part in fresh for each in within(part)] if depth < 2 else []

    # ---- what is said

    def drawn(self, data: imgui.ImDrawData) -> None:
        """A frame is complete."""
        if not self._left or self._down:
            return
        self._left -= 1
        x, y = self._window.cursor
        away = abs(x - self._place[0]) + abs(y - self._place[1]) > CLICK_PIXELS
        if self._left >= FRAMES - 1 or self._before is None or (self._key is None and away):
            return
        if not same(self._before, self._look(data)):
            return
        self._left = 0
        messages = self._state.messages
        spoke = self._spoke if self._key else messages.count != self._said
        if spoke and messages.note:  # the same once more
            self._answer(messages.note)
        elif (words := self._why_key(self._key) if self._key else self._why_click()) is not None:
            self._answer(words)

    def _answer(self, words: str) -> None:
        note = self._state.messages.note
        again = bool(note) and note in (words, f"{self._last} ({self._times})")
        self._times = self._times + 1 if again else 1
        self._last = words if not again or note == words else self._last
        self._state.say(f"{self._last} ({self._times})" if again else words)

    def _why_key(self, event: KeyDown) -> str:
        if self._window.popup_open:
            return said(WAITS)
        if event.key in BODIES and self._state.world is None and self._state.scene.objects:
            bodies = self._state.bodies
            if bodies.pending:
                return said("Objects get their bodies: {status}.", status=bodies.status)
            return said(bodies.why_none or NO_BODIES)
        if event.key in DIGITS and self._state.scene.objects:
            return self._why_stop(event.key - glfw.KEY_1)
        for row in TABLE:
            if event.key in row.keys and row.holds(self._state):
                return said(row.words)
        return said(NOTHING, key=key_word(event.key))

    def _why_stop(self, number: int) -> str:
        stops = [self._state.stops(index) for index in range(len(self._state.scene.objects))]
        most = max(stops, key=len)
        if number < len(most):
            return said("{name} is shown already.", name=most[number].name)
        facts = {"number": number + 1, "count": len(most)}
        return said("There is no stop {number}: this scene has {count}.", **facts)

    def _why_click(self) -> str | None:
        """None: what is no button has nothing to say."""
        window, state = self._window, self._state
        if window.on_scene:
            if not state.scene.objects:
                return said(EMPTY)
            if state.chosen:
                return said("{name} is chosen; a drag looks about.", name=state.chosen)
            return said(ONE_THING if len(state.scene.objects) == 1 else NOT_THERE)
        if imgui.internal.get_hovered_id():
            return LastTip.text or said(NO_CHANGE)
        return said(WAITS) if window.popup_open else None


def key_word(key: int) -> str:
    """What is printed on a key."""
    names = (name for name in dir(glfw) if name.startswith("KEY_") and getattr(glfw, name) == key)
    printed = glfw.get_key_name(key, 0) if key < glfw.KEY_KP_0 else None
    name = next(names, "KEY_?")[4:].replace("KP_", "numpad_").replace("_", " ")
    return printed.upper() if printed else name.capitalize()


def is_ours(part: object) -> bool:
    """Whether it is something of this program's windows, with fields of its own."""
    if isinstance(part, FunctionType | MethodType | list):
        return True
    return type(part).__module__.startswith("shapeshift.app.") and hasattr(part, "__dict__")


def within(part: object) -> list[object]:
    """What it has: fields, what a function was made with, whose a method is."""
    if isinstance(part, MethodType):
        return [part.__self__]
    if isinstance(part, FunctionType):
        cells = part.__closure__ or ()
        return [cell.cell_contents for cell in cells]
    return list(part) if isinstance(part, list) else list(vars(part).values())


def contents(part: object) -> list[object]:
    """The same, as it is now: what grows later does not grow in it."""
    held = (list, set, dict)
    return [list(each) if isinstance(each, held) else each for each in within(part)]


def same(one: object, other: object) -> bool:
    """Whether two are alike to the eye."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        if one.shape != other.shape or one.dtype.kind not in "fiub":
            return False
        return np.allclose(one, other, NEAR, NEAR, equal_nan=True)
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=NEAR, abs_tol=NEAR)
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    if is_dataclass(one) and not isinstance(one, type):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return bool(one == other)
