"""Up and metres of a world out of structure from motion: against worlds turned on purpose."""

import numpy as np
import pytest

from shapeshift.decomposition.poses.find_poses import COLMAP_UP, length_between, similarity
from shapeshift.scene.cameras.upright import up_of_photos
from tests.support.scene.textured_room import camera


def turned(poses: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The poses in a world turned at random, and what +Y is there."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    out = poses.copy()
    out[:, :3] = turn @ poses[:, :3]
    return out, turn[:, 1]


def degrees(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(np.dot(a, b), -1, 1))))


@pytest.mark.parametrize("seed", range(5))
def test_level_cameras_on_one_side_give_up_exactly(seed):
    """They look down from one side only, so the mean of their up vectors leans by 15 degrees."""
    poses, up = turned(np.array([camera(i, 8) for i in range(8)]), seed)
    found = up_of_photos(poses, [1] * 8)
    assert found.sure and degrees(found.direction, up) < 1e-4
    mean = -poses[:, :3, 1].mean(axis=0)
    assert degrees(mean / np.linalg.norm(mean), up) > 10


@pytest.mark.parametrize("orientation,quarters", [(1, 0), (6, 1), (3, 2), (8, 3)])
def test_photos_held_upright_and_stored_lying_count_as_held(orientation, quarters):
    """EXIF 6: the file must be turned by 90 degrees clockwise to be looked at."""
    poses = np.array([camera(i, 8) for i in range(8)])
    # The file's axes are those of the held picture, turned anticlockwise: its right is held up.
    quarter = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])
    stored = poses.copy()
    stored[:, :3, :3] = poses[:, :3, :3] @ np.linalg.matrix_power(quarter, quarters).T
    found = up_of_photos(stored, [orientation] * 8)
    assert degrees(found.direction, np.array([0, 1.0, 0])) < 1e-4


def test_photos_that_all_look_the_same_way_give_their_mean():
    """Their horizontal axes are one: no plane is through them."""
    pose = camera(0, 8)
    found = up_of_photos(np.array([pose] * 5), [1] * 5)
    assert degrees(found.direction, -pose[:3, 1]) < 1e-6
    assert not found.sure


def test_photos_that_disagree_say_nothing():
    upside_down = camera(0, 2) @ np.diag([-1.0, -1, 1, 1])
    assert up_of_photos(np.array([camera(0, 2), upside_down]), [1, 1]) is None


@pytest.mark.parametrize("up", [(0, 1, 0), (0, -1, 0), (1, 0, 0), (0.6, 0, -0.8), (0, 1, 1e-9)])
def test_the_similarity_brings_up_to_minus_y_and_the_centre_to_zero(up):
    up = np.array(up) / np.linalg.norm(up)
    centre = np.array([3.0, -2, 7])
    matrix = similarity(up, 2.5, centre)
    turn = matrix[:, :3] / 2.5
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-8)
    assert np.linalg.det(turn) > 0
    np.testing.assert_allclose(turn @ up, COLMAP_UP, atol=1e-8)
    np.testing.assert_allclose(matrix @ [*centre, 1], 0, atol=1e-12)


def test_a_length_is_that_between_what_two_pixels_show():
    """Points on a wall 2 m away, seen by a camera of 100 px focal length."""
    at = np.stack(np.meshgrid(np.arange(0, 200, 10.0), np.arange(0, 200, 10.0)), 2).reshape(-1, 2)
    ends = np.array([[50.0, 100], [150, 100]])
    rays = np.hstack([(ends - 100) / 100, np.ones((2, 1))])
    found = length_between(ends, at, np.full(len(at), 2.0), rays, 200)
    assert found == pytest.approx(2.0, rel=1e-12)  # 100 px of 100 px at 2 m
    assert np.isnan(length_between(ends, at[:2], np.full(2, 2.0), rays, 200))
    far = at[at[:, 0] > 120]  # nothing is known near the first pixel
    assert np.isnan(length_between(ends, far, np.full(len(far), 2.0), rays, 200))
