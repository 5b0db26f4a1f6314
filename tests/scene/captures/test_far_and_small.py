"""Captures in survey coordinates, of kilometres and of millimetres, and from one place."""

import json

import numpy as np
import pytest

from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.cameras.read_cameras import read_transforms_cameras
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.pose import View
from shapeshift.training.first_anchors.initial import cloud_points
from shapeshift.training.first_anchors.views import common_box, distance_of
from tests.support.scene.captures import CLOUD, projected, simple, write_transforms

UTM = np.array([500_123.4, 5_600_456.7, 312.0])  # east, north, up


def moved(frames: list[dict], scale: float, by: np.ndarray) -> list[dict]:
    out = []
    for frame in frames:
        matrix = np.array(frame["transform_matrix"])
        matrix[:3, 3] = scale * matrix[:3, 3] + by
        out.append(frame | {"transform_matrix": matrix.tolist()})
    return out


def capture_at(folder, scale: float, by):
    frames, more = simple(folder)
    np.savez(folder / "points3d.npz", xyz=scale * CLOUD + by)
    write_transforms(folder, moved(frames, scale, np.asarray(by, float)), **more)
    return read_capture(folder)


def test_survey_coordinates_keep_every_tenth_of_a_millimetre(tmp_path):
    """Against the same capture about zero: each point falls on the same place of each photo."""
    (tmp_path / "near").mkdir()
    (tmp_path / "far").mkdir()
    near = capture_at(tmp_path / "near", 1.0, np.zeros(3))
    far = capture_at(tmp_path / "far", 1.0, UTM)
    assert near.origin == (0, 0, 0)
    assert far.origin == (500_000, 0, -5_600_000), "whole kilometres, with our +Y up"
    assert far.points.dtype == np.float32
    for one, other in zip(near.photos, far.photos, strict=True):
        a, b = (projected(p.view, np.float64(c.points)) for p, c in ((one, near), (other, far)))
        assert np.abs(a - b).max() < 0.01  # pixels; float32 about zero itself is 0.001 off
    assert any("far from zero" in said for said in far.doubts)
    assert not near.doubts


def test_clouds_and_cameras_of_the_same_world_come_along(tmp_path):
    capture = capture_at(tmp_path, 1.0, UTM)
    rng = np.random.default_rng(0)
    points, _ = cloud_points(tmp_path / "points3d.npz", capture, rng)
    assert np.allclose(points, capture.points, atol=1e-3)
    # Cameras for viewing stay in the file's world: a scene moves them by its own origin.
    cameras = read_transforms_cameras([tmp_path / "transforms.json"], CameraReading())
    for view, photo in zip(cameras.views, capture.photos, strict=True):
        away = np.asarray(view.world_from_eye.position) - photo.view.world_from_eye.position
        assert np.allclose(away, capture.origin, atol=1e-6)


def test_two_captures_of_a_site_have_the_same_zero(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    first, again = (capture_at(tmp_path / n, 1.0, UTM + d) for n, d in (("a", 0), ("b", 40.0)))
    assert first.origin == again.origin


@pytest.mark.parametrize("scale", [1e-4, 1e-3, 0.01, 1.0, 1000.0])
def test_a_capture_of_any_unit_looks_alike(tmp_path, scale):
    """Near planes, and the place that is looked at, go with the unit."""
    (tmp_path / "metres").mkdir()
    (tmp_path / "unit").mkdir()
    metres = [p.view for p in capture_at(tmp_path / "metres", 1.0, np.zeros(3)).photos]
    views = [p.view for p in capture_at(tmp_path / "unit", scale, np.zeros(3)).photos]
    assert np.isclose(distance_of(views), scale * distance_of(metres), rtol=1e-2)
    assert views[0].near <= 0.26 * distance_of(views)
    assert views[0].near == 0.05 or scale < 0.1
    assert np.isclose(common_box(views)[1], scale * common_box(metres)[1], rtol=1e-2)


def test_cameras_in_one_place_see_a_metre_far(tmp_path):
    frames, more = simple(tmp_path)
    for frame in frames:
        matrix = np.array(frame["transform_matrix"])
        matrix[:3, 3] = 1e5, 7.0, 3.0  # rounding must not tell them apart
        frame["transform_matrix"] = matrix.tolist()
    write_transforms(tmp_path, frames, **more)
    views: list[View] = [photo.view for photo in read_capture(tmp_path).photos]
    assert views[0].near == 0.05
    assert distance_of(views) == 1.0
    assert np.isfinite(common_box(views)[0]).all()


def test_the_note_is_of_plain_numbers(tmp_path):
    assert json.dumps(capture_at(tmp_path, 1.0, UTM).notes["origin"])
