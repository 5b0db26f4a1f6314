"""Metres of a capture: a stated unit is in poses, points and cameras alike, and who says them."""

import json

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.captures import colmap_model, simple, whole, write_transforms


def eyes(views) -> np.ndarray:
    return np.array([view.world_from_eye.position for view in views])


def test_a_unit_is_in_poses_points_and_cameras(tmp_path):
    frames, more = simple(tmp_path)
    xyz = np.arange(6, dtype=np.float32).reshape(2, 3)
    np.savez(tmp_path / "points.npz", xyz=xyz, rgb=np.zeros((2, 3), np.uint8))
    path = write_transforms(tmp_path, frames, points="points.npz", **more)
    plain, cameras = read_capture(tmp_path), read_camera_list(path, CameraReading())
    write_transforms(tmp_path, frames, points="points.npz", unit_m=0.07, **more)
    found, scaled = read_capture(tmp_path), read_camera_list(path, CameraReading())
    assert (plain.metres, found.metres) == ("", "its own word")
    assert plain.points is not None and found.points is not None
    before, after = (eyes([p.view for p in each.photos]) for each in (plain, found))
    np.testing.assert_allclose(after, 0.07 * before, atol=1e-12)
    np.testing.assert_allclose(found.points, 0.07 * plain.points, rtol=1e-6)
    np.testing.assert_allclose(eyes(scaled.views), 0.07 * eyes(cameras.views), atol=1e-12)


@pytest.mark.parametrize("unit", [0, -1, 1e7, "1", None, [1], True, 1e-10])
def test_a_unit_that_is_none_is_one_sentence(tmp_path, unit):
    frames, more = simple(tmp_path)
    write_transforms(tmp_path, frames, unit_m=unit, **more)
    with pytest.raises(BadFile, match=r"'unit_m'.*above 0"):
        read_capture(tmp_path)


def test_colmap_has_it_in_capture_json_and_poses_in_its_report(tmp_path):
    colmap_model(tmp_path, text=True)
    plain = read_capture(tmp_path)
    assert plain.metres == ""
    (tmp_path / "poses.json").write_text(json.dumps({"scale": "0.24 m in IMG_1.jpg"}))
    assert read_capture(tmp_path).metres == "0.24 m in IMG_1.jpg"
    (tmp_path / "poses.json").write_text(json.dumps({"scale": "arbitrary: say a length"}))
    assert read_capture(tmp_path).metres == ""
    (tmp_path / "capture.json").write_text(json.dumps({"unit_m": 2}))
    found = read_capture(tmp_path)
    assert found.metres == "its own word"
    np.testing.assert_allclose(
        eyes([p.view for p in found.photos]), 2 * eyes([p.view for p in plain.photos])
    )


def test_its_own_form_is_in_metres(tmp_path):
    frames, more = whole(tmp_path)
    write_transforms(tmp_path, frames, **more)
    assert read_capture(tmp_path).metres == "its own form"
