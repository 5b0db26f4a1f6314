"""COLMAP folders, text and binary, against COLMAP itself."""

import json

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.captures import (
    CLOUD,
    colmap_model,
    projected,
    save_image,
)


@pytest.mark.parametrize("text", [True, False])
def test_colmap_projects_as_colmap_itself(tmp_path, text):
    model = colmap_model(tmp_path, text)
    capture = read_capture(tmp_path)
    assert [(s.name, s.x, s.kind, s.palette) for s in capture.stops] == [
        ("rgb", 0.0, "rgb", ""),
        ("thermal", 1.0, "thermal", "ironbow"),
    ]
    assert [p.view.size for p in capture.photos] == [(16, 12)] * 4 + [(10, 8)] * 3
    assert capture.points.dtype == np.float32
    # Half a turn about x, as for splats of COLMAP-style worlds.
    points = CLOUD * (1, -1, -1)
    np.testing.assert_allclose(np.sort(capture.points, 0), np.sort(points, 0), atol=1e-6)
    np.testing.assert_allclose(capture.point_colors, [[1, 128 / 255, 0]] * 20, atol=1e-6)
    images = {i.name: i for i in model.images.values()}
    for photo in capture.photos:
        image = images[photo.path.relative_to(tmp_path / "images").as_posix()]
        theirs = np.array([image.project_point(p) for p in CLOUD])
        np.testing.assert_allclose(projected(photo.view, points), theirs, atol=1e-9)
        assert photo.view.world_from_eye.matrix()[1, 1] > 0.5  # upright


def test_colmap_text_and_binary_are_one(tmp_path):
    captures = []
    for text in (True, False):
        colmap_model(tmp_path / str(text), text)
        captures.append(read_capture(tmp_path / str(text)))
    for a, b in zip(captures[0].photos, captures[1].photos, strict=True):
        assert a.view.tangents == b.view.tangents
        np.testing.assert_allclose(
            a.view.world_from_eye.matrix(), b.view.world_from_eye.matrix(), atol=1e-12
        )


def test_capture_json_names_the_modalities_of_a_colmap_folder(tmp_path):
    colmap_model(tmp_path, False)
    stops = [
        {"name": "Heat", "x": 0.5, "kind": "thermal", "folder": "thermal", "unit": "°C",
         "value_range": [10, 60], "palette": "turbo"},
        {"name": "Colour", "x": 0.0, "folder": "rgb"},
    ]  # fmt: skip
    (tmp_path / "capture.json").write_text(
        json.dumps({"modalities": stops, "background": [1, 1, 1], "up": [0, 0, 1]})
    )
    capture = read_capture(tmp_path)
    assert capture.stops == (
        Stop("Colour", 0.0, "rgb"),
        Stop("Heat", 0.5, "thermal", "turbo", (10.0, 60.0), "°C"),
    )
    assert capture.background == (1.0, 1.0, 1.0)
    up_z = CLOUD[:, [0, 2, 1]] * (1, 1, -1)
    np.testing.assert_allclose(np.sort(capture.points, 0), np.sort(up_z, 0), atol=1e-6)
    stops[0]["folder"] = "lidar"
    (tmp_path / "capture.json").write_text(json.dumps({"modalities": stops}))
    with pytest.raises(BadFile, match='"Heat" has no images'):
        read_capture(tmp_path)


def test_colmap_masks_are_found(tmp_path):
    colmap_model(tmp_path, False)
    first = save_image(tmp_path / "masks/rgb/0.png.png", mode="L")
    second = save_image(tmp_path / "masks/rgb/1.png", mode="L")
    masks = {p.path.name: p.mask for p in read_capture(tmp_path).of("rgb", "train")}
    assert (masks["1.png"], masks["2.png"]) == (second, None)
    assert read_capture(tmp_path).of("rgb", "test")[0].mask == first


