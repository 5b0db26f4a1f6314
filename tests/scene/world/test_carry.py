"""A hand that jumps with what it holds: nothing is hit on the way, and throws stay throws."""

import math

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.scene.world.grab import jumped
from shapeshift.scene.world.physics import Physics
from tests.support.scene.physics_things import at, box
from tests.support.scene.world_scenes import item, real

pytest.importorskip("rapier3d", reason="the physics engine is not installed")

CUBE = [box(0.05, 0.05, 0.05)]
WALL = [box(0.05, 2, 2)]
TURN = np.array([math.cos(0.5), 0, math.sin(0.5), 0])
JUMP = Pose(np.array([4.0, 0.5, -1]), TURN).matrix()
SPEED = np.array([1.2, 0.6, -0.4])  # m/s


def carrying(hands: int = 1) -> tuple[Physics, int, list[int], list[Pose]]:
    """A cube in full flight in one hand, or between two."""
    physics = Physics()
    body = physics.add_body(CUBE, at(0, 1, 0), 0.4)
    poses = [at(0.04 * (1 - 2 * n), 1, 0) for n in range(hands)]
    grabs = [physics.grab(body, pose, pose.position) for pose in poses]
    for _ in range(40):
        poses = [Pose(pose.position + SPEED / 90, pose.wxyz) for pose in poses]
        for grab, pose in zip(grabs, poses, strict=True):
            physics.move_hand(grab, pose)
        physics.step()
    return physics, body, grabs, poses


def test_a_jump_takes_all_along_through_a_wall():
    for hands in (1, 2):
        physics, body, grabs, poses = carrying(hands)
        physics.add_static(WALL, at(2.5, 1, 0))
        before, speed = physics.pose(body), physics.velocity(body)
        physics.carry(grabs[0], JUMP)
        wanted = jumped(before, JUMP)
        assert np.allclose(physics.pose(body).position, wanted.position, atol=1e-6)
        assert abs(physics.pose(body).wxyz @ wanted.wxyz) == pytest.approx(1, abs=1e-6)
        for now, was in zip(physics.velocity(body), speed, strict=True):
            assert np.allclose(now, JUMP[:3, :3] @ was, atol=1e-6)
        for grab, pose in zip(grabs, poses, strict=True):
            physics.move_hand(grab, jumped(pose, JUMP))
        assert physics.step() == []  # nothing was struck
        assert np.linalg.norm(physics.pose(body).position - wanted.position) < 0.01


def test_a_throw_after_a_jump_is_the_throw_turned():
    physics, body, grabs, _ = carrying()
    physics.carry(grabs[0], JUMP)
    physics.release(grabs[0])
    thrown = physics.velocity(body)[0]
    assert np.allclose(thrown, JUMP[:3, :3] @ SPEED, atol=0.05 * np.linalg.norm(SPEED))
    assert physics.held(grabs[0]) is None


def test_a_snapshot_after_a_jump_goes_on_to_the_bit():
    physics, _, grabs, poses = carrying()
    physics.carry(grabs[0], JUMP)
    saved = physics.snapshot()
    other = Physics()
    other.restore(saved)
    for world in (physics, other):
        world.move_hand(grabs[0], jumped(poses[0], JUMP))
        for _ in range(20):
            world.step()
        world.release(grabs[0])
        world.step()
    assert physics.hash() == other.hash()


def test_who_holds_nothing_cannot_jump():
    with pytest.raises(ValueError, match="there is no grab 9"):
        Physics().carry(9, JUMP)


def test_a_world_carries_the_object_and_all_its_hands():
    world = real(item(position=(0, 0.5, 0)))
    for side, x in (("left", -0.06), ("right", 0.06)):
        world.move_hand(side, at(x, 0.5, 0))
        assert world.grab(side) == "a"
    world.move_hand("empty", at(1, 1, 1))
    world.advance(0.1)
    before = world.objects["a"].pose
    hands = dict(world.hands)
    world.carry("right", JUMP)
    assert np.allclose(world.hands["left"].position, jumped(hands["left"], JUMP).position)
    assert world.hands["empty"] is hands["empty"]
    wanted = jumped(before, JUMP).position
    assert np.allclose(world.drawn().objects[0].world_from_object.position, wanted, atol=1e-6)
    record = world.advance(1 / 90)[-1]
    assert not record.contacts and not record.hands
    assert np.linalg.norm(world.objects["a"].pose.position - wanted) < 0.01
