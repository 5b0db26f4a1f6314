"""Things with round bases stand: the engine alone lets a prism of six corners fall over."""

import math

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.scene.world.physics import Physics
from shapeshift.scene.world.physics_shapes import MOST_CORNERS, SLOPE, with_firm_faces
from tests.support.scene.physics_things import at, box, run

pytest.importorskip("rapier3d", reason="the physics engine is not installed")

HALF = 0.04  # metres, of a prism's height


def prism(corners: int, seed: int | None = None) -> np.ndarray:
    """(V, 3) float32: upright, a regular base of 37 mm; with a seed an irregular one."""
    turn = 2 * np.pi * np.arange(corners) / corners
    far = 0.037 * np.ones(2 * corners)
    if seed is not None:
        far *= np.random.default_rng(seed).uniform(0.8, 1.1, 2 * corners)
    turn, height = np.tile(turn, 2), np.repeat([-HALF, HALF], corners)
    return np.stack([far * np.cos(turn), height, far * np.sin(turn)], 1).astype(np.float32)


def moved_and_turned(physics: Physics, body: int, seconds: float) -> tuple[float, float]:
    """Millimetres and degrees."""
    first = physics.pose(body)
    run(physics, seconds)
    now = physics.pose(body)
    turn = 2 * math.acos(min(abs(float(first.wxyz @ now.wxyz)), 1.0))
    return 1e3 * float(np.linalg.norm(now.position - first.position)), math.degrees(turn)


@pytest.mark.parametrize("corners", [3, 4, 5, 6, 8, 11, 32])
def test_a_prism_stands_where_it_was_put(corners):
    physics = Physics(floor_y=0.0)
    body = physics.add_body([prism(corners)], at(0, HALF + 3e-4, 0), 0.3)
    moved, turned = moved_and_turned(physics, body, 2.0)
    # It falls the 0.3 mm that it was put above the floor; 0.1 mm is the engine's allowed depth.
    assert moved <= 0.4
    assert turned <= 0.05
    assert physics.sleeps(body)


@pytest.mark.parametrize("seed", range(6))
def test_an_irregular_base_stands_too(seed):
    physics = Physics(floor_y=0.0)
    body = physics.add_body([prism(11, seed)], at(0, HALF + 3e-4, 0), 0.3)
    moved, turned = moved_and_turned(physics, body, 2.0)
    assert moved <= 0.4
    assert turned <= 0.5  # the four corners are those of one plane


def test_a_prism_stands_on_a_round_table_of_hulls():
    physics = Physics()
    top = prism(24) * np.float32(10)  # the middle of its first four corners lies 0.3 m away
    physics.add_static([top], at(0, -10 * HALF, 0))
    body = physics.add_body([prism(12)], at(0, HALF + 3e-4, 0), 0.3)
    moved, turned = moved_and_turned(physics, body, 2.0)
    assert moved <= 0.4
    assert turned <= 0.05


def test_a_box_stays_as_it_is():
    corners = np.asarray(box(0.1, 0.2, 0.3), np.float32)
    assert np.array_equal(np.unique(with_firm_faces(corners), axis=0), np.unique(corners, axis=0))


@pytest.mark.parametrize("corners", [5, 6, 12, 24])
def test_four_corners_of_a_face_are_left_and_the_others_hardly_move(corners):
    before = prism(corners)
    after = with_firm_faces(before)
    assert len(after) == len(before)
    # The sagitta beyond a chord that spans a right angle is 0.3 of the radius; of a pentagon .7.
    assert np.abs(after - before).max() <= 0.7 * 0.037 * SLOPE
    for side in (-HALF, HALF):
        on = np.abs(after[:, 1] - np.float32(side)) < 1e-7
        assert on.sum() == MOST_CORNERS
        four = after[on][:, [0, 2]]
        centred = four - four.mean(0)
        assert np.linalg.svd(centred)[1].min() > 0.02  # they spread both ways


def test_a_pose_turned_over_stands_on_its_other_face():
    physics = Physics(floor_y=0.0)
    upside_down = Pose(np.array([0.0, HALF + 3e-4, 0.0]), np.array([0.0, 1.0, 0.0, 0.0]))
    body = physics.add_body([prism(9)], upside_down, 0.3)
    assert moved_and_turned(physics, body, 2.0)[1] <= 0.05
