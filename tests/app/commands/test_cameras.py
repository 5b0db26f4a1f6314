"""Camera files: every form is read to the same view, and every way to break one is a sentence."""

import json

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraList, first_of_each
from shapeshift.scene.cameras.read_cameras import read_cameras
from shapeshift.scene.cameras.write_cameras import write_cameras
from shapeshift.scene.pose import OPENCV_FROM_EYE, look_at, perspective

UPRIGHT = np.eye(4).tolist()


def written(folder, rows):
    path = folder / "cameras.json"
    path.write_text(rows if isinstance(rows, str) else json.dumps(rows))
    return path


def test_our_own_form(tmp_path):
    pose = look_at((1.0, 2.0, 3.0), (0.0, 0.5, 0.0))
    rows = [
        {"matrix": pose.matrix().tolist(), "fov_y": 0.7},
        {"matrix": pose.matrix().ravel().tolist(), "tangents": [-0.5, 0.25, -0.125, 1]},
        {"matrix": UPRIGHT, "fov_y": 1, "near": 0.5, "far": 9},
    ]
    first, second, third = read_cameras(written(tmp_path, rows), (64, 48))
    for view in (first, second):
        np.testing.assert_allclose(view.world_from_eye.matrix(), pose.matrix(), atol=1e-12)
    assert first.tangents == perspective(0.7, (64, 48)) and first.size == (64, 48)
    assert second.tangents == (-0.5, 0.25, -0.125, 1.0)
    assert (third.near, third.far) == (0.5, 9)
    assert read_cameras(written(tmp_path, rows))[0].size == (640, 360)


def test_our_own_form_tells_of_which_picture_a_view_is_a_part(tmp_path):
    row = {"matrix": UPRIGHT, "tangents": [0, 0.25, 0, 0.1]}
    rows = [row | {"whole": [-0.5, 0.5, -0.3, 0.3]}, row]
    part, other = read_cameras(written(tmp_path, rows), (64, 48))
    assert part.whole == (-0.5, 0.5, -0.3, 0.3) and other.whole is None
    assert first_of_each([part, other, part]) == [0, 1]
    listed = CameraList((part, other), ("", ""), "test")
    write_cameras(listed, tmp_path / "again.json", "ours")
    again = read_cameras(tmp_path / "again.json")
    assert [view.whole for view in again] == [part.whole, None]
    for broken in ([1, -1, -1, 1], [0, 1, 2], "all", [0, 1, 0, float("inf")]):
        with pytest.raises(BadFile, match=r"'whole' is .*(left < right, down < up|list of 4)"):
            read_cameras(written(tmp_path, json.dumps([row | {"whole": broken}])))


def test_3dgs_own_list_is_turned_as_its_splats_are(tmp_path):
    """A camera at the file's (1, 2, 3) that looks along the file's +z, image rows along +y."""
    row = {
        "id": 0, "img_name": "a.jpg", "width": 100, "height": 50, "position": [1, 2, 3],
        "rotation": np.eye(3).tolist(), "fx": 80, "fy": 90,
    }  # fmt: skip
    (view,) = read_cameras(written(tmp_path, [row]))
    world_from_eye = view.world_from_eye.matrix()
    np.testing.assert_allclose(world_from_eye[:3, 3], (1, -2, -3))
    np.testing.assert_allclose(world_from_eye[:3, :3], np.eye(3))  # -z forward, +y up: ours
    np.testing.assert_allclose(view.tangents, (-50 / 80, 50 / 80, -25 / 90, 25 / 90))
    assert view.size == (100, 50)
    smaller = read_cameras(written(tmp_path, [row]), (10, 5))[0]
    assert smaller.size == (10, 5) and smaller.tangents == view.tangents


def test_a_turned_3dgs_camera(tmp_path):
    """The same point lands on the same pixel, whichever side projects it."""
    pose = look_at((2.0, 1.0, 3.0), (0.0, 0.0, 0.0)).matrix()
    ours_from_file = np.diag([1.0, -1.0, -1.0, 1.0])
    file_from_camera = ours_from_file @ pose @ OPENCV_FROM_EYE
    row = {
        "width": 200, "height": 100, "position": file_from_camera[:3, 3].tolist(),
        "rotation": file_from_camera[:3, :3].tolist(), "fx": 150.0, "fy": 140.0,
    }  # fmt: skip
    (view,) = read_cameras(written(tmp_path, [row]))
    point = np.array([0.3, -0.2, 0.4, 1.0])  # in the file's world
    x, y, z, _ = np.linalg.inv(file_from_camera) @ point
    want = (150 * x / z + 100, 140 * y / z + 50)
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    x, y, z, _ = camera_from_world @ ours_from_file @ point
    np.testing.assert_allclose((fx * x / z + cx, fy * y / z + cy), want, atol=1e-9)


