"""Photos on their side in a capture of upright ones: by pycolmap's cameras and Pillow."""

import json

import numpy as np
import pycolmap
import pytest
from PIL import Image, ImageOps

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.capture_photos import ORIENTATION, quarter_of, turned_lens
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture

UPRIGHT = (30, 40)
CENTRE = (14.0, 21.5)
LENSES = [
    ColmapCamera("SIMPLE_PINHOLE", UPRIGHT, (35.0, *CENTRE)),
    ColmapCamera("PINHOLE", UPRIGHT, (35.0, 37.0, *CENTRE)),
    ColmapCamera("RADIAL", UPRIGHT, (35.0, *CENTRE, 0.1, -0.05)),
    ColmapCamera("OPENCV", UPRIGHT, (35.0, 37.0, *CENTRE, 0.1, -0.05, 0.02, -0.03)),
    ColmapCamera("FULL_OPENCV", UPRIGHT, (35.0, 37.0, *CENTRE, 0.1, 0, 0.02, -0.03, 0, 0.1, 0, 0)),
    ColmapCamera("OPENCV_FISHEYE", UPRIGHT, (20.0, 21.0, *CENTRE, 0.03, -0.004, 0, 0)),
    ColmapCamera("FOV", UPRIGHT, (20.0, 21.0, *CENTRE, 0.8)),
]


def in_file(orientation: int) -> Image.Image:
    """A picture of 40x30 pixels that EXIF turns to 30x40."""
    image = Image.new("RGB", UPRIGHT[::-1])
    exif = image.getexif()
    exif[ORIENTATION] = orientation
    return image


def projected(lens: ColmapCamera, points: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of points in the camera's axes, by pycolmap."""
    camera = pycolmap.Camera(
        model=lens.model, width=lens.size[0], height=lens.size[1], params=lens.params
    )
    return camera.img_from_cam(points)


def turned_by_pillow(places: np.ndarray, orientation: int) -> np.ndarray:
    """Where pixel centres of the file lie in the upright photo, looked up in a turned picture."""
    width, height = UPRIGHT[::-1]
    numbers = Image.fromarray(np.arange(width * height, dtype=np.int32).reshape(height, width))
    numbers.getexif()[ORIENTATION] = orientation
    upright = np.asarray(ImageOps.exif_transpose(numbers))
    wanted = (places[:, 1].astype(int) * width + places[:, 0].astype(int)).tolist()
    return np.array([np.argwhere(upright == one)[0][::-1] + 0.5 for one in wanted])


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.model)
@pytest.mark.parametrize("orientation", [6, 8])
def test_a_point_is_seen_in_the_same_pixel(lens, orientation):
    turn = quarter_of(in_file(orientation), lens)
    lying = turned_lens(lens, turn)
    assert lying.size == UPRIGHT[::-1] and np.linalg.det(turn) == pytest.approx(1)
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-0.35, 0.35, (200, 2)), np.ones(200)])
    seen = projected(lens, points)
    lies = projected(lying, points @ turn)  # file from upright is the transpose
    # The corners of the file by Pillow: an affine map, found at three pixels.
    corners = np.array([[0.5, 0.5], [39.5, 0.5], [0.5, 29.5]])
    known = np.column_stack([corners, np.ones(3)])
    affine = np.linalg.solve(known, turned_by_pillow(corners, orientation))
    np.testing.assert_allclose(np.column_stack([lies, np.ones(200)]) @ affine, seen, atol=1e-9)


@pytest.mark.parametrize("orientation", [1, 2, 3, 4, 5, 7])
def test_other_turns_are_left_alone(orientation):
    assert quarter_of(in_file(orientation), LENSES[0]) is None


def test_lenses_whose_bend_cannot_be_turned_are_left_alone():
    lens = ColmapCamera("THIN_PRISM_FISHEYE", UPRIGHT, (35.0, 35.0, *CENTRE, *np.zeros(8)))
    assert quarter_of(in_file(6), lens) is None


def phone(folder, stated: tuple[int, int], orientation: int = 6):
    """A capture of one phone photo, 40x30 in its file, whose left upper pixel is red."""
    image = in_file(orientation)
    image.putpixel((0, 0), (255, 0, 0))
    image.save(folder / "a.png", exif=image.getexif())
    frame = {"file_path": "a.png", "transform_matrix": np.eye(4).tolist()}
    lens = {"w": stated[0], "h": stated[1], "fl_x": 35.0, "fl_y": 37.0, "cx": 14.0, "cy": 21.5}
    (folder / "transforms.json").write_text(json.dumps({"frames": [frame], **lens}))
    return folder


def test_a_phone_capture_of_upright_photos_is_read(tmp_path):
    """Its red pixel is in the upright photo's right upper corner, and lies there in the world."""
    capture = read_capture(phone(tmp_path, UPRIGHT))
    (photo,) = capture.photos
    assert any("1 photos lie on their side in the file" in text for text in capture.doubts)
    assert photo.view.size == (40, 30)
    assert load_photo(photo)[0][0, 0].tolist()[:3] == [255, 0, 0]
    left, right, down, up = photo.view.tangents
    eye = np.array([left + (right - left) * 0.5 / 40, up - (up - down) * 0.5 / 30, -1])
    ray = photo.view.world_from_eye.matrix()[:3, :3] @ eye
    np.testing.assert_allclose(ray, [(29.5 - 14) / 35, (21.5 - 0.5) / 37, -1], atol=1e-6)


def test_the_capture_of_the_file_itself_stays_as_it_is(tmp_path):
    capture = read_capture(phone(tmp_path, UPRIGHT[::-1]))
    assert capture.photos[0].view.world_from_eye.matrix()[:3, :3] == pytest.approx(np.eye(3))
    assert not any("side" in text for text in capture.doubts)


@pytest.mark.parametrize("orientation", [1, 3, 5])
def test_without_a_quarter_turn_the_sizes_are_refused(tmp_path, orientation):
    with pytest.raises(BadFile, match="has 40x30 pixels, the capture says 30x40"):
        read_capture(phone(tmp_path, UPRIGHT, orientation))
