"""Paths through keyframes: nerfstudio's files old and new, the spline, the arcs between turns."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from shapeshift.scene.cameras.camera_path import along, slerp
from shapeshift.scene.cameras.read_cameras import read_camera_list
from tests.support.scene.camera_files import HALF, views


def key(matrix, **more) -> dict:
    return {"matrix": matrix, "fov": 60.0, "aspect": 16 / 9} | more


def path_file(tmp_path, **content) -> Path:
    path = tmp_path / "camera_path.json"
    path.write_text(json.dumps({"render_width": 64, "render_height": 36} | content))
    return path


def test_old_files_have_texts_of_columns(tmp_path):
    """https://github.com/nerfstudio-project/nerfstudio/issues/3117"""
    pose = views(1)[0].world_from_eye.matrix()
    rows = pose.ravel().tolist()
    columns = pose.T.ravel().tolist()
    for matrix in (rows, pose.tolist(), columns, json.dumps(columns), json.dumps(rows)):
        got = read_camera_list(path_file(tmp_path, keyframes=[key(matrix)]))
        np.testing.assert_allclose(got.views[0].world_from_eye.matrix(), HALF @ pose, atol=1e-9)
    turn = pose.copy()
    turn[:3, 3] = 0  # now only the text tells that it is columns
    got = read_camera_list(
        path_file(tmp_path, keyframes=[key(json.dumps(turn.T.ravel().tolist()))])
    )
    np.testing.assert_allclose(got.views[0].world_from_eye.matrix(), HALF @ turn, atol=1e-9)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_keyframes_become_a_smooth_path_through_them(tmp_path, count, closed):
    given = [view.world_from_eye.matrix() for view in views(count, seed=count)]
    seconds, fps = 2.0, 30.0
    path = path_file(
        tmp_path, keyframes=[key(m.ravel().tolist()) for m in given], camera_path=[],
        fps=fps, seconds=seconds, is_cycle=closed,
    )  # fmt: skip
    got = read_camera_list(path)
    assert len(got.views) == 60 and got.fps == 30 and "keyframes alone" in got.notes[0]
    poses = [view.world_from_eye.matrix() for view in got.views]
    for pose in poses:
        np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-6)
    np.testing.assert_allclose(poses[0], HALF @ given[0], atol=1e-9)
    if not closed or count == 1:
        np.testing.assert_allclose(poses[-1], HALF @ given[-1], atol=1e-9)
    assert all(view.tangents[3] == pytest.approx(math.tan(math.radians(30))) for view in got.views)


def test_the_spline_passes_its_keys_and_has_no_kinks():
    keys = np.random.default_rng(1).normal(size=(6, 3))
    for closed in (False, True):
        last = 6 if closed else 5
        np.testing.assert_allclose(
            along(keys, np.arange(last + (not closed), dtype=float), closed)[:6], keys, atol=1e-12
        )
        t = np.linspace(0, last - 1e-6, 5001)
        speed = np.diff(along(keys, t, closed), axis=0) / (t[1] - t[0])
        assert np.abs(np.diff(speed, axis=0)).max() < 0.02 * np.abs(speed).max()


def test_slerp_is_even_and_takes_the_shorter_way():
    one = np.array([[1.0, 0, 0, 0]])
    half = np.array([[math.cos(0.6), 0, math.sin(0.6), 0]])
    for other in (half, -half):
        for part in (0.0, 0.25, 0.5, 1.0):
            (q,) = slerp(one, other, np.array([part]))
            np.testing.assert_allclose(
                q, [math.cos(0.6 * part), 0, math.sin(0.6 * part), 0], atol=1e-12
            )
    np.testing.assert_allclose(slerp(one, one, np.array([0.3])), one)


def test_a_very_long_path_is_bounded(tmp_path):
    given = views(1)[0].world_from_eye.matrix().ravel().tolist()
    got = read_camera_list(path_file(tmp_path, keyframes=[key(given)] * 3, seconds=1e12, fps=1e3))
    assert len(got.views) <= 100_000
