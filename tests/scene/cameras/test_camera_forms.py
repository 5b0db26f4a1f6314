"""Every form of camera file: read what was written, conventions, what files leave out."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.operations.rotate_splats import ours_from_file
from shapeshift.runtime_models.splats.plain_splats import AXES
from shapeshift.scene.cameras.camera_list import CameraList, CameraReading, moved
from shapeshift.scene.cameras.read_cameras import find_cameras, find_floor, read_camera_list
from shapeshift.scene.cameras.write_cameras import FORMS, paths_of, write_cameras
from shapeshift.scene.pose import View, look_at, perspective
from tests.support.scene.camera_files import HALF, NAMES, assert_same, cameras, target, views


@pytest.mark.parametrize("form", [form for form in FORMS if form not in ("nerfstudio", "vr")])
def test_what_was_written_is_read(tmp_path, form):
    wanted, path = cameras(), target(tmp_path, form)
    assert write_cameras(wanted, path, form) == paths_of(path, form)
    got = read_camera_list(path)
    assert_same(got.views, wanted.views)
    assert got.names == NAMES and not got.notes
    write_cameras(got, path, form)
    assert_same(read_camera_list(path).views, wanted.views)


def test_a_camera_path_is_read_as_it_was_written(tmp_path):
    wanted, path = cameras(plain=True), target(tmp_path, "nerfstudio")
    write_cameras(replace(wanted, fps=30.0), path, "nerfstudio")
    got = read_camera_list(path)
    assert_same(got.views, wanted.views)
    assert got.fps == 30 and not got.notes


@pytest.mark.parametrize("form", FORMS)
def test_no_camera_is_refused(tmp_path, form):
    with pytest.raises(BadFile, match="no camera"):
        write_cameras(CameraList((), (), "none"), target(tmp_path, form), form)
    assert not list(tmp_path.iterdir())


def test_what_a_camera_path_cannot_say_is_refused(tmp_path):
    plain = views(1, plain=True)[0]
    left, right, low, high = plain.tangents
    for odd, words in (
        (plain.resized((320, 360)), "pixels"),
        (replace(plain, tangents=(left, right / 2, low, high)), "middle"),
        (replace(plain, tangents=(2 * left, 2 * right, low, high)), "not square"),
    ):
        listed = CameraList((plain, odd), ("", ""), "test")
        with pytest.raises(BadFile, match=words):
            write_cameras(listed, tmp_path / "path.json", "nerfstudio")
    assert not list(tmp_path.iterdir())


# Axes


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("form", ["inria", "transforms", "nerfstudio", "colmap-bin", "vr"])
def test_up_and_flip_turn_cameras_as_they_turn_splats(tmp_path, form, up, flip):
    """A point of the file lands on the same pixel, however both are turned."""
    path = target(tmp_path, form)
    write_cameras(cameras(plain=True), path, form)
    point = np.array([0.3, -0.7, 0.4])  # the file's world
    before, after = ours_from_file("-Y"), ours_from_file(up, flip)
    usual = read_camera_list(path).views[0]
    turned = read_camera_list(path, CameraReading(up=up, flip=flip)).views[0]
    one = usual.eye_from_world() @ np.r_[before @ point, 1]
    other = turned.eye_from_world() @ np.r_[after @ point, 1]
    if form == "vr":  # the eye is above the floor in its own up: the same, too
        assert one[:3] @ one[:3] == pytest.approx(other[:3] @ other[:3])
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_a_transforms_file_without_a_word_on_up_stands_upright(tmp_path):
    """As its capture does: the axis that the cameras agree on is up, --up says another."""
    rows = []
    for turn in range(4):
        eye = np.array([math.sin(turn), math.cos(turn), 0.5])
        pose = look_at(3 * eye, (0, 0, 0.3), up=(0, 0, 1))  # a world with +Z up
        rows.append({"file_path": f"{turn}.png", "transform_matrix": pose.matrix().tolist()})
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({"camera_angle_x": 1.0, "frames": rows}))
    found = read_camera_list(path)
    assert all(view.world_from_eye.matrix()[1, 1] > 0.5 for view in found.views)
    assert found.views[0].size == (800, 800) and "names no size" in found.notes[0]
    same = read_camera_list(path, CameraReading(up="+Z"))
    assert_same(found.views, same.views, atol=1e-9)
    flipped = read_camera_list(path, CameraReading(flip=True))
    assert all(view.world_from_eye.matrix()[1, 1] < -0.5 for view in flipped.views)


def test_moved_is_added(tmp_path):
    first, *_ = views()
    (there,) = moved([first], (1.0, 2.0, 3.0))
    np.testing.assert_allclose(
        there.world_from_eye.position - first.world_from_eye.position, (1, 2, 3)
    )
    assert moved([first], (0, 0, 0)) == [first]


# What a file leaves out


def test_lenses_are_straightened_with_a_note_and_photos_need_not_be_there(tmp_path):
    frame = {"file_path": "gone.jpg", "transform_matrix": np.eye(4).tolist()}
    lens = {"w": 100, "h": 60, "fl_x": 50.0, "cx": 40.0, "cy": 33.0, "k1": 0.3}
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(lens | {"frames": [frame, frame]}))
    found = read_camera_list(path)
    assert len(found.views) == 1  # equal ones once
    np.testing.assert_allclose(found.views[0].tangents, (-0.8, 1.2, -0.54, 0.66))
    assert len(found.notes) == 1 and "distortion" in found.notes[0]
    assert found.names == ("gone.jpg",)


def test_poses_alone_get_a_field_of_view(data):
    """The Leg's own file: it was trained at 70 degrees, which its capture tells."""
    path = data / "anatomy_leg_ml3dgs/cameras.json"
    guessed = read_camera_list(path)
    assert len(guessed.views) == 512 and "--fov-y" in guessed.notes[0]
    told = read_camera_list(path, CameraReading((400, 400), math.radians(70)))
    assert not told.notes
    known = read_camera_list(data / "anatomy_leg_3modal_views").views
    numbers = json.loads((data / "anatomy_leg_3modal_views/transforms_multimodal.json").read_text())
    first = numbers["frames"][0]["source_camera"]
    assert_same([told.views[first]], known[:1])


