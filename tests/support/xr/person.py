"""Somebody in the headset: a head and two hands in the room, told in metres of the world."""

import math
from contextlib import contextmanager

import numpy as np
import pytest

from shapeshift.scene.pose import Pose, View
from shapeshift.vr.play_space import PlaySpace
from tests.support.xr.remote import Controller, Remote
from tests.support.xr.xr_stand import Program

TRIES = 8  # of a swing whose frames have to be even
EVEN = 5  # frames of it: longer than the physics looks back at a throw
LONGEST_FRAME_S = 8 / 90  # more steps than these are not made up for
GLIDE_M = 0.04  # a hand moves so far from frame to frame, unless it is told otherwise


def pose_of(row: dict) -> Pose:
    return Pose(np.array(row["position"]), np.array(row["wxyz"]))


def place(line: dict, name: str) -> np.ndarray:
    """(3,) metres of the world: where a line has an object."""
    return np.array(line["objects"][name]["position"])


class Person:
    """Moves in step with the program: a new place of a hand for every frame that it shows."""

    def __init__(self, program: Program, remote: Remote) -> None:
        self.program, self.remote = program, remote
        self.line: dict = {}  # of the frame that was seen last

    def controller(self, side: str) -> Controller:
        return getattr(self.remote, side)

    def frame(self) -> dict:
        """Does what was set, and waits until a frame has seen it."""
        self.remote.send()
        self.line = self.program.until(lambda line: True, "the next frame")
        return self.line

    def frames(self, count: int) -> dict:
        for _ in range(count):
            self.frame()
        return self.line

    def until(self, happens, what: str) -> dict:
        """Keeps still until it happens."""
        self.remote.send()
        self.line = self.program.until(happens, what)
        return self.line

    def in_room(self, world: np.ndarray) -> np.ndarray:
        """(3,) metres of the room of a place (3,) of the world."""
        play_space = PlaySpace(pose_of(self.line["standing"]), self.line["standing"]["scale"])
        room = play_space.world_from_play.matrix()
        return room[:3, :3].T @ (np.asarray(world) - room[:3, 3]) / play_space.scale

    def palm(self, side: str) -> np.ndarray:
        """(3,) metres of the world: where the last frame had it."""
        play_space = PlaySpace(pose_of(self.line["standing"]), self.line["standing"]["scale"])
        return play_space.point(np.array(self.line["hands"][side]["grip"]["position"]))

    def put(self, side: str, world: np.ndarray) -> dict:
        """The hand is there at once."""
        self.controller(side).position = tuple(self.in_room(world))
        return self.frame()

    def reach(self, side: str, world: np.ndarray, step_m: float = GLIDE_M) -> dict:
        """The hand goes there in a line, `step_m` a frame."""
        return self.move(side, self.in_room(world), step_m)

    def touch(self, side: str, room: np.ndarray, step_m: float = GLIDE_M) -> dict:
        """The tip of the hand's finger goes to a place (3,) of the room."""
        row = self.line["hands"][side]
        # The runtime's own grip, not where a bare hand's is.
        at = np.array(self.controller(side).position)
        return self.move(side, at + room - np.array(row["finger"]), step_m)

    def move(self, side: str, room: np.ndarray, step_m: float = GLIDE_M) -> dict:
        """The hand goes to a place (3,) of the room in a line, `step_m` a frame."""
        start, end = np.array(self.controller(side).position), np.asarray(room)
        steps = max(1, round(float(np.linalg.norm(end - start)) / step_m))
        for step in range(1, steps + 1):
            self.controller(side).position = tuple(start + step / steps * (end - start))
            self.frame()
        return self.line

    def squeeze(self, side: str, how: float = 1.0) -> dict:
        self.controller(side).squeeze = how
        return self.until(
            lambda line: abs(line["hands"][side]["squeeze"] - how) < 0.01, f"a squeeze of {how}"
        )

    def aim(self, side: str, world: np.ndarray) -> dict:
        """Points at a place (3,) of the world."""
        return self.point(side, self.in_room(world))

    def point(self, side: str, room: np.ndarray) -> dict:
        """Turns the hand so that its pointer, which leans against its grip, meets that place.

        In a few steps: it starts beside the palm and moves with the turn.
        """
        for _ in range(3):
            hand = self.line["hands"][side]
            grip, aim = pose_of(hand["grip"]).matrix(), pose_of(hand["aim"]).matrix()
            wanted = room - aim[:3, 3]
            turn = turn_between(-aim[:3, 2], wanted / np.linalg.norm(wanted))
            grip[:3, :3] = turn @ grip[:3, :3]
            self.controller(side).wxyz = tuple(Pose.from_matrix(grip).wxyz)
            self.frame()
        return self.frame()

    def take(self, side: str, name: str, above_m: float) -> dict:
        """Reaches above an object and squeezes."""
        self.reach(side, np.add(place(self.line, name), (0, above_m + 0.15, 0)), 0.1)
        self.reach(side, np.add(place(self.line, name), (0, above_m, 0)))
        self.squeeze(side)
        return self.until(lambda line: line["held"][side] == name, f"{name} in the {side} hand")

    def throw(
        self, side: str, name: str, above_m: float, step: np.ndarray
    ) -> tuple[list[dict], list[dict]]:
        """Takes an object, swings it by `step` a frame, and opens the hand.

        The lines of the swing's end, in which the hand was even, and of the flight's beginning.
        Tries again where this machine was too busy for an even one.
        """
        for _ in range(TRIES):
            self.take(side, name, above_m)
            self.reach(side, np.add(self.palm(side), (0, 0.3, 0)))
            swing = [self.put(side, self.palm(side) + step) for _ in range(10)][-EVEN:]
            self.controller(side).squeeze = 0.0
            flight = [self.put(side, self.palm(side) + step), *(self.frame() for _ in range(8))]
            # A busy machine may have begun that frame before it heard of the open hand.
            opened = flight[0]["hands"][side]["squeeze"] == 0
            assert not opened or flight[0]["held"][side] is None
            ways = np.diff([line["hands"][side]["grip"]["position"] for line in swing], axis=0)
            lengths = np.linalg.norm(ways, axis=1)
            times = np.diff([line["seen_s"] for line in swing + flight])
            even = np.ptp(lengths) < 0.002 and times.max() < LONGEST_FRAME_S and times.min() > 0.04
            if opened and even:
                return swing, flight
            self.frames(20)  # it comes to rest
        pytest.skip(f"this machine is too busy for an even swing in {TRIES} tries")

    @contextmanager
    def pressing(self, side: str, button: str):
        """Within it a button is down."""
        self.controller(side).pressed.add(button)
        self.frames(2)
        try:
            yield
        finally:
            self.controller(side).pressed.discard(button)
            self.frames(2)