def test_a_nearly_straight_lens_is_taken_as_it_is_and_a_bent_one_is_undistorted(tmp_path):
    colmap_model(tmp_path / "ok", False, "SIMPLE_RADIAL", (20.0, 8.0, 6.0, 0.01))
    straight = read_capture(tmp_path / "ok")
    assert [photo.lens for photo in straight.photos] == [None] * 7 and straight.doubts == ()
    colmap_model(tmp_path / "bent", False, "SIMPLE_RADIAL", (20.0, 8.0, 6.0, 0.3))
    bent = read_capture(tmp_path / "bent")
    assert {p.lens.model for p in bent.photos if p.modality == "rgb"} == {"SIMPLE_RADIAL"}
    assert {photo.lens for photo in bent.photos if photo.modality == "thermal"} == {None}
    assert bent.doubts == ("4 photos are undistorted as they are read (SIMPLE_RADIAL).",)


@pytest.mark.parametrize("keep", [0, 7, 60, 300])
def test_a_cut_off_colmap_model_is_refused(tmp_path, keep):
    colmap_model(tmp_path, False)
    file = tmp_path / "sparse/0/images.bin"
    file.write_bytes(file.read_bytes()[:keep])
    with pytest.raises(BadFile):
        read_capture(tmp_path)


def test_colmap_lacks_a_table_or_an_image(tmp_path):
    colmap_model(tmp_path, False)
    (tmp_path / "images/rgb/2.png").unlink()
    capture = read_capture(tmp_path)
    assert (len(capture.photos), len(capture.doubts)) == (6, 1)
    assert capture.doubts[0].startswith("1 of 7 photos that the capture names are not there")
    assert "rgb/2.png" in capture.doubts[0]
    (tmp_path / "sparse/0/cameras.bin").unlink()
    with pytest.raises(BadFile, match=r"cameras\.bin is missing"):
        read_capture(tmp_path)


def test_a_model_without_points_and_with_smaller_photos_is_read(tmp_path):
    colmap_model(tmp_path, False)
    (tmp_path / "sparse/0/points3D.bin").unlink()
    (tmp_path / "images").rename(tmp_path / "images_4")
    capture = read_capture(tmp_path)
    assert capture.points is None
    assert len(capture.photos) == 7
    assert any("points3D.bin are not there" in said for said in capture.doubts)


def test_the_folders_of_phototourism(tmp_path):
    colmap_model(tmp_path, False)
    before = read_capture(tmp_path)
    (tmp_path / "dense").mkdir()
    (tmp_path / "sparse/0").rename(tmp_path / "dense/sparse")
    (tmp_path / "images").rename(tmp_path / "dense/images")
    (tmp_path / "sparse").rmdir()
    after = read_capture(tmp_path)
    for one, other in zip(before.photos, after.photos, strict=True):
        assert np.array_equal(one.view.eye_from_world(), other.view.eye_from_world())
    assert np.array_equal(after.points, before.points)


def test_lists_of_photos_to_train_on_and_to_hold_out(tmp_path):
    colmap_model(tmp_path, False)
    names = [
        p.path.relative_to(tmp_path / "images").as_posix() for p in read_capture(tmp_path).photos
    ]
    (tmp_path / "train_list.txt").write_text("\n".join(names[1:3] + names[4:6]) + "\n")
    (tmp_path / "test_list.txt").write_text(f"{names[0]}\r\n{names[6]}")
    used = {p.path.relative_to(tmp_path / "images").as_posix(): p.split
            for p in read_capture(tmp_path).photos}  # fmt: skip
    assert used == dict.fromkeys(names[1:3] + names[4:6], "train") | dict.fromkeys(
        (names[0], names[6]), "test"
    ), "what is in no list is not used"
    (tmp_path / "train_list.txt").write_text("elsewhere.png")
    (tmp_path / "test_list.txt").unlink()
    with pytest.raises(BadFile, match="name none of its photos"):
        read_capture(tmp_path)
