"""A visit from its first frame to the end of its runtime, in one session, as a person has it."""

import math

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from tests.support.xr.person import (
    CARRIES,
    CUBE_TOP_M,
    FREE,
    Person,
    direction,
    events,
    heading_deg,
    in_front,
    open_panel,
    place,
)
from tests.support.xr.xr_stand import Stand

NO_HEADSET = 4  # exit code


@pytest.mark.slow
def test_a_whole_visit(served_person: Person, served: Stand):
    person, lines = served_person, served_person.program.lines
    look_about(person)
    slide_to_ice(person)
    before = person.take("right", "cube", CUBE_TOP_M)
    assert before["panel"]["object"] == "cube"
    carry_and_throw(person)
    person.until(lambda line: line["objects"]["cube"]["x"] == 0.5, "ice to fire by the blow")
    assert ("collision", "ice", "fire") in events(lines, "cube")
    take_and_turn(person)
    lose_the_hand(person)
    served.recentre()
    person.until(lambda line: line["recentred"], "recentred")
    served.kill_runtime()
    report = person.program.end()
    assert (report["code"], report["ended"]) == (NO_HEADSET, "runtime lost")
    assert report["recentrings"] == 1 and report["frames"] >= len(lines) - 1


def look_about(person: Person) -> None:
    """Down at the table, over a shoulder, and ahead again."""
    for angle, axis in ((-0.5, 0), (0.8, 1), (0.0, 1)):
        wxyz = np.array([math.cos(angle / 2), 0.0, 0.0, 0.0])
        wxyz[1 + axis] = math.sin(angle / 2)
        person.remote.head = Pose(np.array([0.0, 1.6, 0.0]), wxyz)
        line = person.frames(3)
        np.testing.assert_allclose(line["head"]["wxyz"], wxyz, atol=1e-5)


def slide_to_ice(person: Person) -> None:
    person.controller("left").position, person.controller("right").position = CARRIES, FREE
    open_panel(person)
    person.frames(8)
    person.touch("right", in_front(person.line, np.array(person.line["panel"]["knob"])))
    person.frames(2)
    person.squeeze("right")
    along = 0.003 * direction(person.line)
    while person.line["panel"]["shown"] != "ice":
        assert person.line["objects"]["cube"]["x"] < 0.4
        person.move("right", np.add(person.controller("right").position, along))
    person.squeeze("right", 0.0)
    person.move("right", FREE)
    assert person.line["objects"]["cube"]["x"] == 0.25


def carry_and_throw(person: Person) -> None:
    start = place(person.line, "cube")
    person.reach("right", np.add(person.palm("right"), (0, 0.3, 0)))
    assert place(person.line, "cube")[1] - start[1] > 0.25
    person.reach("right", np.add(person.palm("right"), (0.1, 0.1, 0)), 0.06)
    thrown = person.squeeze("right", 0.0)
    assert thrown["held"]["right"] is None


def take_and_turn(person: Person) -> None:
    person.frames(25)  # it comes to rest
    person.take("right", "cube", CUBE_TOP_M)
    before = heading_deg(person.line)
    person.controller("right").stick = (-1.0, 0.0)
    person.frames(4)
    person.controller("right").stick = (0.0, 0.0)
    line = person.frames(3)
    assert (heading_deg(line) - before) % 360 == pytest.approx(30, abs=0.01)
    assert line["held"]["right"] == "cube"


def lose_the_hand(person: Person) -> None:
    person.reach("right", np.add(person.palm("right"), (0, 0.2, 0)))
    person.controller("right").there = False
    person.until(lambda line: line["held"]["right"] is None, "let go")
