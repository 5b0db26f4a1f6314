"""A gamepad: what its sticks and buttons ask for.  No glfw here: the window reads it.

Sticks move and turn the eye; a button is a key.
"""

import math
from dataclasses import dataclass

from shapeshift.app.editor.state.camera.camera import FAST, Push

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
