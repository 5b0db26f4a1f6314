"""Hands that touch a world: what is taken, thrown, hit and felt, with plain frames."""

import math
from dataclasses import replace
from types import SimpleNamespace as Thing

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.scene.world.world import FLOOR_NAME
from shapeshift.vr.frame import SIDES, Pulse
from shapeshift.vr.locomotion import Travel, ground_of, move
from shapeshift.vr.play_space import PlaySpace, pinned, turned
from shapeshift.vr.touching import (
    ACTED,
    FULL_N_S,
    LEFT,
    REACH_M,
    TAKEN,
    TOUCHED,
    Offer,
    Touching,
    at_rest,
    feel,
    follow,
    strongest,
    touch,
)
from tests.support.scene.world_scenes import item, reaction, real
from tests.support.vr.vr_frames import LOST, at, frame, hand, tilted, yawed

pytest.importorskip("rapier3d", reason="the physics engine is not installed")
HZ = 90
HERE = (0.2, 1.2, -0.4)  # of the right hand
HOME = PlaySpace()
ROOM = PlaySpace(Pose(np.array([3.0, 0.5, -1]), yawed(0.9)), 1.0)


def world_with(*places, play_space=HOME, **named):
    """Boxes of 10 cm at places of the room."""
    names = "abcdef"
    items = [
        item(names[i], position=tuple(play_space.point(np.array(place))), **named)
        for i, place in enumerate(places)
    ]
    return real(*items, floor_y=None, gravity_m_s2=0.0)


def run(world, frames, touching=None, play_space=HOME, seconds=1 / HZ):
    """As a headset's loop does it, without locomotion; all that was told."""
    touching, told, records = touching or Touching(seen=frozenset(SIDES)), [], []
    for one in frames:
        touching, touched = touch(world, touching, one, play_space)
        follow(world, one, play_space, False)
        records = world.advance(seconds)
        felt = feel(world, records)
        told.append(replace(touched, pulses=strongest([*touched.pulses, *felt])))
    return touching, told


SQUEEZE = frame(right=hand(squeeze=1.0))
OPEN = frame(right=hand())
NEAR = (HERE[0], HERE[1], HERE[2] - 0.1)  # the box's face is 5 cm from the palm


@pytest.mark.parametrize("scale", [1.0, 0.3, 3.0])
def test_a_squeeze_takes_the_nearest_within_reach_at_every_scale(scale):
    room = replace(ROOM, scale=scale)
    # 5 cm of a box lie between its middle and its face whatever the scale of the room.
    for gap, taken in ((0.09, "a"), (0.11, None)):
        place = np.array(HERE) - [0, 0, gap + 0.05 / scale]
        level = replace(room, world_from_play=Pose(room.world_from_play.position, at(0, 0, 0).wxyz))
        world = world_with(place, play_space=level)
        touching, told = run(world, [OPEN, SQUEEZE], play_space=level)
        assert told[-1].held == {"left": None, "right": taken}
        assert touching.busy == (frozenset({"right"}) if taken else frozenset())
        assert at_rest(SQUEEZE, touching).hands["right"].squeeze == (0.0 if taken else 1.0)


@pytest.mark.parametrize("scale", [1.0, 0.3, 3.0])
def test_what_a_squeeze_would_take_is_offered_first(scale):
    level = PlaySpace(Pose(ROOM.world_from_play.position, at(0, 0, 0).wxyz), scale)
    for gap, offered in ((REACH_M - 0.01, True), (REACH_M + 0.01, False)):
        place = np.array(HERE) - [0, 0, gap + 0.05 / scale]
        world = world_with(place, play_space=level)
        touching, told = run(world, [OPEN], play_space=level)
        assert told[-1].offers == ((Offer("right", "a", "hand"),) if offered else ())
        _, told = run(world, [SQUEEZE], touching, level)
        assert (told[-1].held["right"] == "a") == offered, "what is offered is what is taken"
        assert told[-1].offers == (), "a hand that is at work is offered nothing"


def test_a_ray_is_offered_what_answers_to_it():
    far = (HERE[0], HERE[1], HERE[2] - 2.0)
    world = world_with(far, reactions=(reaction("ray", "fire"),))
    _, told = run(world, [OPEN])
    assert told[-1].offers == (Offer("right", "a", "ray"),)
    _, told = run(world, [frame(right=hand("right", wxyz=tilted(0.5)))])
    assert told[-1].offers == (), "it points elsewhere"
    _, told = run(world, [frame(right=LOST)])
    assert told[-1].offers == ()
    silent = world_with(far, reactions=(reaction("grab", "fire"),))
    _, told = run(silent, [OPEN])
    assert told[-1].offers == (), "nothing would come of it"


