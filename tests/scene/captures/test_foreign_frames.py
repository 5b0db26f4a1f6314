"""Files of nerfstudio, instant-ngp and Aria as others write them: names, lenses, axes."""

import shutil

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.cameras.read_cameras import read_transforms_cameras
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.undistort import pixels_of
from shapeshift.training.first_anchors.initial import cloud_points
from tests.support.scene.captures import CLOUD, simple, write_transforms


@pytest.mark.parametrize(
    "name",
    ["images\\{}.png", "C:\\Users\\me\\scan\\images\\{}.png", "/home/me/scan/images/{}.png",
     "../../scan/images/{}.png", "./images/{}.png", "images/{}", "/data/{}"],
)  # fmt: skip
def test_photos_are_found_however_their_names_are_written(tmp_path, name):
    frames, more = simple(tmp_path)
    for i, frame in enumerate(frames):
        frame["file_path"] = name.format(f"{i:03}")
    if name == "/data/{}":  # without a folder that is here: beside the file itself
        for photo in (tmp_path / "images").iterdir():
            shutil.move(photo, tmp_path / photo.name)
    write_transforms(tmp_path, frames, **more)
    capture = read_capture(tmp_path)
    assert [p.path.stem for p in capture.photos] == ["000", "001", "002", "003"]
    moved = [said for said in capture.doubts if "not where the capture says" in said]
    assert len(moved) == (name[0] in "C/" or name.startswith("..")), "what was guessed is said"


def test_photos_of_a_smaller_folder_stand_for_those_that_are_not_there(tmp_path):
    frames, more = simple(tmp_path, w=32, h=24, fl_x=40.0)
    (tmp_path / "images").rename(tmp_path / "images_2")
    write_transforms(tmp_path, frames, **more)
    capture = read_capture(tmp_path)
    assert {p.path.parent.name for p in capture.photos} == {"images_2"}
    assert all(np.isclose(p.view.pinhole()[1], 20) for p in capture.photos)
    assert any("scaled with them" in said for said in capture.doubts)


def test_a_name_that_goes_up_never_leads_to_a_photo_of_another_name(tmp_path):
    frames, more = simple(tmp_path)
    frames[1]["file_path"] = "../images/elsewhere.png"
    frames[2]["file_path"] = "other/000.png"  # no tail of a name within the folder is taken
    write_transforms(tmp_path, frames, **more)
    capture = read_capture(tmp_path)
    assert [p.path.name for p in capture.photos] == ["000.png", "003.png"]
    assert "2 of 4 photos" in capture.doubts[0]


def test_every_way_to_say_a_field_of_view(tmp_path):
    frames, _ = simple(tmp_path, 3)
    wide, high = 2 * np.arctan(8 / 20), 2 * np.arctan(6 / 21)
    said = [
        {"fl_x": 20.0, "fl_y": 21.0, "camera_angle_y": 0.1},
        {"camera_angle_x": wide, "camera_angle_y": high},
        {"x_fov": np.degrees(wide), "y_fov": np.degrees(high)},
    ]
    write_transforms(tmp_path, [f | s for f, s in zip(frames, said, strict=True)])
    for photo in read_capture(tmp_path).photos:
        assert np.allclose(photo.view.pinhole()[1:3], (20, 21), rtol=1e-12)


def test_a_list_of_distortion_is_that_of_its_numbers(tmp_path):
    frames, more = simple(tmp_path, 2)
    numbers = dict(zip(("k1", "k2", "k3", "k4", "p1", "p2"),
                       (-0.3, 0.1, 0.02, 0.0, 0.01, -0.02), strict=True))  # fmt: skip
    lenses = []
    for said in (numbers, {"distortion_params": list(numbers.values())}):
        write_transforms(tmp_path, frames, **more, **said)
        lenses.append(read_capture(tmp_path).photos[0].lens)
    assert lenses[0] is not None
    assert lenses[0] == lenses[1]


def aria_pixels(p: list[float], focal: tuple, centre: tuple, tangents: np.ndarray) -> np.ndarray:
    """Fisheye624 as Project Aria documents it: radial in the angle, tangential, thin prism."""
    r = np.hypot(*tangents.T)
    angle = np.arctan(r)
    powers = angle[:, None] ** (2 * np.arange(1, 7))
    u, v = (tangents * (angle * (1 + powers @ p[:6]) / r)[:, None]).T
    r2 = u**2 + v**2
    (p0, p1), (s0, s1, s2, s3) = p[6:8], p[8:]
    x = u + 2 * u * (u * p0 + v * p1) + r2 * p0 + s0 * r2 + s1 * r2**2
    y = v + 2 * v * (u * p0 + v * p1) + r2 * p1 + s2 * r2 + s3 * r2**2
    return np.stack([x, y], 1) * focal + centre


