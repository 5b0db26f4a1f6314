"""The picture darkens where the head goes into what stands, and for nothing else."""

import numpy as np
import pytest

from shapeshift.app.headset.xr_user import XrUser
from shapeshift.vr.locomotion import Rules
from shapeshift.vr.outline import BEGINS_M, MOST, WAYS, WHOLE_M, Sight, look, nearest_wall
from shapeshift.vr.play_space import PlaySpace
from tests.support.scene.world_scenes import item, real
from tests.support.vr.vr_frames import at, frame

pytest.importorskip("rapier3d", reason="the physics engine is not installed")
HALF_M = 0.05  # of the box that stands, see world_scenes
BOX = np.array([0.0, 1.5, 0.0])


def test_ways_are_all_around():
    assert WAYS.shape == (14, 3)
    np.testing.assert_allclose(np.linalg.norm(WAYS, axis=1), 1)
    np.testing.assert_allclose(WAYS.sum(axis=0), 0, atol=1e-12)


def standing(static: bool = True):
    return real(item(position=(0.0, 1.5, 0.0), static=static))


def beside(away_m: float) -> np.ndarray:
    """(3,) metres of the world: so far from a face of the box."""
    return np.add(BOX, (HALF_M + away_m, 0.0, 0.0))


@pytest.mark.parametrize("scale", [1.0, 0.25, 4.0])
def test_it_is_darker_the_nearer_it_is_at_any_size_of_the_world(scale):
    world, sight = standing(), Sight()
    seen = []
    for away_m in (*np.linspace(0.2, 0.0, 21), -0.01):  # of the room
        sight = look(sight, world, beside(away_m * scale), scale)
        seen.append(sight.dark)
    away = np.linspace(0.2, 0.0, 21)
    want = MOST * np.clip((BEGINS_M - away) / (BEGINS_M - WHOLE_M), 0, 1)
    np.testing.assert_allclose(seen[:-1], want, atol=1e-3)
    assert seen[-1] == MOST  # inside of it


def test_who_is_put_into_it_sees_until_they_have_been_outside():
    world = standing()
    inside, outside = BOX, beside(0.15)
    sight = look(Sight(), world, inside, 1.0)
    assert sight.dark == 0 and not sight.free
    sight = look(sight, world, np.add(inside, (0.01, 0, 0)), 1.0)  # steps within
    assert sight.dark == 0
    sight = look(look(sight, world, outside, 1.0), world, beside(WHOLE_M), 1.0)
    assert sight.dark == pytest.approx(MOST, abs=1e-3)
    assert look(sight, world, inside, 1.0).dark == MOST
    assert look(sight, world, inside, 0.9).dark == 0  # by another size of the world
    far = look(look(Sight(), world, beside(2.0), 1.0), world, inside, 1.0)  # jumps
    assert far.dark == 0


def test_what_moves_the_floor_and_no_place_at_all_are_no_obstacles():
    assert nearest_wall(standing(static=False), beside(0.01), 1.0) == np.inf
    assert nearest_wall(standing(), np.array([5.0, 0.01, 5.0]), 1.0) == np.inf  # the floor
    assert nearest_wall(standing(), np.array([np.nan, 0, 0]), 1.0) == np.inf
    assert nearest_wall(standing(), beside(0.1), 1.0) == pytest.approx(0.1, abs=1e-4)


@pytest.mark.parametrize("obstacles", [True, False])
def test_a_person_sees_it_darken_unless_they_chose_not_to(obstacles):
    person = XrUser(standing(), at(0, 1.5, 2), 0.0, Rules(obstacles=obstacles))
    for away_m in (0.4, 0.2, 0.04):
        person.act(frame(head=at(*beside(away_m))), PlaySpace(), 1 / 90)
    assert (person.comfort.blink > 0.5) == obstacles
