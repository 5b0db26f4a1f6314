"""A 3D mouse: what its cap asks for.  No sockets and no glfw here: the window reads it.

In flight the eye goes where the cap goes.  In orbit the scene does, as if one held it: so the eye
goes the other way, and what is pushed away gets smaller instead of the middle getting lost.
"""

import math
from dataclasses import dataclass

from shapeshift.app.editor.state.camera.camera import Push

DEAD = 0.04  # of the cap's way that counts as rest: a hand that lies on it is not still
TURN = 1.8  # radians a second with the cap all the way over
DOLLY = 8.0  # notches of the wheel a second, likewise
STILL = Push()


@dataclass(frozen=True)
class CapState:
    """One reading: shares of the cap's way, -1 to 1, and the buttons that are down.

    Turns are about these directions by the right hand: the cap's top towards the person, to the
    left, and (`roll`) to the right.
    """

    right: float = 0.0
    up: float = 0.0
    ahead: float = 0.0
    about_right: float = 0.0
    about_up: float = 0.0
    roll: float = 0.0  # not used: the horizon stays level
    pressed: frozenset[int] = frozenset()


@dataclass(frozen=True)
class CapInput:
    push: Push = STILL
    yaw: float = 0.0  # radians a second, as `EditorCamera.turn` has them
    pitch: float = 0.0
    dolly: float = 0.0  # notches a second, towards what is orbited
    fresh: tuple[int, ...] = ()  # buttons that were not down in the reading before

    @property
    def moving(self) -> bool:
        """Whether the cap is out of its middle."""
        return bool(self.push.any or self.yaw or self.pitch or self.dolly)


def cap_input(now: CapState, before: CapState, flying: bool) -> CapInput:
    """What a reading asks for, after the one before."""
    right, up, ahead = share(now.right), share(now.up), share(now.ahead)
    pitch, yaw = TURN * share(now.about_right), TURN * share(now.about_up)
    fresh = tuple(sorted(now.pressed - before.pressed))
    if flying:
        return CapInput(Push(right, up, ahead), yaw, pitch, 0.0, fresh)
    return CapInput(Push(-right, -up), -yaw, -pitch, -DOLLY * ahead, fresh)


def share(value: float) -> float:
    """-1 to 1 with 0 within DEAD of the middle, then slowly more; 0 for what is no number."""
    if not (math.isfinite(value) and abs(value) > DEAD):
        return 0.0
    part = min((abs(value) - DEAD) / (1 - DEAD), 1.0)
    return math.copysign(part**1.5, value)
