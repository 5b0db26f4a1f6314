"""What the runtime does while a hand holds something: recentres, takes the input away, dies."""

import math

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from tests.support.xr.person import Person, place
from tests.support.xr.xr_stand import Stand

CUBE_TOP_M, HELD_AT_M = 0.05, 0.2  # over its middle; over the table
HOLD_LAG_M = 0.005

pytestmark = pytest.mark.slow


@pytest.fixture
def holder(served_person: Person) -> Person:
    """Somebody with the cube in the right hand."""
    served_person.take("right", "cube", CUBE_TOP_M)
    served_person.reach("right", np.add(served_person.palm("right"), (0, HELD_AT_M, 0)))
    served_person.frames(8)
    return served_person


def in_hand(person: Person) -> np.ndarray:
    """(3,) metres, from the palm to the cube, as the room has it: a turn of it changes nothing."""
    palm = np.array(person.line["hands"]["right"]["grip"]["position"])
    return person.in_room(place(person.line, "cube")) - palm


def test_recentring_takes_what_is_held_along_and_is_no_blow(holder, served: Stand):
    turn = Pose(np.array([0.4, 1.6, 0.3]), np.array([math.cos(0.2), 0, math.sin(0.2), 0]))
    holder.remote.head = turn
    holder.frames(4)
    before, length = place(holder.line, "cube"), np.linalg.norm(in_hand(holder))
    served.recentre()
    holder.until(lambda line: line["recentred"], "recentred")
    holder.frames(6)
    assert holder.line["held"]["right"] == "cube"
    assert np.linalg.norm(place(holder.line, "cube") - before) > 0.2, "the room moved in the world"
    assert abs(np.linalg.norm(in_hand(holder)) - length) < HOLD_LAG_M
    assert holder.line["objects"]["cube"]["x"] == 0.0


def test_input_that_is_taken_away_lets_go(holder, served: Stand):
    served.switch_input()
    line = holder.until(lambda line: not line["hands"]["right"]["active"], "inactive")
    assert line["held"]["right"] is None and line["state"] == "FOCUSED"
    holder.until(lambda line: place(line, "cube")[1] < HELD_AT_M, "fallen")
    served.switch_input()
    holder.until(lambda line: line["hands"]["right"]["active"], "active again")
    holder.frames(3)
    assert holder.line["held"]["right"] is None, "a hand that comes back closed takes nothing"
