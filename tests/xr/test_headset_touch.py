"""Hands in a real session: reach, take, carry, throw, strike, shoot, lose, turn."""

import numpy as np
import pytest

from tests.support.xr.person import CUBE_TOP_M, RING_TOP_M, events, heading_deg, place, pose_of

HOLD_LAG_M = 0.005  # of what is held behind its hand, at rest
G_M_S2 = 9.81
HZ = 90  # steps of the physics a second
STEP = np.array([0.05, 0.06, 0.0])  # of a hand in a frame of 50 ms: 1.0 m/s aside, 1.2 m/s up


@pytest.mark.slow
def test_reach_squeeze_carry_and_let_go(person):
    before = person.take("right", "ring", RING_TOP_M)
    felt = [pulse for line in person.program.lines[-6:] for pulse in line["pulses"]]
    assert any(side == "right" and strength > 0.3 for side, strength, _ in felt)
    offer = {"hand": "right", "object": "ring", "by": "hand"}
    offered = [line["frame"] for line in person.program.lines if offer in line["offers"]]
    assert offered and max(offered) < before["frame"], "it lit up before it was taken, and no more"
    offset = place(before, "ring") - person.palm("right")
    for way in ((0, 0.25, 0), (-0.2, 0.25, -0.1), (-0.2, 0.3, 0.1)):
        person.reach("right", np.add(person.palm("right"), way))
    person.frames(10)
    away = place(person.line, "ring") - person.palm("right")
    assert np.linalg.norm(away - offset) < HOLD_LAG_M
    assert np.linalg.norm(place(person.line, "ring") - place(before, "ring")) > 0.3
    assert events(person.program.lines, "ring")[0] == ("grab", "brass", "hot")
    person.until(lambda line: line["objects"]["ring"]["x"] == 1.0, "hot")
    line = person.squeeze("right", 0.0)
    assert line["held"]["right"] is None
    person.until(lambda line: place(line, "ring")[1] < 0.1, "fallen")


@pytest.mark.slow
def test_a_throw_flies_as_the_hand_did_and_what_it_strikes_changes_x(quick_person):
    person = quick_person
    swing, flight = person.throw("right", "cube", CUBE_TOP_M, STEP)
    hand = STEP / np.mean(np.diff([line["seen_s"] for line in swing]))
    flight = flight[4:]  # until then it is drawn ever less ahead, as what a hand holds is
    # What flies free is drawn a step of the physics late.
    since_s = np.array([line["seen_s"] for line in flight]) - swing[-1]["seen_s"] - 1 / HZ
    way = np.array([place(line, "cube") for line in flight])
    way[:, 1] += 0.5 * G_M_S2 * since_s**2  # as if nothing drew it down
    speed, _ = np.polyfit(since_s, way, 1)
    slack = 0.05 * np.linalg.norm(hand)
    np.testing.assert_allclose(speed[[0, 2]], hand[[0, 2]], atol=slack)
    assert abs(speed[1] - hand[1]) < slack + G_M_S2 / HZ  # let go up to a step early or late
    person.until(lambda line: line["objects"]["cube"]["x"] >= 0.25, "ice")
    assert events(person.program.lines, "cube")[0] == ("collision", "normal", "ice")


def in_world(line: dict, room: np.ndarray) -> np.ndarray:
    """(3,) metres of the world of a place of the room, at the true scale."""
    matrix = pose_of(line["standing"]).matrix()
    return matrix[:3, :3] @ room + matrix[:3, 3]


@pytest.mark.slow
@pytest.mark.parametrize("how", ["tracking", "controller"])
def test_a_lost_hand_lets_go_and_does_not_take_again_by_itself(person, how):
    person.take("right", "cube", CUBE_TOP_M)
    person.reach("right", np.add(person.palm("right"), (0, 0.2, 0)))
    assert person.line["held"]["right"] == "cube"
    hand = person.controller("right")
    hand.there = False
    if how == "controller":
        hand.squeeze = 0.0
    line = person.until(lambda line: not line["hands"]["right"]["active"], "lost")
    assert line["held"]["right"] is None and line["hands"]["right"]["grip"] is None
    fallen = person.until(lambda line: place(line, "cube")[1] < 0.1, "fallen")
    hand.there = True
    back = person.until(lambda line: line["hands"]["right"]["active"], "found again")
    person.frames(3)
    assert person.line["held"]["right"] is None
    assert abs(place(back, "cube")[1] - place(fallen, "cube")[1]) < 0.05


@pytest.mark.slow
def test_the_trigger_shoots_what_the_hand_points_at(person):
    person.put("right", np.add(place(person.line, "ball"), (0.1, 0.2, 0.5)))
    person.aim("right", place(person.line, "ball"))
    person.controller("right").trigger = 1.0
    line = person.until(lambda line: any(e["on"] == "ray" for e in line["events"]), "a shot")
    assert events([line], "ball") == [("ray", "ball", "confetti")]
    assert any(side == "right" for side, _, _ in line["pulses"])
    person.frames(5)
    person.until(lambda line: line["objects"]["ball"]["x"] == 1.0, "confetti")
    assert len(events(person.program.lines, "ball")) == 1, "a trigger that is held acts once"


@pytest.mark.slow
def test_snap_turns_are_thirty_degrees_about_the_head_and_take_what_is_held_along(person):
    person.take("left", "cube", CUBE_TOP_M)
    person.reach("left", np.add(person.palm("left"), (0, 0.3, 0.1)))
    before = person.frames(6)
    held = person.in_room(place(before, "cube"))
    hand = person.controller("right")
    for count in (1, 2):
        hand.stick = (1.0, 0.0)
        person.frames(6)  # held: one turn
        hand.stick = (0.0, 0.0)
        line = person.frames(3)
        turned = (heading_deg(line) - heading_deg(before) + 180) % 360 - 180
        assert turned == pytest.approx(-30 * count, abs=0.01)
    head = np.array(before["head"]["position"])
    np.testing.assert_allclose(in_world(line, head), in_world(before, head), atol=1e-4)
    assert line["held"]["left"] == "cube"
    assert np.linalg.norm(person.in_room(place(line, "cube")) - held) < HOLD_LAG_M
    struck = [event for event in events(person.program.lines, "cube") if event[0] == "collision"]
    assert not struck, "a turn is no blow"


@pytest.mark.slow
def test_walking_goes_where_the_head_looks(person):
    before = person.frame()
    person.controller("left").stick = (0.0, 1.0)
    walked = person.until(
        lambda line: np.linalg.norm(
            np.subtract(line["standing"]["position"], before["standing"]["position"])
        ) > 0.4, "walked"
    )  # fmt: skip
    way = np.subtract(walked["standing"]["position"], before["standing"]["position"])
    ahead = in_world(before, np.array([0, 0, -1.0])) - in_world(before, np.zeros(3))
    np.testing.assert_allclose(way / np.linalg.norm(way), ahead, atol=0.01)
