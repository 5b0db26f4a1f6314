"""3D mice of the window: by spacenavd's socket (Linux, BSD), else as a joystick of six axes.

spacenavd sends packets of eight native 32-bit integers to whoever connects: 0, then x, y, z, turns
about them and milliseconds while the cap is out of its middle (right, up and away are positive, 350
is about all the way); 1 and 2, then a button's number, where that is pressed and let go.
"""

import math
import os
import socket
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import glfw

from shapeshift.app.editor.state.camera.camera import Push
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.window.hands import InputActions
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.window import Event, KeyDown, Window

# A 3D mouse: what its cap asks for.  No sockets and no glfw here: the window reads it.
#
# In flight the eye goes where the cap goes. In orbit the scene does, as if one held it: so the
# eye goes the other way, and what is pushed away gets smaller instead of the middle getting lost.

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


SOCKETS = ("/run/spnav.sock", "/var/run/spnav.sock")
PACKET = struct.Struct("=8i")
MOTION, PRESS, RELEASE = range(3)
FULL = 350  # what spacenavd says of a cap all the way over
AGAIN_S = 5.0  # between two looks for a spacenavd
MOST_BYTES = 64 * PACKET.size  # read at a time
NAMES = ("3dconnexion", "spacemouse", "spacenavigator", "space navigator", "spaceexplorer",
         "spacepilot")  # fmt: skip
KEYS_OF = {0: (glfw.KEY_F, False), 1: (glfw.KEY_F, True)}  # button -> key, and whether with Shift
KEYS = (
    ("cap", "moves and turns the eye in flight, the scene in orbit"),
    ("left button", "frame everything"),
    ("right button", "the first view"),
)


class SpaceNavigation:
    """A connection to spacenavd: `read` gives the cap, None while there is no such program."""

    def __init__(self, paths: tuple[str, ...] | None = None) -> None:
        own = os.environ.get("SPNAV_SOCKET")  # as its own library has it
        self._paths = paths or ((own,) if own else SOCKETS)
        self._socket: socket.socket | None = None
        self._looked_s = -AGAIN_S
        self._rest = b""  # of a packet whose end has not come yet
        self._cap = CapState()
        self._clicked: set[int] = set()  # pressed since the last `read`, also if let go by now

    def read(self) -> CapState | None:
        """The cap as the last packet had it; a button counts as down until it was read once."""
        if self._socket is None and not self._connect():
            return None
        assert self._socket is not None
        try:
            while sent := self._socket.recv(MOST_BYTES):
                self._read_packets(sent)
        except BlockingIOError:
            pressed, self._clicked = self._cap.pressed | self._clicked, set()
            return replace(self._cap, pressed=pressed)
        except OSError:
            pass
        self.close()  # it has ended
        return None

    def close(self) -> None:
        """Lets go of the program; the next `read` looks for it again."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self._rest, self._cap = None, b"", CapState()
        self._clicked = set()

    def _connect(self) -> bool:
        now = time.monotonic()
        if not hasattr(socket, "AF_UNIX") or now - self._looked_s < AGAIN_S:
            return False
        self._looked_s = now
        for path in self._paths:
            found = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            found.setblocking(False)
            try:
                found.connect(path)
            except OSError:
                found.close()
                continue
            self._socket = found
            return True
        return False

    def _read_packets(self, sent: bytes) -> None:
        data = self._rest + sent
        whole = len(data) - len(data) % PACKET.size
        self._rest = data[whole:]
        for kind, *values in PACKET.iter_unpack(data[:whole]):
            if kind == MOTION:
                right, up, ahead, pitch, yaw, roll, _ = (value / FULL for value in values)
                self._cap = CapState(right, up, ahead, pitch, yaw, roll, self._cap.pressed)
            elif kind in (PRESS, RELEASE):
                button = {values[0]} & KEYS_OF.keys()
                down = self._cap.pressed - button
                if kind == PRESS:
                    down |= button
                    self._clicked |= button
                self._cap = replace(self._cap, pressed=down)


class SpaceMice:
    """All of them are one; `read` gives its state, None while there is none."""

    def __init__(
        self, state: EditorState, viewpoint: Viewpoint, handle: Callable[[Event], None],
        read: Callable[[], CapState | None],
    ) -> None:  # fmt: skip
        self._state, self._viewpoint, self._handle = state, viewpoint, handle
        self.read = read
        self.connected = False
        self.input = CapInput()
        self._before = CapState()

    def poll(self) -> bool:
        """Reads them; whether they ask for a frame."""
        found = self.read()
        self.connected = found is not None
        now = found or CapState()
        asked = cap_input(now, self._before, self._viewpoint.camera.flying)
        self.input = replace(asked, fresh=(*self.input.fresh, *asked.fresh))
        self._before = now
        return self.input.moving or bool(self.input.fresh)

    def act(self) -> bool:
        """What was asked for since the last frame.  False: nothing goes on by itself."""
        self.poll()
        asked, seconds = self.input, self._state.seconds
        self.input = replace(asked, fresh=())
        camera = self._viewpoint.camera
        if asked.yaw or asked.pitch or asked.dolly:
            self._viewpoint.leave_camera()
        if asked.yaw or asked.pitch:
            camera.turn(asked.yaw * seconds, asked.pitch * seconds)
        if asked.dolly:
            camera.dolly(asked.dolly * seconds)
        for button in asked.fresh:
            self._handle(KeyDown(*KEYS_OF[button]))
        return False


def attach_space_mice(
    window: Window, state: EditorState, viewpoint: Viewpoint, hands: InputActions, hooks: Hooks
) -> SpaceMice:
    """Adds 3D mice to a viewer."""
    navigation = SpaceNavigation()

    def read() -> CapState | None:
        cap = navigation.read() or read_joysticks()  # so that no packet is left for later
        return cap if glfw.get_window_attrib(window.handle, glfw.FOCUSED) else None

    mice = SpaceMice(state, viewpoint, hands.handle_event, read)
    hands.pushes.append(lambda: mice.input.push)
    hooks.each_frame.append(mice.act)
    hooks.keys["3D mouse"] = list(KEYS)
    return mice


def read_joysticks() -> CapState | None:
    """The first joystick that is a 3D mouse by its name; its axes are right, towards the person and
    down, and turns about them.
    """
    for number in range(glfw.JOYSTICK_LAST + 1):
        if not glfw.joystick_present(number):
            continue
        told: object = glfw.get_joystick_name(number)  # bytes, whatever its types say
        name = told.decode("utf-8", "replace") if isinstance(told, bytes) else str(told)
        if not any(known in name.lower() for known in NAMES):
            continue
        axes, count = glfw.get_joystick_axes(number)
        if count >= 6:
            return cap_of_axes([float(axes[i]) for i in range(6)], pressed_of(number))
    return None


def cap_of_axes(axes: list[float], pressed: frozenset[int] = frozenset()) -> CapState:
    """Six axes as 3Dconnexion's devices have them (HID: X, Y, Z, Rx, Ry, Rz), -1 to 1."""
    x, y, z, about_x, about_y, about_z = axes
    return CapState(x, -z, -y, about_x, -about_z, -about_y, pressed)


def pressed_of(number: int) -> frozenset[int]:
    """The buttons of a joystick that are down, of those that do something here."""
    buttons, count = glfw.get_joystick_buttons(number)
    return frozenset(i for i in KEYS_OF if i < count and buttons[i])
