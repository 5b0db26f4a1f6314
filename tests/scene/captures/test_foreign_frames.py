"""Files of nerfstudio, instant-ngp and Aria as others write them: names, lenses, panoramas."""

import shutil

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.captures.lenses.panorama import FACES
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.undistort import pixels_of
from shapeshift.scene.pose import look_at
from shapeshift.training.photos import load_photos
from shapeshift.training.synthetic import balls
from shapeshift.training.synthetic.solids import unit
from tests.support.scene.captures import save_image, simple, write_transforms


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


def panorama_of(eye: np.ndarray, turn: np.ndarray, width: int) -> np.ndarray:
    """(W/2, W, 3) uint8 of the balls, by nerfstudio's formula: the middle looks along -Z."""
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[: width // 2, :width])
    theta, phi = -np.pi * (2 * columns / width - 1), np.pi * rows / (width / 2)
    d = np.stack([-np.sin(theta) * np.sin(phi), np.cos(phi), -np.cos(theta) * np.sin(phi)], 1)
    color, _ = balls.radiance(balls.place(), "RGB")(np.broadcast_to(eye, d.shape), unit(d @ turn.T))
    return np.rint(255 * color.reshape(width // 2, width, 3)).astype(np.uint8)


def test_faces_of_a_panorama_are_what_pinholes_see_there(tmp_path):
    """Against the tracer's own photos from the same eye, in all six directions."""
    pose = look_at(np.array([0.1, 0.7, 1.4]), np.array([0.3, 0.3, -1.0]))
    matrix = pose.matrix()
    Image.fromarray(panorama_of(matrix[:3, 3], matrix[:3, :3], 512)).save(tmp_path / "all.png")
    frames = [{"file_path": "all.png", "transform_matrix": matrix.tolist()}]
    write_transforms(tmp_path, frames, camera_model="EQUIRECTANGULAR", up=[0, 1, 0])
    capture = read_capture(tmp_path)
    assert len(capture.photos) == len({p.name for p in capture.photos}) == len(FACES)
    assert any("1 panoramas are read as 6" in said for said in capture.doubts)
    looks = {tuple(np.rint(p.view.world_from_eye.matrix()[:3, 2] * 1e3)) for p in capture.photos}
    assert len(looks) == 6
    for photo in capture.photos:
        truth, _ = balls.photograph(photo.view, balls.radiance(balls.place(), "RGB"))
        drawn = load_photo(photo).rgb / 255
        error = np.abs(drawn - truth)
        # Edges of checks fall between the samples of two pictures; a face that is turned or
        # mirrored, or a seam, is wrong over a tenth of its pixels and more.
        assert (error.max(axis=2) > 0.15).mean() < 0.06
        assert np.median(error) < 0.01


def test_panoramas_are_held_out_as_a_whole_and_have_a_target_each(tmp_path):
    frames = []
    for i in range(9):
        save_image(tmp_path / f"{i}.png", (64, 32), seed=i)
        pose = look_at(np.array([np.cos(i), 0.5, np.sin(i)]), np.zeros(3)).matrix()
        frames.append({"file_path": f"{i}.png", "transform_matrix": pose.tolist()})
    write_transforms(tmp_path, frames, camera_model="EQUIRECTANGULAR")
    capture = read_capture(tmp_path)
    assert {p.path.stem for p in capture.photos if p.split == "test"} == {"0", "8"}
    loaded = load_photos(capture, "train", 1, "object")
    assert len({photo.name for photo in loaded}) == len(loaded) == 7 * 6
    assert all(photo.weight is None for photo in loaded), "a cube's faces know every pixel"
