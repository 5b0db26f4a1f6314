"""Moving in a real session: the world in one's hands, flight, jumps, true size, all anew."""

import numpy as np
import pytest

from shapeshift.vr.play_space import PlaySpace, heading
from tests.support.xr.person import pose_of


def play_space(line: dict) -> PlaySpace:
    return PlaySpace(pose_of(line["standing"]), line["standing"]["scale"])


def feet(line: dict) -> np.ndarray:
    """(3,) metres of the world: the floor of the room below the head."""
    return play_space(line).point(np.array(line["head"]["position"]) * [1, 0, 1])


@pytest.mark.slow
def test_the_world_follows_the_hands_and_comes_back(person):
    first = person.frame()
    floor_y = feet(first)[1]
    # Both hands away from the table and the panel; they take hold of the world.
    person.controller("left").position, person.controller("right").position = (
        (-0.6, 1.0, 0.1),
        (0.4, 1.0, 0.1),
    )
    before = person.frames(2)
    person.controller("left").squeeze = person.controller("right").squeeze = 1.0
    line = person.frames(3)
    assert line["held"] == {"left": None, "right": None}
    held = [person.palm(side) for side in ("left", "right")]
    # From one metre apart to half a metre, and a quarter of a turn: twice the room's metres.
    person.controller("left").position, person.controller("right").position = (
        (-0.1, 1.2, 0.35),
        (-0.1, 1.2, -0.15),
    )
    line = person.frames(4)
    assert abs(line["standing"]["scale"] - 2.0) < 1e-3
    for side, world in zip(("left", "right"), held, strict=True):
        np.testing.assert_allclose(person.palm(side), world, atol=2e-3)
    turn = heading(pose_of(line["standing"]).wxyz) - heading(pose_of(before["standing"]).wxyz)
    assert abs(abs(np.degrees(turn)) - 90) < 0.5
    person.controller("left").squeeze = person.controller("right").squeeze = 0.0
    line = person.frames(3)
    # Up by the stick, then a jump back onto the floor.
    person.controller("right").stick = (0.0, 1.0)
    line = person.until(lambda line: feet(line)[1] > floor_y + 0.3, "flown up")
    person.controller("right").stick = (0.0, 0.0)
    high = person.frames(2)
    with person.pressing("right", "primary"):
        assert play_space(person.frames(2)).scale == play_space(high).scale
        np.testing.assert_allclose(feet(person.line), feet(high), atol=1e-5)
    line = person.line
    assert abs(feet(line)[1] - floor_y) < 1e-4
    assert np.linalg.norm(feet(line) - feet(high)) > 1.0
    # A short press: true size on the spot; a long one: where the scene is looked at first.
    with person.pressing("right", "secondary"):
        person.frame()
    assert person.line["standing"]["scale"] == 1.0
    np.testing.assert_allclose(feet(person.line), feet(line), atol=1e-4)
    with person.pressing("right", "secondary"):
        person.until(lambda line: line["standing"] == first["standing"], "all anew")
    assert person.line["standing"] == first["standing"]