def test_reach_is_a_hand_s():
    assert 0.05 <= REACH_M <= 0.15


@pytest.mark.parametrize("rate", [90, 72, 60, 20])
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_what_is_let_go_flies_with_the_hand(rate, scale):
    room = replace(ROOM, scale=scale)
    world = world_with(HERE, play_space=room)
    speed = np.array([1.0, 1.4, -0.8])  # m/s in the room
    away = [np.array(HERE) + speed * i / rate for i in range(rate // 3)]
    moving = [frame(right=hand("right", place, squeeze=1.0)) for place in away]
    touching, told = run(world, [SQUEEZE, *moving], play_space=room, seconds=1 / rate)
    assert told[-1].held["right"] == "a"
    lag = world.objects["a"].pose.position - room.point(away[-1])
    assert np.linalg.norm(lag) <= 0.005 + np.linalg.norm(speed) * scale / 90
    last = away[-1] + speed / rate
    _, told = run(world, [frame(right=hand("right", last))], touching, room, 1 / rate)
    assert told[-1].held["right"] is None and Pulse("right", *LEFT) in told[-1].pulses
    flew = world.physics.velocity(world.objects["a"].body)[0]
    turn = room.world_from_play.matrix()[:3, :3]
    wanted = turn @ speed * scale
    assert np.linalg.norm(flew - wanted) <= 0.05 * np.linalg.norm(wanted) + 1e-3


def test_a_lost_hand_lets_go_and_one_that_comes_back_squeezing_waits_until_it_opens():
    world = world_with(NEAR, reactions=(reaction("ray", "fire"),))
    touching, told = run(world, [SQUEEZE] * 5)
    assert told[-1].held["right"] == "a"
    touching, told = run(world, [frame(right=LOST)], touching)
    assert told[-1].held["right"] is None and "right" not in world.hands
    assert touching == Touching(seen=frozenset({"left"}))
    both = aimed(squeeze=1.0, trigger=1.0)
    touching, told = run(world, [both, both], touching)
    assert told[-1].held["right"] is None and not any(t.beams for t in told)
    assert at_rest(both, touching).hands["right"].squeeze == 0  # nor does it hold the world
    touching, told = run(world, [OPEN, SQUEEZE], touching)
    assert told[-1].held["right"] == "a"


def test_nobody_begins_with_a_hand_that_is_closed_already():
    world = world_with(NEAR)
    touching, told = run(world, [SQUEEZE, SQUEEZE], Touching())
    assert told[-1].held["right"] is None and touching.busy == {"right"}


def test_a_hand_whose_object_was_taken_away_does_not_hold_the_world():
    world = world_with(NEAR)
    touching, _ = run(world, [SQUEEZE])
    world.remove("a")
    touching, told = run(world, [SQUEEZE], touching)
    assert told[-1].held["right"] is None
    assert at_rest(SQUEEZE, touching).hands["right"].squeeze == 0
    _, travel, _ = move(PlaySpace(), Travel(), at_rest(SQUEEZE, touching), 1 / HZ)
    assert not travel.grips
    touching, _ = run(world, [OPEN, SQUEEZE], touching)
    assert at_rest(SQUEEZE, touching).hands["right"].squeeze == 1


def test_two_hands_hold_one_object():
    world = world_with((0, 1.2, -0.4))
    both = frame(
        hand("left", (-0.07, 1.2, -0.4), squeeze=1.0), hand("right", (0.07, 1.2, -0.4), squeeze=1)
    )
    _, told = run(world, [both] * 5)
    assert told[-1].held == {"left": "a", "right": "a"}


def aimed(**named):
    """A right hand that points ahead."""
    return frame(right=hand(**named))


AHEAD = (HERE[0], HERE[1], HERE[2] - 1.0)


def test_a_trigger_acts_once_a_pull_on_what_it_meets_first():
    hits = reaction("ray", "fire", cooldown_s=0.0)
    for room in (PlaySpace(), replace(ROOM, scale=0.5)):
        world = world_with(
            AHEAD, (HERE[0], HERE[1], HERE[2] - 2), play_space=room, reactions=(hits,)
        )
        touching, told = run(world, [aimed(trigger=0.6), aimed(trigger=0.9)], play_space=room)
        [seen], [shot] = told[0].beams, told[1].beams
        assert not seen.acts and seen.meets == "a" and told[0].pulses == ()
        assert shot.acts and shot.meets == "a" and told[1].pulses == (Pulse("right", *ACTED),)
        assert np.allclose(shot.start, HERE)
        assert np.allclose(room.point(shot.end), world.aim(
            room.point(np.array(HERE)), -room.pose(at(*HERE)).matrix()[:3, 2]).point)  # fmt: skip
        assert (
            world.objects["a"].reaction_state.state
            == "fire"
            != world.objects["b"].reaction_state.state
        )
        touching, told = run(world, [aimed(trigger=0.5), aimed(trigger=1)], touching, room)
        assert not any(beam.acts for t in told for beam in t.beams)
        touching, told = run(world, [aimed(trigger=0.2), aimed(trigger=1)], touching, room)
        assert told[1].beams[0].acts


def test_a_beam_into_nothing_ends_and_is_not_felt():
    world = world_with((5, 5, 5))
    _, told = run(world, [aimed(trigger=1.0)])
    [beam] = told[0].beams
    assert beam.meets is None and np.linalg.norm(beam.end - beam.start) == pytest.approx(10)
    assert told[0].pulses == ()


def test_a_controller_with_one_button_takes_acts_or_holds_the_world():
    one_button = aimed(squeeze=1.0, trigger=1.0)
    world = world_with(NEAR, reactions=(reaction("ray", "fire"),))
    touching, told = run(world, [one_button])
    assert told[0].held["right"] == "a" and told[0].beams == ()
    world = world_with(AHEAD, reactions=(reaction("ray", "fire"),))
    touching, told = run(world, [one_button])
    assert told[0].held["right"] is None and told[0].beams[0].meets == "a"
    assert at_rest(one_button, touching).hands["right"].squeeze == 0
    for world in (world_with((5, 5, 5)), world_with(AHEAD)):  # nothing, or nothing that answers
        touching, told = run(world, [one_button])
        assert at_rest(one_button, touching).hands["right"].squeeze == 1
        assert told[0].pulses == ()


def test_touch_is_felt_once_and_taking_too():
    world = world_with(NEAR)
    skin = frame(right=hand("right", (HERE[0], HERE[1], HERE[2] - 0.04)))
    _, told = run(world, [OPEN, skin, skin, OPEN, skin])
    felt = [[(p.strength, p.seconds) for p in one.pulses] for one in told]
    assert felt == [[], [TOUCHED], [], [], [TOUCHED]]
    held = frame(right=hand("right", (HERE[0], HERE[1], HERE[2] - 0.04), squeeze=1.0))
    _, told = run(world, [held, held])
    assert [t.pulses for t in told] == [(Pulse("right", *TAKEN),), ()]


def test_a_blow_is_felt_in_the_hand_that_holds():
    world = world_with(HERE, (HERE[0] + 0.3, HERE[1], HERE[2]), mass_kg=2.0)
    path = [np.array(HERE) + np.array([0.02 * i, 0, 0]) for i in range(20)]
    frames = [frame(right=hand("right", place, squeeze=1.0)) for place in path]
    _, told = run(world, [SQUEEZE, *frames])
    blows = [p for one in told[2:] for p in one.pulses]
    assert blows and {p.side for p in blows} == {"right"}
    assert 0.3 < max(p.strength for p in blows) <= 1


def test_how_strong_a_blow_is():
    world = Thing(held={"left": "a", "right": None}.get)
    pair = ["a", FLOOR_NAME]

    def felt(*impulses, between=pair):
        contacts = [{"between": between, "impulse_n_s": n} for n in impulses]
        return [p.strength for p in feel(world, [Thing(contacts=contacts)])]

    assert felt(0.001) == felt(math.nan) == felt(1.0, between=["b", FLOOR_NAME]) == []
    assert felt(FULL_N_S / 4, FULL_N_S / 100) == [0.5]
    assert felt(9 * FULL_N_S) == [1.0]


def test_a_snap_turn_takes_what_is_held_along():
    world = world_with(HERE, (0.0, 1.2, -0.62), play_space=ROOM)
    touching, _ = run(world, [SQUEEZE] * 20, play_space=ROOM)
    other = world.objects["b"].pose.position
    snap = frame(right=hand(squeeze=1.0, stick=(-1.0, 0)))
    touching, _ = touch(world, touching, snap, ROOM)
    room, _, comfort = move(ROOM, Travel(), at_rest(snap, touching), 1 / HZ)
    assert room is not ROOM and comfort.jumps
    follow(world, snap, room, True)
    world.advance(1 / HZ)
    # The hand swept over the other box, and did not strike it.
    assert np.allclose(world.objects["a"].pose.position, room.point(np.array(HERE)), atol=2e-3)
    assert np.array_equal(world.objects["b"].pose.position, other)
    touching, told = run(world, [OPEN], touching, room)
    world.advance(0.1)
    speed = np.linalg.norm(world.physics.velocity(world.objects["a"].body)[0])
    assert told[0].held["right"] is None and speed < 0.01


def test_walking_takes_what_is_held_along():
    world = world_with(HERE, play_space=ROOM)
    touching, room, travel = Touching(seen=frozenset(SIDES)), ROOM, Travel()
    walks = frame(left=hand("left", stick=(0, 1)), right=hand(squeeze=1.0))
    for _ in range(90):
        touching, touched = touch(world, touching, walks, room)
        room, travel, _ = move(room, travel, at_rest(walks, touching), 1 / HZ)
        follow(world, walks, room, False)
        world.advance(1 / HZ)
    assert touched.held["right"] == "a" and not travel.grips
    lag = world.objects["a"].pose.position - room.point(np.array(HERE))
    assert (
        np.linalg.norm(lag)
        < 0.02
        < 1.5
        < np.linalg.norm(room.world_from_play.position - ROOM.world_from_play.position)
    )


def test_a_new_origin_takes_what_is_held_along():
    world = world_with(HERE, play_space=ROOM)
    touching, _ = run(world, [SQUEEZE] * 10, play_space=ROOM)
    other = pinned(turned(ROOM, 1.0, np.zeros(3)), np.zeros(3), np.array([9.0, 2, 1]))
    new = frame(right=hand("right", (0.5, 1.0, 0.3), squeeze=1.0), recentred=True)
    touch(world, touching, new, other)
    assert np.allclose(
        world.objects["a"].pose.position, other.point(np.array([0.5, 1.0, 0.3])), atol=2e-3
    )


# ---- where one can stand


def room_with_wall():
    """A floor, a wall ahead, and a box that can be carried on the way to the left."""
    return real(
        item("wall", position=(0, 0.05, -2), static=True), item("box", position=(-1, 0.05, 0))
    )


def test_jumps_end_on_what_stands_still_at_the_foot_of_walls():
    world = room_with_wall()
    ground = ground_of(world)
    down = [np.array(p, float) for p in ((1, 1, 1), (1, -1, 1))]
    point, fine = ground(*down)
    assert fine and np.allclose(point, [1, 0, 1], atol=1e-4)
    assert ground(np.array([1, 3.0, 1]), np.array([1, 2.0, 1])) is None
    point, fine = ground(np.array([0, 0.05, 0]), np.array([0, 0.05, -5.0]))
    assert fine and np.allclose(point, [0, 0, -1.93], atol=1e-3)  # before the wall, on the floor
    point, fine = ground(np.array([0, 1.0, -2]), np.array([0, -1.0, -2]))
    assert fine and point[1] == pytest.approx(0.1, abs=1e-3)  # on top of it
    _, fine = ground(np.array([-1, 1.0, 0]), np.array([-1, -1.0, 0]))
    assert not fine  # it could be carried away
    assert ground(down[0], down[0]) is None


def test_without_a_floor_there_is_the_level_one_stands_on():
    world = real(item(position=(0, 5, 0)), floor_y=None)
    ends = np.array([1.0, 1, 1]), np.array([1.0, -1, 1])
    assert ground_of(world)(*ends) is None
    point, fine = ground_of(world, 0.25)(*ends)
    assert fine and np.allclose(point, [1, 0.25, 1])
    point, fine = ground_of(world)(np.array([0.0, 5, 2]), np.array([0.0, 5, -2]))
    assert not fine and np.allclose(point, [0, 5, 0.05], atol=1e-3)  # nothing under the box


def test_a_jump_into_a_world_of_bodies():
    world = room_with_wall()
    held = frame(right=hand("right", (0.2, 1.2, 0.0), wxyz=tilted(-0.4), primary=True))
    room, travel, comfort = move(PlaySpace(), Travel(), held, 1 / HZ, ground=ground_of(world))
    assert comfort.arc.fine
    landing = room.point(comfort.arc.landing)
    let_go = frame(right=replace(held.hands["right"], primary=False))
    room, travel, comfort = move(room, travel, let_go, 1 / HZ, ground=ground_of(world))
    assert comfort.arc is None and travel.aims is None
    assert np.allclose(room.point(frame().head.position * [1, 0, 1]), landing)