def test_lenses_of_aria_are_read(tmp_path):
    frames, more = simple(tmp_path, 2)
    p = [0.02, -0.03, 0.01, -0.002, 0.001, 0.0, 0.002, -0.001, 0.001, 0.0002, -0.001, 0.0001]
    write_transforms(tmp_path, frames, **more, camera_model="FISHEYE624", distortion_params=p)
    lens = read_capture(tmp_path).photos[0].lens
    at = np.random.default_rng(0).uniform(-0.8, 0.8, (50, 2))
    assert np.allclose(pixels_of(lens, at), aria_pixels(p, (20, 20), (8, 6), at), atol=1e-9)


def test_the_frames_of_scannetpp_that_are_held_out(tmp_path):
    frames, more = simple(tmp_path)
    write_transforms(tmp_path, frames[:3], test_frames=frames[3:], **more)
    assert [p.split for p in read_capture(tmp_path).photos] == ["train"] * 3 + ["test"]


def test_a_scale_of_the_matrix_moves_nothing(tmp_path):
    frames, more = simple(tmp_path)
    write_transforms(tmp_path, frames, **more)
    before = read_capture(tmp_path)
    for frame in frames:
        matrix = np.array(frame["transform_matrix"])
        matrix[:3, :3] *= 0.01
        frame["transform_matrix"] = matrix.tolist()
    write_transforms(tmp_path, frames, **more)
    for one, other in zip(before.photos, read_capture(tmp_path).photos, strict=True):
        assert np.allclose(one.view.eye_from_world(), other.view.eye_from_world(), atol=1e-12)


def test_frames_of_different_times_are_said_to_be_one_still_scene(tmp_path):
    frames, more = simple(tmp_path)
    write_transforms(tmp_path, [f | {"time": i / 4} for i, f in enumerate(frames)], **more)
    assert any("one still scene" in said for said in read_capture(tmp_path).doubts)


LEFT = np.diag([-1.0, 1.0, 1.0])


def test_a_left_handed_world_is_turned_round(tmp_path):
    """The same photos, with poses and points as a left-handed program writes them: up to a turn
    of the whole, cameras and points are those of the right-handed one, not its mirror image."""
    frames, more = simple(tmp_path)
    np.savez(tmp_path / "points3d.npz", xyz=CLOUD)
    write_transforms(tmp_path, frames, **more, up=[0.1, 0.2, 1.0])
    before = read_capture(tmp_path)
    (tmp_path / "left").mkdir()
    shutil.copytree(tmp_path / "images", tmp_path / "left/images")
    for frame in frames:
        matrix = np.array(frame["transform_matrix"])
        matrix[:3] = LEFT @ matrix[:3]
        frame["transform_matrix"] = matrix.tolist()
    np.savez(tmp_path / "left/points3d.npz", xyz=CLOUD @ LEFT)
    write_transforms(tmp_path / "left", frames, **more, up=[-0.1, 0.2, 1.0])
    after = read_capture(tmp_path / "left")
    # Its word for up is 12.6 degrees off the photos', which both say; one is left-handed besides.
    (leaning,) = before.doubts
    assert "12.6 degrees from up by the photos" in leaning
    assert ["left-handed" in doubt for doubt in after.doubts] == [True, False]
    np.testing.assert_allclose(after.points, before.points, atol=1e-6)
    for one, other in zip(before.photos, after.photos, strict=True):
        assert np.allclose(one.view.eye_from_world(), other.view.eye_from_world(), atol=1e-9)
    rng = np.random.default_rng(0)
    cloud, _ = cloud_points(tmp_path / "left/points3d.npz", after, rng)
    np.testing.assert_allclose(cloud, before.points, atol=1e-6)
    cameras = read_transforms_cameras([tmp_path / "left/transforms.json"], CameraReading())
    for view, photo in zip(cameras.views, before.photos, strict=True):
        assert np.allclose(view.eye_from_world(), photo.view.eye_from_world(), atol=1e-9)
    with pytest.raises(BadFile, match="mirrors"):
        read_transforms_cameras([tmp_path / "left/transforms.json"], CameraReading(up="+Z"))
