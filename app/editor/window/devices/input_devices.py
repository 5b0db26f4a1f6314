"""What a hand may hold beside keys and mouse: gamepads and 3D mice, as the window's loop asks."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import glfw

from shapeshift.app.editor.state.camera.camera import FAST, Push
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.window.devices.space_mice import attach_space_mice
from shapeshift.app.editor.window.hands import InputActions
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.window import Event, KeyDown, Window

# A gamepad: what its sticks and buttons ask for.  No glfw here: the window reads it.
#
# Sticks move and turn the eye; a button is a key.

# In the order of the standard layout that GLFW gives every pad (SDL_GameControllerDB).
BUTTONS = (
    "A", "B", "X", "Y", "left bumper", "right bumper", "back", "start", "guide", "left stick",
    "right stick", "up", "right", "down", "left",
)  # fmt: skip
DEAD = 0.15  # of a stick's way from its middle that counts as rest: worn sticks rest there
TURN = 2.2  # radians a second with a stick all the way over
REPEAT_S = 0.04  # between two steps of a button that goes on while it is held
REPEATING = ("left", "right")


@dataclass(frozen=True)
class PadState:
    """One reading: left stick x and y, right stick x and y, -1 to 1, right and down positive; left
    and right trigger, -1 (rest) to 1.
    """

    axes: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, -1.0, -1.0)
    pressed: frozenset[str] = frozenset()  # of BUTTONS


REST, STILL = PadState(), Push()


@dataclass(frozen=True)
class PadInput:
    push: Push = STILL
    yaw: float = 0.0  # radians a second, to the left and up positive
    pitch: float = 0.0
    fresh: tuple[str, ...] = ()  # buttons that were not pressed in the reading before

    @property
    def moving(self) -> bool:
        """Whether a stick or a trigger is held."""
        return bool(self.push.any or self.yaw or self.pitch)


def pad_input(now: PadState, before: PadState = REST) -> PadInput:
    """What a reading asks for, after the one before."""
    left_x, left_y = stick(now.axes[0], now.axes[1])
    right_x, right_y = stick(now.axes[2], now.axes[3])
    down, up = (trigger(value) for value in now.axes[4:6])
    pace = FAST if "left stick" in now.pressed else 1.0
    push = Push(left_x, up - down, -left_y, pace)
    fresh = tuple(name for name in BUTTONS if name in now.pressed - before.pressed)
    return PadInput(push, -right_x * TURN, -right_y * TURN, fresh)


def stick(x: float, y: float) -> tuple[float, float]:
    """Where a stick is, -1 to 1 each: 0 within DEAD of its middle, then slowly more and more."""
    length = math.hypot(x, y)
    if not (math.isfinite(length) and length > DEAD):
        return 0.0, 0.0
    strength = min((length - DEAD) / (1 - DEAD), 1.0) ** 2
    return x / length * strength, y / length * strength


def trigger(value: float) -> float:
    """0 at rest to 1."""
    part = (value + 1) / 2
    return min((part - DEAD) / (1 - DEAD), 1.0) if math.isfinite(part) and part > DEAD else 0.0


class InputDevices:
    """All of them; they are read, and have no events that would wake a window."""

    def __init__(
        self, window: Window, state: EditorState, viewpoint: Viewpoint, hands: InputActions,
        hooks: Hooks,
    ) -> None:  # fmt: skip
        attached = (window, state, viewpoint, hands, hooks)
        self.pads = attach_pads(*attached)
        self.mice = attach_space_mice(*attached)

    @property
    def connected(self) -> bool:
        """Whether any is there, so that it is to be read often."""
        return self.pads.connected or self.mice.connected

    @property
    def moving(self) -> bool:
        """Whether a stick, a trigger or a cap is out of its middle."""
        return self.pads.input.moving or self.mice.input.moving

    def poll(self) -> bool:
        """Reads all; whether any asks for a frame."""
        return any([self.pads.poll(), self.mice.poll()])


# The gamepads of the window: read by GLFW, their buttons handed on as keys.

KEYS_OF = {  # button -> the key that it is, and whether with Shift
    "A": (glfw.KEY_SPACE, False), "B": (glfw.KEY_V, False), "X": (glfw.KEY_C, False),
    "Y": (glfw.KEY_F, False), "start": (glfw.KEY_F, True), "back": (glfw.KEY_H, False),
    "left bumper": (glfw.KEY_LEFT, True), "right bumper": (glfw.KEY_RIGHT, True),
    "left": (glfw.KEY_LEFT, False), "right": (glfw.KEY_RIGHT, False),
    "up": (glfw.KEY_N, False), "down": (glfw.KEY_P, False),
}  # fmt: skip
KEYS = (
    ("left stick", "moves; pressed, faster"),
    ("right stick", "turns"),
    ("triggers", "down and up"),
    ("A  B", "plays and pauses; flies or orbits"),
    ("X  Y", "two stops; everything into view"),
    ("bumpers", "the stop before, the next one"),
    ("left  right", "x by 0.01"),
    ("up  down", "next and previous camera"),
    ("Start  Back", "first view; hides the panel"),
)


class Gamepads:
    """All of them are one; `read` gives its state, None while there is none."""

    def __init__(
        self, state: EditorState, viewpoint: Viewpoint, handle: Callable[[Event], None],
        read: Callable[[], PadState | None],
    ) -> None:  # fmt: skip
        self._state, self._viewpoint, self._handle = state, viewpoint, handle
        self.read = read
        self.connected = False
        self.input = PadInput()  # what is held, and the buttons that no frame has handed on yet
        self._before = REST
        self._held_s = 0.0  # how long a button that repeats has been held since its last step

    def poll(self) -> bool:
        """Reads the pads; whether they ask for a frame."""
        found = self.read()
        self.connected = found is not None
        now = found or REST
        asked = pad_input(now, self._before)
        self.input = replace(asked, fresh=(*self.input.fresh, *asked.fresh))
        self._before = now
        return self.input.moving or bool(self.input.fresh or now.pressed & set(REPEATING))

    def act(self) -> bool:
        """What was asked for since the last frame.  False: nothing goes on by itself."""
        self.poll()
        asked, seconds = self.input, self._state.seconds
        self.input = replace(asked, fresh=())
        if asked.yaw or asked.pitch:
            self._viewpoint.leave_camera()
            self._viewpoint.camera.turn(asked.yaw * seconds, asked.pitch * seconds)
        for name in (*asked.fresh, *self._repeated(asked.fresh, seconds)):
            if name in KEYS_OF:
                key, shift = KEYS_OF[name]
                self._handle(KeyDown(key, shift))
        return False

    def _repeated(self, fresh: tuple[str, ...], seconds: float) -> list[str]:
        """Buttons that are held and go on, as often as the time that has passed asks for."""
        held = [n for n in REPEATING if n in self._before.pressed and n not in fresh]
        self._held_s = self._held_s + seconds if held else 0.0
        steps = int(self._held_s / REPEAT_S)
        self._held_s -= steps * REPEAT_S
        return held * steps


def attach_pads(
    window: Window, state: EditorState, viewpoint: Viewpoint, hands: InputActions, hooks: Hooks
) -> Gamepads:
    """Adds the gamepads to a viewer."""
    pads = Gamepads(state, viewpoint, hands.handle_event, lambda: read_glfw(window))
    hands.pushes.append(lambda: pads.input.push)
    hooks.each_frame.append(pads.act)
    hooks.keys["Gamepad"] = list(KEYS)
    return pads


def read_glfw(window: Window) -> PadState | None:
    """What all pads that GLFW knows say together, while the window has the keyboard."""
    if not glfw.get_window_attrib(window.handle, glfw.FOCUSED):
        return None
    axes, pressed, found = list(REST.axes), set(), False
    for number in range(glfw.JOYSTICK_LAST + 1):
        state = glfw.get_gamepad_state(number) if glfw.joystick_is_gamepad(number) else None
        if state is None:
            continue
        found = True
        for i, (value, rest) in enumerate(zip(list(state.axes), REST.axes, strict=False)):
            axes[i] = value if abs(value - rest) > abs(axes[i] - rest) else axes[i]
        pressed |= {name for name, down in zip(BUTTONS, state.buttons, strict=False) if down}
    return PadState(tuple(axes), frozenset(pressed)) if found else None
