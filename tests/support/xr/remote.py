"""Scripts a headset without one: the socket of Monado's remote driver.

A message is the whole state of head, eyes and both controllers (Index), 376 bytes little endian,
the layout of `struct r_remote_data` of Monado 25.0.0.  The runtime keeps the latest one.
"""

import math
import socket
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from shapeshift.scene.pose import Pose

MARK = b"mndrmt3\0"
EYE = "<4f7f4x"  # left, right, up, down in radians; the eye's pose in the head
HEAD = "<7f?3x"  # pose; whether the eyes above hold
CONTROLLER = "<7f3f3f5f3f2f1f2f13?3x"
# Clicks and touches in the order of the message, after "follows fingers" and "is there".
BUTTONS = (
    "system system_touch primary primary_touch secondary secondary_touch trigger_click"
    " trigger_touch stick_click stick_touch pad_touch"
).split()
SIZE = len(MARK) + 2 * struct.calcsize(EYE) + struct.calcsize(HEAD)
SIZE += 2 * struct.calcsize(CONTROLLER)  # 376
NO_TURN = (1.0, 0.0, 0.0, 0.0)  # wxyz
EYES_APART_M = 0.063
EYE_DEGREES = ((-52, 42, 48, -50), (-42, 52, 48, -50))  # left, right, up, down; as of an Index


def pose7(position: object, wxyz: object) -> tuple[float, ...]:
    w, x, y, z = map(float, wxyz)
    return (x, y, z, w, *map(float, position))


@dataclass
class Controller:
    """What one hand does; `there` False is a hand whose tracking is lost."""

    position: tuple[float, float, float]  # play space, metres
    wxyz: tuple[float, float, float, float] = NO_TURN
    squeeze: float = 0.0
    trigger: float = 0.0
    stick: tuple[float, float] = (0.0, 0.0)
    pressed: set[str] = field(default_factory=set)  # of BUTTONS
    there: bool = True
    follows: bool = False  # its fingers are seen: the runtime makes joints of `curls`
    curls: tuple[float, ...] = (0.0,) * 5  # of the fingers, little to thumb, 0 straight

    def message(self) -> bytes:
        still = (*(0.0,) * 6, *self.curls)  # velocity, turning, five fingers
        fingers, pad = (self.trigger, self.squeeze, self.squeeze), (0.0, 0.0, 0.0)
        clicks = [name in self.pressed for name in BUTTONS]
        where = pose7(self.position, self.wxyz)
        return struct.pack(
            CONTROLLER,
            *where,
            *still,
            *fingers,
            *self.stick,
            *pad,
            self.follows,
            self.there,
            *clicks,
        )


class Remote:
    """Head, eyes and hands of the runtime that listens at `port`; nothing moves before `send`."""

    def __init__(
        self, port: int, patience_s: float = 20.0, alive: Callable[[], bool] = lambda: True
    ) -> None:
        self.head = Pose(np.array([0.0, 1.6, 0.0]), np.array(NO_TURN))
        self.eye_degrees = EYE_DEGREES
        self.left, self.right = Controller((-0.2, 1.3, -0.5)), Controller((0.2, 1.3, -0.5))
        self._socket = connect(port, patience_s, alive)
        greeting = b""
        while len(greeting) < 2 * SIZE:
            got = self._socket.recv(2 * SIZE - len(greeting))
            if not got:
                raise ConnectionError("the runtime closed the connection of its remote driver")
            greeting += got

    def message(self) -> bytes:
        parts = [MARK]
        for degrees, side in zip(self.eye_degrees, (-0.5, 0.5), strict=True):
            away = (side * EYES_APART_M, 0.0, 0.0)
            parts.append(struct.pack(EYE, *map(math.radians, degrees), *pose7(away, NO_TURN)))
        parts.append(struct.pack(HEAD, *pose7(self.head.position, self.head.wxyz), True))
        return b"".join([*parts, self.left.message(), self.right.message()])

    def send(self) -> None:
        self._socket.sendall(self.message())

    def __enter__(self) -> "Remote":
        return self

    def __exit__(self, *raised: object) -> None:
        self._socket.close()


def connect(port: int, patience_s: float, alive: Callable[[], bool]) -> socket.socket:
    """The runtime listens once the program, which has to live, has made its instance."""
    until = time.monotonic() + patience_s
    while True:
        try:
            made = socket.create_connection(("127.0.0.1", port), 5.0)
        except ConnectionRefusedError:
            if time.monotonic() > until or not alive():
                raise
            time.sleep(0.05)
            continue
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return made
