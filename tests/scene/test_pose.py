"""Many poses at once are the matrices of each."""

import numpy as np
import pytest

from shapeshift.scene.pose import Pose, pose_matrices


@pytest.mark.parametrize("count", [0, 1, 2, 65])
def test_matrices_of_many_poses_are_those_of_each_to_the_bit(count):
    rng = np.random.default_rng(count)
    wxyz = rng.normal(size=(count, 4))
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    poses = [Pose(rng.normal(scale=1e6, size=3), q) for q in wxyz]
    found = pose_matrices(poses)
    assert found.shape == (count, 4, 4) and found.dtype == np.float64
    for pose, matrix in zip(poses, found, strict=True):
        np.testing.assert_array_equal(matrix, pose.matrix())
        np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)


def test_a_number_that_is_none_stays_with_its_pose():
    poses = [Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), Pose(np.full(3, np.nan), np.ones(4) / 2)]
    found = pose_matrices(poses)
    np.testing.assert_array_equal(found[0], np.eye(4))
    assert np.isnan(found[1, :3, 3]).all() and np.isfinite(found[1, :3, :3]).all()