def test_positions_and_rotations_alone_get_one_too(tmp_path):
    row = {"position": [0, 0, 0], "rotation": np.eye(3).tolist()}
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps([row, row]))
    guessed, told = (read_camera_list(path, CameraReading(fov_y=f)) for f in (0.0, 1.0))
    assert "--fov-y" in guessed.notes[0] and not told.notes
    np.testing.assert_allclose(told.views[1].tangents, perspective(1.0, (640, 360)))


@pytest.mark.parametrize("form", FORMS)
def test_a_size_replaces_the_files(tmp_path, form):
    path = target(tmp_path, form)
    write_cameras(cameras(plain=True), path, form)
    got = read_camera_list(path, CameraReading(size=(64, 36)))
    assert {view.size for view in got.views} == {(64, 36)}


PATHS = {
    '{"camera_path": [{}]}': "not 4 x 4",
    '{"camera_path": [3]}': "camera 0 is 3; one object",
    '{"camera_path": "x"}': "list of objects",
    '{"keyframes": []}': "holds no camera",
    '{"keyframes": null}': "list of objects",
    '{"keyframes": [{"matrix": "[1, 2"}]}': "not JSON",
    '{"keyframes": [{"matrix": "[1, 2]"}]}': "not 4 x 4",
    '{"keyframes": [{"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1], "fov": 180}]}': "'fov' is 180",
    '{"keyframes": [{"matrix": [1,0,0,0, 0,1,0,0, 0,0,2,0, 0,0,0,1], "fov": 60}]}': "no rotation",
    '{"keyframes": [{"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,NaN, 0,0,0,1], "fov": 60}]}': "NaN",
    '{"keyframes": [{}], "camera_type": "equirectangular"}': "equirectangular",
    '{"keyframes": [{}], "render_width": 0}': "render_width",
    '{"keyframes": [{}], "render_height": 1e9}': "render_height",
    '{"floorMat": 3}': "not 4 x 4",
    '{"floorMat": [[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]}': "no rotation, scale",
    '{"floorMat": [[1,0,0,0],[0,NaN,0,0],[0,0,1,0],[0,0,0,1]]}': "no rotation, scale",
    '{"floorMat": [[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]}': "no rotation, scale",
    '{"c2w": {}}': "list of 4x4",
    '{"c2w": [[1]]}': "not 4 x 4",
    '{"frames": [{"file_path": "a"}]}': "no pose",
    '{"frames": [{"file_path": "a", "transform_matrix": [[1]]}]}': "not 4 x 4",
    '{"frames": 3}': "no list 'frames'",
    '{"splats": 3}': "holds no cameras",
    "3": "holds no cameras",
    "null": "holds no cameras",
}  # fmt: skip


