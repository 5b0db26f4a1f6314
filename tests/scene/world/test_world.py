"""A world touched live: hands, rays, time in frames of any length, edits, snapshots."""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.scene.document.scene_file import SceneFile
from shapeshift.scene.pose import Pose
from shapeshift.scene.world.world import FLOOR_NAME, World
from tests.support.scene.world_scenes import (
    BOX,
    HALF,
    STATES,
    Points,
    at,
    item,
    model,
    place,
    reaction,
    real,
)

pytest.importorskip("rapier3d")


def thought(*items, **file) -> World:
    """A world of points that fall."""
    scene = SceneFile(folder=Path(), items=items, **file)
    names = [obj.name for obj in scene.all_items]
    return World(scene, dict.fromkeys(names, model()), dict.fromkeys(names, BOX), Points())


# Hands


def test_a_hand_grabs_carries_and_lets_go():
    world = real(item(position=(0, 0.05, 0), reactions=(reaction("grab", "fire"),)))
    assert world.held("right") is None and world.grab("right") is None  # nowhere yet
    world.move_hand("right", at(0, 0.5, 0))
    assert world.grab("right") is None and world.grab("right", reach_m=0.45) == "a"
    assert world.held("right") == "a" and world.nearest(np.array([0, 0.5, 0]), 0.5)[0] == "a"
    first = world.step()
    assert [deed["did"] for deed in first.hands] == ["miss", "grab"]
    assert first.events[0]["to"] == "fire" and first.x == {"a": 1.0}
    for step in range(90):
        world.move_hand("right", at(0.004 * step, 0.6, 0))
        world.step()
    assert place(world)[0] == pytest.approx(0.004 * 89, abs=0.02) and place(world)[1] > 0.1
    world.release("right")
    world.release("right")
    record = world.step()
    assert record.hands == [{"hand": "right", "did": "release", "object": "a"}]
    assert world.held("right") is None and world.physics.velocity(1)[0][0] > 0.3


def test_a_lost_hand_lets_go_and_is_nowhere():
    world = real(item())
    world.move_hand("left", at(0, 1, 0))
    world.grab("left")
    world.move_hand("left", None)
    world.move_hand("left", None)  # and stays lost
    assert world.held("left") is None and "left" not in world.hands
    assert [deed["did"] for deed in world.step().hands] == ["grab", "lose"]


def test_two_hands_hold_one_body_and_one_hand_one_body():
    world = real(item("a"), item("b", position=(1, 1, 0)))
    for hand in ("left", "right"):
        world.move_hand(hand, at(0, 1, 0))
        assert world.grab(hand) == "a"
    assert world.grab_body("left", "b", np.array([1, 1, 0])) == "b"
    assert (world.held("left"), world.held("right")) == ("b", "a")
    world.remove("b")
    assert world.held("left") is None and world.held("right") == "a"
    world.step()


def test_a_jump_takes_hand_and_body_along():
    """A snap turn by 90 degrees in the middle of a swing: what is thrown goes where it turned."""
    world = real(item(position=(0, 1, 0)), floor_y=None, gravity_m_s2=0.0)
    world.move_hand("right", at(0, 1, 0))
    world.grab("right")
    turn = at(0, 0, 0, wxyz=(0.5**0.5, 0, 0.5**0.5, 0)).matrix()  # +X becomes -Z
    turned = np.eye(3)
    for number in range(1, 45):
        if number == 30:
            world.carry("right", turn)
            turned = turn[:3, :3]
            np.testing.assert_allclose(world.objects["a"].pose.position[0], 0, atol=1e-3)
        hand = turned @ np.array([2.0 * number / 90, 1, 0])
        world.move_hand("right", Pose(hand, world.hands["right"].wxyz))
        world.advance(1 / 90)
    world.release("right")
    world.step()
    thrown, _ = world.physics.velocity(world.objects["a"].body)
    assert np.linalg.norm(thrown - [0, 0, -2.0]) < 0.1
    world.carry("right", turn)  # empty: nothing is carried
    assert np.allclose(world.hands["right"].position, hand)


@pytest.mark.parametrize("name", ["table", "nobody", FLOOR_NAME])
def test_what_cannot_be_held_is_not(name):
    world = real(item("a"), item("table", static=True))
    world.move_hand("mouse", at(0, 1, 0))
    assert world.grab_body("mouse", name, np.zeros(3)) is None and not world.holds
    assert world.step().hands == [{"hand": "mouse", "did": "miss"}]


