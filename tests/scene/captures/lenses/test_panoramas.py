"""Panoramas, whole and in part, of one eye and of two: against the tracer's own rays."""

import numpy as np
import pycolmap
import pytest
from PIL import Image

from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.lenses.panorama import FACES
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.undistort import pixels_of
from shapeshift.scene.pose import OPENCV_FROM_EYE, look_at
from shapeshift.training.photos import load_photos
from shapeshift.training.synthetic import balls
from shapeshift.training.synthetic.solids import unit
from tests.support.scene.captures import save_image, write_transforms

POSE = look_at(np.array([0.1, 0.7, 1.4]), np.array([0.3, 0.3, -1.0])).matrix()
APART = 0.064  # metres between the eyes: nerfstudio's


def panorama_of(eye: np.ndarray, turn: np.ndarray, width: int) -> np.ndarray:
    """(W/2, W, 3) uint8 of the balls, by nerfstudio's formula: the middle looks along -Z."""
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[: width // 2, :width])
    theta, phi = -np.pi * (2 * columns / width - 1), np.pi * rows / (width / 2)
    d = np.stack([-np.sin(theta) * np.sin(phi), np.cos(phi), -np.cos(theta) * np.sin(phi)], 1)
    color, _ = balls.radiance(balls.place(), "RGB")(np.broadcast_to(eye, d.shape), unit(d @ turn.T))
    return np.rint(255 * color.reshape(width // 2, width, 3)).astype(np.uint8)


def seen(origins: np.ndarray, directions: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) uint8 of the balls along rays (N, 3)."""
    color, _ = balls.radiance(balls.place(), "RGB")(origins, unit(directions))
    return np.rint(255 * color.reshape(*shape, 3)).astype(np.uint8)


def nerfstudio_rays(model: str, size: tuple[int, int], lens: dict) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (N, 3) in the camera's OpenGL axes, as its ray generator has them."""
    width, height = size
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:height, :width])
    turns = (columns - lens["cx"]) / lens["fl_x"]
    theta = -np.pi * (turns / 2 if model.startswith("VR180") else turns)
    phi = np.pi * (0.5 + (rows - lens["cy"]) / lens["fl_y"])
    d = np.stack([-np.sin(theta) * np.sin(phi), np.cos(phi), -np.cos(theta) * np.sin(phi)], 1)
    side = {"R": 1, "L": -1}.get(model[-1] if "_" in model else "", 0) * APART / 2
    x, z = np.array([1.0, 0, 0]), np.array([0, 0, -1.0])
    if model.startswith("VR180"):
        return np.broadcast_to(side * x, d.shape), d
    return side * (np.cos(theta)[:, None] * x + np.sin(theta)[:, None] * z), d


def capture_of(folder, model: str, size: tuple[int, int], said: dict, lens: dict) -> Capture:
    origins, directions = nerfstudio_rays(model.upper(), size, lens)
    origins = origins @ POSE[:3, :3].T + POSE[:3, 3]
    picture = seen(origins, directions @ POSE[:3, :3].T, size[::-1])
    Image.fromarray(picture).save(folder / "all.png")
    frames = [{"file_path": "all.png", "transform_matrix": POSE.tolist()}]
    write_transforms(folder, frames, camera_model=model, up=[0, 1, 0], **said)
    return read_capture(folder)


def faults(photo) -> tuple[float, float]:
    """What share of a photo's pixels that count is wrong, and their median error."""
    truth, _ = balls.photograph(photo.view, balls.radiance(balls.place(), "RGB"))
    rgb, _, gone = load_photo(photo)
    error = np.abs(rgb / 255 - truth)[~gone]
    return float((error.max(axis=1) > 0.15).mean()), float(np.median(error))


@pytest.mark.parametrize("model", ["VR180_L", "vr180_r"])
@pytest.mark.parametrize("said", [{}, {"fl_x": 140.0, "fl_y": 280.0, "cx": 140.0, "cy": 140.0}])
def test_an_eye_of_vr180(tmp_path, model, said):
    """Its straight photos are the tracer's from the eye's own place; from the middle between the
    eyes they are not."""
    lens = {"fl_x": 140.0, "fl_y": 280.0, "cx": 140.0, "cy": 140.0}
    capture = capture_of(tmp_path, model, (280, 280), said, lens)
    looks = {(p.lens.params[4], p.lens.params[5]) for p in capture.photos}
    assert looks == {(45, 0), (-45, 0), (0, 90), (0, -90)}, "nothing lies behind"
    side = APART / 2 if model.upper().endswith("R") else -APART / 2
    for photo in capture.photos:
        away = photo.view.world_from_eye.position - POSE[:3, 3]
        np.testing.assert_allclose(away, side * POSE[:3, 0], atol=1e-12)
        assert faults(photo)[0] < 0.06 and faults(photo)[1] < 0.01
    gone = [load_photo(photo).lost.mean() for photo in capture.photos]
    assert np.allclose(sorted(gone), (0, 0, 0.5, 0.5), atol=0.02), "half of above is behind"
    assert any("64 mm apart" in said for said in capture.doubts)


@pytest.mark.parametrize("side", ["L", "R"])
def test_an_eye_that_goes_round_with_its_panorama(tmp_path, side):
    """Strips stand where the eye does for their middles; the tracer's panorama has an eye of its
    own in each column."""
    lens = {"fl_x": 320.0, "fl_y": 320.0, "cx": 320.0, "cy": 160.0}
    capture = capture_of(tmp_path, f"OMNIDIRECTIONALSTEREO_{side}", (640, 320), {}, lens)
    assert len(capture.photos) == len({p.name for p in capture.photos}) == 12
    assert any("1.1 mm" in said for said in capture.doubts)
    sign = 1 if side == "R" else -1
    for photo in capture.photos:
        pose = photo.view.world_from_eye.matrix()
        away = pose[:3, 3] - POSE[:3, 3]
        np.testing.assert_allclose(away, sign * APART / 2 * pose[:3, 0], atol=1e-12)
        assert faults(photo)[0] < 0.06 and faults(photo)[1] < 0.01
    # Every ray of a strip, against the panorama's of the same direction: how far beside it is.
    photo = capture.photos[0]
    left, right, *_ = photo.view.tangents
    pose = photo.view.world_from_eye.matrix()[:3, :3]
    for tangent in np.linspace(left, right, 9):
        d = pose @ unit(np.array([[tangent, 0.0, -1.0]]))[0]
        beside = np.cross(d, POSE[:3, 1])  # to the right of what is looked at, level
        eye = POSE[:3, 3] + sign * APART / 2 * beside
        off = np.linalg.norm(np.cross(photo.view.world_from_eye.position - eye, d))
        assert off <= APART / 2 * (1 - np.cos(np.arctan(right))) + 1e-9  # half a pixel over 1.1 mm


def test_a_part_of_a_panorama(tmp_path):
    """200 by 100 degrees of one, its middle aside: what it does not show counts nowhere."""
    lens = {"fl_x": 360.0, "fl_y": 360.0, "cx": 150.0, "cy": 110.0}
    capture = capture_of(tmp_path, "EQUIRECTANGULAR", (400, 198), lens, lens)
    assert 3 <= len(capture.photos) <= 6
    for photo in capture.photos:
        assert load_photo(photo).lost.any()
        assert faults(photo)[0] < 0.08 and faults(photo)[1] < 0.01


@pytest.mark.parametrize("text", [False, True])
def test_colmaps_own_panorama(tmp_path, text):
    """Its sixteenth lens and one more, by pycolmap's model of it: the tracer's faces again."""
    Image.fromarray(panorama_of(POSE[:3, 3], POSE[:3, :3], 512)).save(tmp_path / "all.png")
    (tmp_path / "images").mkdir()
    (tmp_path / "all.png").rename(tmp_path / "images/all.png")
    model = tmp_path / "sparse/0"
    model.mkdir(parents=True)
    made = pycolmap.Reconstruction()
    camera = pycolmap.Camera(model="EQUIRECTANGULAR", width=512, height=256, params=(512, 256))
    camera.camera_id = 1
    made.add_camera_with_trivial_rig(camera)
    pose = np.diag([1.0, -1, -1, 1]) @ POSE @ OPENCV_FROM_EYE  # COLMAP's worlds have -Y up
    image = pycolmap.Image(name="all.png", camera_id=1, image_id=1)
    made.add_image_with_trivial_frame(image, pycolmap.Rigid3d(np.linalg.inv(pose)[:3]))
    made.add_point3D(np.zeros(3), pycolmap.Track(), np.array([255, 128, 0], np.uint8))
    (made.write_text if text else made.write_binary)(model)
    capture = read_capture(tmp_path)
    assert len(capture.photos) == 6
    for photo in capture.photos:
        assert faults(photo)[0] < 0.06 and faults(photo)[1] < 0.01
    at = np.random.default_rng(0).normal(size=(50, 3))
    face = capture.photos[0]
    camera_from_face = np.linalg.inv(POSE) @ face.view.world_from_eye.matrix()
    ahead = at[np.abs(at[:, 0]) + np.abs(at[:, 1]) < 1] * (1, 1, 0) + (0, 0, 1)  # OpenCV axes
    turned = ahead * (1, -1, -1) @ camera_from_face[:3, :3].T * (1, -1, -1)
    np.testing.assert_allclose(
        pixels_of(face.lens, ahead[:, :2]), camera.img_from_cam(turned), atol=1e-9
    )


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