@pytest.mark.parametrize("text", PATHS)
def test_broken_json_is_one_sentence(tmp_path, text):
    path = tmp_path / "cameras.json"
    path.write_text(text)
    with pytest.raises(BadFile, match=PATHS[text]) as refused:
        read_camera_list(path)
    assert "\n" not in str(refused.value)


# The floor


def test_a_floor_is_stood_on(tmp_path):
    level = look_at((1.0, 1.6, 2.0), (3.0, 1.6, -1.0))
    for pose in (level, look_at((1.0, 1.6, 2.0), (3.0, 0.2, -1.0))):  # or looking down
        view = View(pose, perspective(0.8, (640, 360)), 0.05, 1000.0, (640, 360))
        path = tmp_path / "room_vr.json"
        write_cameras(CameraList((view,), ("",), "test"), path, "vr")
        (got,) = read_camera_list(path).views
        np.testing.assert_allclose(got.world_from_eye.matrix(), level.matrix(), atol=1e-9)
    floor = np.array(json.loads(path.read_text())["floorMat"])
    np.testing.assert_allclose((HALF @ floor)[:3, 3], (1, 0, 2), atol=1e-9)  # under the eye
    np.testing.assert_allclose((HALF @ floor)[:3, 1], (0, 1, 0), atol=1e-12)
    up = View(look_at((0, 0, 0), (0, 1, 0), (0, 0, 1)), (-1, 1, -1, 1), 0.1, 9, (8, 8))
    with pytest.raises(BadFile, match="straight up or down"):
        write_cameras(CameraList((up,), ("",), "test"), tmp_path / "no_vr.json", "vr")


def test_six_digits_and_a_scale_as_splatapult_writes_them(tmp_path):
    path = tmp_path / "test_vr.json"
    rows = [
        [-0.705639, -0.312374, -0.636, -0.573335], [-1.64858e-05, 0.897588, -0.440836, -1.78893],
        [0.708571, -0.311061, -0.633378, -0.512137], [0, 0, 0, 1],
    ]  # fmt: skip
    path.write_text(json.dumps({"floorMat": rows}))
    (one,) = read_camera_list(path).views
    floor = HALF @ np.array(rows)
    np.testing.assert_allclose(
        one.world_from_eye.position, floor[:3, 3] + 1.6 * floor[:3, 1], atol=1e-5
    )
    scaled = np.array(rows)
    scaled[:3, :3] *= 2.5
    path.write_text(json.dumps({"floorMat": scaled.tolist()}))
    (two,) = read_camera_list(path).views
    np.testing.assert_allclose(two.world_from_eye.wxyz, one.world_from_eye.wxyz, atol=1e-6)
    np.testing.assert_allclose(
        two.world_from_eye.position, floor[:3, 3] + 2.5 * 1.6 * floor[:3, 1], atol=1e-5
    )


def test_cameras_are_found_beside_a_scene(tmp_path):
    run = tmp_path / "run"
    scene = run / "point_cloud/iteration_30000/point_cloud.ply"
    scene.parent.mkdir(parents=True)
    scene.write_bytes(b"")
    assert find_cameras(scene) is None and find_floor(scene) is None
    write_cameras(cameras(), run / "cameras.json", "inria")
    assert find_cameras(scene) == run / "cameras.json"
    assert find_cameras(run) == run
    write_cameras(cameras(), scene.parent, "colmap-txt")
    assert find_cameras(scene) == scene.parent
    write_cameras(cameras(), scene.parent / "point_cloud_vr.json", "vr")
    assert find_floor(scene) == scene.parent / "point_cloud_vr.json"
