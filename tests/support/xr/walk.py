"""A walk before the three things on the table, over and over: head, sticks and grabs."""

import math
from collections.abc import Callable

import numpy as np

from shapeshift.scene.pose import Pose
from tests.support.xr.person import CUBE_TOP_M, RING_TOP_M, Person, place

THINGS = (("right", "cube", CUBE_TOP_M), ("left", "ring", RING_TOP_M))
LOOK_FRAMES, STICK_FRAMES, PATIENCE_FRAMES = 40, 12, 15
HOME_FRAMES = 40  # of 50 ms: a button held for more than a second
RADIUS_M, NOD = 0.25, 0.25  # of the head's way; radians to both sides
LIFT_M = 0.15
AWAY = {"left": (-0.3, 1.2, -0.3), "right": (0.3, 1.2, -0.3)}  # metres of the room


def walk(person: Person, seconds: float, each: Callable[[dict], None] = lambda line: None) -> dict:
    """Walks for so many seconds of the session's clock; `each` is called once a round.

    Returns how often a thing was reached for, and how often it was taken.
    """
    did = {"reached": 0, "taken": 0, "rounds": 0}
    until = person.line["seen_s"] + seconds
    while person.line["seen_s"] < until:
        look_about(person)
        step_and_turn(person)
        for side, name, above_m in THINGS:
            did["reached"] += 1
            did["taken"] += carry(person, side, name, above_m)
        go_home(person)
        did["rounds"] += 1
        each(person.line)
        person.program.lines.clear()  # ten minutes of them are large
    return did


def look_about(person: Person) -> None:
    """The head goes round a circle and looks to both sides."""
    for step in range(1, LOOK_FRAMES + 1):
        angle = 2 * math.pi * step / LOOK_FRAMES
        at = np.array([RADIUS_M * math.sin(angle), 1.6, RADIUS_M * (1 - math.cos(angle))])
        half = NOD / 2 * math.sin(angle)
        turn = np.array([math.cos(half), 0.0, math.sin(half), 0.0])
        person.remote.head = Pose(at, turn)
        person.frame()


def step_and_turn(person: Person) -> None:
    """By stick: ahead and back, a snap turn and back."""
    for side, stick in (("left", (0.0, 0.6)), ("left", (0.0, -0.6)),
                        ("right", (0.9, 0.0)), ("right", (-0.9, 0.0))):  # fmt: skip
        person.controller(side).stick = stick
        person.frames(STICK_FRAMES)
        person.controller(side).stick = (0.0, 0.0)
        person.frames(2)


def carry(person: Person, side: str, name: str, above_m: float) -> bool:
    """Takes a thing, lifts it, moves it through the air, puts it back; whether it was taken."""
    hand = person.controller(side)
    at = place(person.line, name)
    person.reach(side, np.add(at, (0, above_m + 0.15, 0)), 0.1)
    person.reach(side, np.add(at, (0, above_m, 0)))
    hand.squeeze = 1.0
    for _ in range(PATIENCE_FRAMES):
        if person.frame()["held"][side] == name:
            break
    taken = person.line["held"][side] == name
    if taken:
        for away in ((0, LIFT_M, 0), (0.1, 0, 0), (-0.1, 0, 0), (0, -LIFT_M, 0)):
            person.reach(side, np.add(person.palm(side), away), 0.03)
    hand.squeeze = 0.0
    person.frames(5)
    person.move(side, np.array(AWAY[side]), 0.1)
    return taken


def go_home(person: Person) -> None:
    """Held for a second, the button puts one before the scene again."""
    person.controller("right").pressed.add("secondary")
    person.frames(HOME_FRAMES)
    person.controller("right").pressed.discard("secondary")
    person.frames(3)
