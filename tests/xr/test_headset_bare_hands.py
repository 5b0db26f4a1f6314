"""Hands without controllers in a real session: Monado makes their joints of how fingers bend."""

import numpy as np
import pytest

from tests.support.xr.person import (
    CARRIES,
    CUBE_TOP_M,
    FREE,
    RING_TOP_M,
    Person,
    in_front,
    place,
)

# Little, ring, middle, index finger, thumb; 0 straight, 1 bent.
OPEN, PINCH, FIST, POINT = (0.0,) * 5, (0.0, 0.0, 0.0, 1.0, 1.0), (1.0,) * 5, (1.0, 1.0, 1.0, 0, 0)


def bend(person: Person, side: str, curls: tuple[float, ...]) -> dict:
    person.controller(side).curls = curls
    return person.frames(2)


def above(person: Person, name: str, top_m: float) -> dict:
    """The palm goes over an object; what the runtime has for the controller is beside it."""
    for _ in range(2):
        goal = np.add(place(person.line, name), (0, top_m + 0.02, 0))
        away = goal - person.palm("right")  # the scene lies as the room does
        person.move("right", np.add(person.controller("right").position, away))
    return person.frame()


@pytest.mark.slow
@pytest.mark.parametrize("how", [PINCH, FIST], ids=["pinch", "fist"])
def test_a_pinch_and_a_fist_take_carry_and_let_go(bare, how):
    name, top_m = ("ring", RING_TOP_M) if how == PINCH else ("cube", CUBE_TOP_M)
    above(bare, name, top_m)
    assert bare.line["held"]["right"] is None
    line = bend(bare, "right", how)
    assert line["held"]["right"] == name
    lifted = np.add(bare.controller("right").position, (0, 0.25, 0))
    before = place(bare.line, name)
    bare.move("right", lifted)
    bare.frames(10)
    np.testing.assert_allclose(place(bare.line, name) - before, (0, 0.25, 0), atol=0.02)
    assert bend(bare, "right", OPEN)["held"]["right"] is None
    bare.until(lambda line: place(line, name)[1] < 0.1, "fallen")
    told = [event["on"] for line in bare.program.lines for event in line["events"]]
    assert "ray" not in told, "what is within reach comes first"


@pytest.mark.slow
@pytest.mark.parametrize("bare", [True], indirect=True, ids=["no controllers asked for"])
def test_a_palm_that_is_turned_up_brings_the_panel_and_a_finger_presses_it(bare):
    left, right = bare.controller("left"), bare.controller("right")
    left.position, right.position = CARRIES, FREE
    bend(bare, "right", POINT)
    assert bare.line["hands"]["right"]["squeeze"] == 0 and not bare.line["panel"]["open"]
    left.wxyz = (0.0, 0.0, 0.0, 1.0)  # as it was, the palm was down
    bare.until(lambda line: line["panel"]["open"], "a panel")
    line = bare.frames(12)
    fire = np.mean(line["panel"]["slider"], axis=0)  # the third of five stops
    bare.touch("right", in_front(line, fire))
    assert bare.frames(2)["objects"]["cube"]["x"] == 0, "a finger that is only close does nothing"
    bare.touch("right", fire, 0.01)
    bare.until(lambda line: line["objects"]["cube"]["x"] == 0.5, "fire")
    right.follows = False
    line = bare.until(lambda line: not line["hands"]["right"]["active"], "lost")
    assert line["hands"]["right"]["grip"] is None