# Rays


def test_a_ray_acts_and_an_aim_does_not():
    world = real(item(position=(0, 1, 0), reactions=(reaction("ray", "ice"),)))
    hit = world.aim((0, 1, 2), (0, 0, -3))
    assert hit.object == "a" and hit.distance_m == pytest.approx(2 - HALF, abs=1e-4)
    np.testing.assert_allclose(hit.point, [0, 1, HALF], atol=1e-4)
    assert world.step().rays == [] and world.objects["a"].reaction_state.x == 0
    assert world.ray((0, 1, 2), (0, 0, -3)).object == "a"
    record = world.step()
    assert record.rays[0]["object"] == "a" and record.events[0]["on"] == "ray"
    assert world.objects["a"].reaction_state.x == 0.5
    assert world.aim((5, 1, 0), (0, -1, 0)).object == FLOOR_NAME
    assert world.ray((5, 1, 0), (0, 1, 0)) is None and world.step().rays[0]["object"] is None


# Time


@pytest.mark.parametrize("frame_hz", [20, 50, 60, 72, 90, 144, 1000])
def test_frames_of_any_length_give_the_same_steps(frame_hz):
    """Hands that move evenly and bodies that fall: nothing depends on how frames fall."""
    frames, steps = thought(item()), thought(item())
    for number in range(1, frame_hz // 2 + 1):
        for record in frames.advance(1 / frame_hz):
            steps.step()
            assert record.step == steps.steps
        assert abs(frames.steps - number * 90 / frame_hz) < 1 + 1e-6
    assert frames.steps == 90 * (frame_hz // 2) // frame_hz
    np.testing.assert_array_equal(place(frames), place(steps))


@pytest.mark.parametrize("frame_hz", [24, 60, 72, 90, 144])
def test_what_is_thrown_flies_with_its_hand_at_any_frame_rate(frame_hz):
    world = real(item(position=(0, 1, 0)), floor_y=None, gravity_m_s2=0.0)
    world.move_hand("right", at(0, 1, 0))
    world.grab("right")
    speed = 2.0
    for number in range(1, frame_hz // 2):
        world.move_hand("right", at(speed * number / frame_hz, 1, 0))
        world.advance(1 / frame_hz)
    world.release("right")
    world.advance(1 / frame_hz)
    thrown, _ = world.physics.velocity(world.objects["a"].body)
    assert np.linalg.norm(thrown - [speed, 0, 0]) < 0.05 * speed


def test_a_long_frame_makes_up_for_eight_steps_and_no_more():
    world = thought(item())
    assert len(world.advance(0.5)) == 8
    assert len(world.advance(0.0)) == len(world.advance(float("nan"))) == 0
    world.paused = True
    assert world.advance(0.5) == [] and world.steps == 8
    assert world.step().step == 9  # by hand it goes on


def test_a_hand_that_moved_while_all_held_still_flings_nothing():
    world = real(item(position=(0, 1, 0)), floor_y=None, gravity_m_s2=0.0)
    world.move_hand("right", at(0, 1, 0))
    world.grab("right")
    world.paused = True
    world.move_hand("right", at(0.02, 1, 0))
    world.advance(0.1)
    world.paused = False
    world.advance(0.1)
    world.release("right")
    speed = np.linalg.norm(world.physics.velocity(world.objects["a"].body)[0])
    assert speed < 0.05


def test_between_two_steps_it_is_drawn_between_them():
    world = thought(item())
    world.advance(8.0 / 90)
    before, now = world.objects["a"].before.position[1], place(world)[1]
    assert before > now and world.drawn().objects[0].world_from_object.position[1] == before
    world.advance(0.25 / 90)  # no step is due
    assert world.steps == 8
    y = world.drawn().objects[0].world_from_object.position[1]
    assert y == pytest.approx(before + 0.25 * (now - before), abs=1e-9)
    world.step()
    assert world.drawn().objects[0].world_from_object.position[1] == place(world)[1]


def test_drawn_never_goes_back():
    world, rng, last = thought(item()), np.random.default_rng(1), 2.0
    for _ in range(300):
        world.advance(rng.uniform(0, 0.02))
        y = world.drawn().objects[0].world_from_object.position[1]
        assert y <= last + 1e-12
        last = y


@pytest.mark.parametrize("frame_hz", [60, 72, 90, 120])
def test_what_a_hand_carries_is_drawn_where_the_hand_is(frame_hz):
    """At 1 m/s at most 5 mm behind once it has been taken; let go it does not step back."""
    world = real(item(position=(0, 1, 0)), floor_y=None, gravity_m_s2=0.0)
    world.move_hand("right", at(0, 1, 0))
    world.grab("right")
    drawn = []
    for number in range(1, frame_hz + 1):
        if number < frame_hz // 2:
            world.move_hand("right", at(number / frame_hz, 1, 0))
        elif number == frame_hz // 2:
            world.release("right")
        world.advance(1 / frame_hz)
        drawn.append(world.drawn().objects[0].world_from_object.position[0])
        if 0.3 * frame_hz < number < frame_hz // 2:
            assert abs(drawn[-1] - number / frame_hz) < 0.005
    steps = np.diff(drawn[frame_hz // 4 :]) * frame_hz  # m/s
    assert 0.85 < steps.min() and steps.max() < 1.15


def test_at_rest_the_drawn_scene_is_the_same_object():
    world = real(item(position=(0, HALF, 0)))
    for _ in range(500):
        world.advance(1 / 60)
        if world.resting:
            break
    assert world.resting and world.time_s < 5
    scene = world.drawn()
    world.advance(1 / 60)
    assert world.drawn() is scene
    world.control("a", 0.7)
    assert world.drawn() is not scene and world.drawn().objects[0].x == 0.7
    world.ray((0, 3, 0), (0, -1, 0))
    assert not world.resting


# What there is


def test_objects_come_go_are_placed_and_hidden():
    world = real(item("a"))
    world.add(item("b", position=(1, 1, 0)), model(), BOX)
    with pytest.raises(ValueError, match="there is an object 'b'"):
        world.add(item("b"), model(), BOX)
    assert [obj.label for obj in world.drawn().objects] == [1, 2]
    world.move_object("b", at(2, 3, 4))
    world.show("b", False)
    obj = world.drawn().objects[1]
    assert list(obj.world_from_object.position) == [2, 3, 4] and not obj.visible
    assert world.aim((2, 9, 4), (0, -1, 0)).object == "b"  # hidden, but there
    world.remove("b")
    assert world.aim((2, 9, 4), (0, -1, 0)).object == FLOOR_NAME
    assert [obj.name for obj in world.drawn().objects] == ["a"]
    for deed in (world.remove, world.object_named, lambda name: world.control(name, 0.5)):
        with pytest.raises(ValueError, match="there is no object 'b'; there are a"):
            deed("b")


def test_a_control_ends_what_a_reaction_began():
    world = thought(item(reactions=(reaction("ray", "fire", seconds=1.0),)))
    world.ray((0, 1, 1), (0, 0, -1))
    for _ in range(30):
        world.step()
    assert 0 < world.objects["a"].reaction_state.x < 1
    world.control("a", 0.25)
    for _ in range(90):
        world.step()
    assert (
        world.objects["a"].reaction_state.x == 0.25
        and world.objects["a"].reaction_state.state == "normal"
    )


def test_what_is_put_elsewhere_by_hand_is_told_though_it_lies_still():
    world = real(item("a", position=(0, HALF, 0)), item("post", static=True, position=(1, 1, 0)))
    while not world.resting:
        world.step()
    assert not world.step().is_news
    world.control("a", 0.25)
    world.move_object("post", at(2, 1, 0))
    record = world.step()
    assert record.x == {"a": 0.25} and record.poses["post"][:3] == [2, 1, 0]
    saved = world.snapshot()
    world.restore(saved)
    assert set(world.step().x) == {"a", "post"}  # who restores is told all anew


def test_a_snapshot_brings_all_of_it_back():
    world = real(item("a", states=STATES, reactions=(reaction("collision", "next"),)))
    world.move_hand("right", at(0, 1, 0))
    for _ in range(10):
        world.step()
    world.grab("right", 0.5)
    world.step()
    saved, first = world.snapshot(), []
    for _ in range(2):
        world.move_hand("right", at(0.2, 1, 0))
        told = [world.step() for _ in range(30)]
        world.release("right")
        told += [world.step() for _ in range(60)]
        first.append((world.physics.hash(), [(r.x, r.contacts, r.events, r.hands) for r in told]))
        world.add(item("b", position=(0, 2, 0)), model(), BOX)
        world.remove("a")
        world.restore(saved)
        assert list(world.objects) == ["a"] and world.held("right") == "a" and world.steps == 11
    assert first[0][0] == first[1][0] and str(first[0][1][1:]) == str(first[1][1][1:])