def turn_between(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(3, 3) that turns one direction into another, the short way; they are not opposite."""
    axis, cosine = np.cross(before, after), float(np.dot(before, after))
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + cross + cross @ cross / (1 + cosine)


WHOLE_LIFE = [
    "IDLE", "READY", "SYNCHRONIZED", "VISIBLE", "FOCUSED",
    "VISIBLE", "SYNCHRONIZED", "STOPPING", "IDLE", "EXITING",
]  # fmt: skip


SIZE = (320, 240)  # of an eye, as the null compositor recommends


def pixel_of(view: View, world: np.ndarray) -> tuple[int, int]:
    """Column and row, row 0 on top."""
    x, y, z = (np.linalg.inv(view.world_from_eye.matrix()) @ np.append(world, 1))[:3]
    left, right, down, up = view.tangents
    column = (x / -z - left) / (right - left) * view.size[0]
    row = (up - y / -z) / (up - down) * view.size[1]
    return int(column), int(row)


BEFORE = 0.03  # metres from the panel, where a finger is close and does not press
CARRIES, FREE = (-0.05, 1.2, -0.45), (0.25, 1.25, -0.25)  # metres of the room


def open_panel(person: Person) -> None:
    with person.pressing("left", "secondary"):  # an Index controller has no other for a menu
        pass


def direction(line: dict) -> np.ndarray:
    """(3,) of length 1: along the slider."""
    first, last = map(np.array, line["panel"]["slider"])
    return (last - first) / np.linalg.norm(last - first)


def in_front(line: dict, room: np.ndarray) -> np.ndarray:
    """A little towards who reads."""
    way = np.array(line["head"]["position"]) - room
    return room + BEFORE * way / np.linalg.norm(way)


CUBE_TOP_M, RING_TOP_M = 0.05, 0.03  # above their middles


def events(lines: list[dict], name: str) -> list[tuple[str, str, str]]:
    """(on, from, to) of an object's reactions, in order."""
    told = [event for line in lines for event in line["events"] if event["object"] == name]
    return [(event["on"], event["from"], event["to"]) for event in told]


def heading_deg(line: dict) -> float:
    """Of the room in the world, to the left."""
    w, _, y, _ = line["standing"]["wxyz"]
    return math.degrees(2 * math.atan2(y, w))