def test_views_that_modalities_share_are_drawn_once(data):
    folder = data / "anatomy_leg_3modal_views"
    views = read_cameras(folder, (64, 64))
    frames = json.loads((folder / "transforms_multimodal.json").read_text())["frames"]
    assert len(views) == len(frames)
    assert len({tuple(v.world_from_eye.position) for v in views}) == len(views)
    assert read_cameras(folder / "transforms_multimodal.json")[0].size != (64, 64)


def test_twins_are_equal_in_everything(tmp_path):
    (a, b) = read_cameras(written(tmp_path, [{"matrix": UPRIGHT, "fov_y": f} for f in (1, 2)]))
    assert first_of_each([a, b, a, a.resized((3, 3))]) == [0, 1, 3]


def test_real_photo_captures_give_their_cameras(data):
    views = read_cameras(data / "plush_snowmiku")
    told = json.loads((data / "plush_snowmiku/cameras.json").read_text())
    assert len(views) == len(told["frames"])
    assert views[0].size == (told["w"], told["h"])
    assert views[0].tangents[1] == pytest.approx((told["w"] - told["cx"]) / told["fl_x"])


HUGE = "1" + "0" * 400
ROW = '"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]'
GS = '"position": [0,0,0], "rotation": [1,0,0, 0,1,0, 0,0,1]'
BROKEN = {
    "": "is empty: it has 0 bytes",
    "[" * 100_000: "is not JSON",
    "{}": "holds no cameras",
    "[[]]": "camera 0 is []; one object",
    '[{"fov_y": 1}]': "expected an object with 'matrix'",
    f"[{{{ROW}, 'fov_y': 1}}]": "is not JSON",
    f'[{{{ROW}, "fov_y": 1}}, {{{ROW}, "fov_y": 0}}]': "camera 1: 'fov_y' is 0",
    f'[{{{ROW}, "fov_y": NaN}}]': "'fov_y' is NaN",
    f'[{{{ROW}, "fov_y": 1e999}}]': "'fov_y' is Infinity",
    f'[{{{ROW}, "fov_y": {HUGE}}}]': "'fov_y' is a number beyond measure",
    f'[{{{ROW}, "fov_y": true}}]': "'fov_y' is true",
    f'[{{{ROW}, "fov_y": 3.15}}]': "between 0 and pi",
    f'[{{{ROW}, "fov_y": 1, "near": 0}}]': "near 0 and far",
    f'[{{{ROW}, "fov_y": 1, "far": "x"}}]': "'far' is \"x\"",
    f'[{{{ROW}, "tangents": [-1, 1, 1, -1]}}]': "left < right, down < up",
    f'[{{{ROW}, "tangents": [-1, 1, -1, NaN]}}]': "'tangents' is [-1, 1, -1, NaN]",
    f'[{{"matrix": [{HUGE}], "fov_y": 1}}]': "not 4 x 4 numbers",
    '[{"matrix": {"a": 1}, "fov_y": 1}]': "not 4 x 4 numbers",
    '[{"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,1,1], "fov_y": 1}]': "no rotation and position",
    '[{"matrix": [1,0,0,0, 0,1,0,0, 0,0.5,1,0, 0,0,0,1], "fov_y": 1}]': "no rotation",
    f'[{{{GS}, "fx": 3}}]': "'width' is missing",
    f'[{{{GS}, "width": 4, "height": 4, "fx": 0, "fy": 1}}]': "above 0",
    f'[{{{GS.replace("1]", "2]")}, "width": 4, "height": 4, "fx": 1, "fy": 1}}]': "no rotation",
    f'[{{{GS.replace("1]", "-1]")}, "width": 4, "height": 4, "fx": 1, "fy": 1}}]': "mirrors",
}  # fmt: skip


@pytest.mark.parametrize("text", BROKEN, ids=lambda text: text[:60])
def test_a_broken_file_is_one_sentence(tmp_path, text):
    with pytest.raises(BadFile) as refused:
        read_cameras(written(tmp_path, text), (8, 8))
    assert BROKEN[text] in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_is_no_file_of_cameras(tmp_path):
    for path, words in ((tmp_path / "no.json", "does not exist"), (tmp_path, "holds no cameras")):
        with pytest.raises(BadFile, match=words):
            read_cameras(path)
    for data, words in (
        (b"\x89PNG\r\n\x1a\n\xff", "is not JSON"),  # no zero byte: broken text
        (b"PK\x03\x04\x14\0\0", "holds no cameras; wanted is a list of cameras"),
    ):
        (tmp_path / "a.png").write_bytes(data)
        with pytest.raises(BadFile, match=words):
            read_cameras(tmp_path / "a.png")
