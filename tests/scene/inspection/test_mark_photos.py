"""Photos of marks: small, upright, in the file itself, and refused where they are none."""

import base64
import json

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.mark_photos import LONGEST_PX, photo_pixels, shrunk_photo
from shapeshift.scene.inspection.marks import Mark
from shapeshift.scene.inspection.marks_file import MarksFile, read_marks_file, write_marks_file


def write_photo(path, size=(1600, 1000), turned: int = 0) -> None:
    """Red in its left half, blue in its right one."""
    pixels = np.zeros((size[1], size[0], 3), np.uint8)
    pixels[:, : size[0] // 2, 0] = pixels[:, size[0] // 2 :, 2] = 200
    exif = Image.Exif()
    exif[0x0112] = turned or 1
    Image.fromarray(pixels).save(path, exif=exif)


@pytest.mark.parametrize("name", ["a.jpg", "a.png"])
def test_a_photo_is_made_small_and_comes_back_from_the_file(tmp_path, name):
    write_photo(tmp_path / name)
    photo = shrunk_photo(tmp_path / name)
    beside = tmp_path / "a.marks.json"
    write_marks_file(MarksFile((Mark("Sp1", "spot", np.zeros((1, 3)), photo=photo),)), beside)
    (mark,) = read_marks_file(beside).marks
    assert mark.photo == photo
    pixels = photo_pixels(mark.photo)
    assert pixels.shape == (400, LONGEST_PX, 3)
    np.testing.assert_allclose(pixels[200, 100], (200 / 255, 0, 0), atol=0.03)
    np.testing.assert_allclose(pixels[200, 540], (0, 0, 200 / 255), atol=0.03)


def test_a_camera_held_on_its_side_gives_an_upright_photo(tmp_path):
    write_photo(tmp_path / "a.jpg", turned=6)  # the camera's right was up
    pixels = photo_pixels(shrunk_photo(tmp_path / "a.jpg"))
    assert pixels.shape == (LONGEST_PX, 400, 3)
    assert pixels[100, 200, 0] > 0.7 and pixels[540, 200, 2] > 0.7


def test_a_tiny_photo_stays_as_it_is(tmp_path):
    write_photo(tmp_path / "a.png", (2, 1))
    assert photo_pixels(shrunk_photo(tmp_path / "a.png")).shape == (1, 2, 3)


def test_what_is_no_photo_is_one_sentence(tmp_path):
    (tmp_path / "a.jpg").write_bytes(b"words")
    for name in ("a.jpg", "missing.png"):
        with pytest.raises(BadFile) as refused:
            shrunk_photo(tmp_path / name)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "photo", [7, "", "no base64!", base64.b64encode(b"\x89PNG\r\n").decode(), "A" * 500_000]
)
def test_a_wrong_photo_in_the_file_is_refused(tmp_path, photo):
    row = {"name": "Sp1", "kind": "spot", "points": [[0, 0, 0]], "photo": photo}
    path = tmp_path / "a.marks.json"
    path.write_text(json.dumps({"shapeshift_marks": 1, "marks": [row]}))
    with pytest.raises(BadFile, match="'photo'"):
        read_marks_file(path)


def test_a_broken_or_huge_photo_in_the_file_is_not_shown(tmp_path):
    assert photo_pixels(b"\xff\xd8\xff" + bytes(100)) is None
    Image.new("RGB", (LONGEST_PX + 1, 2)).save(tmp_path / "a.jpg")
    assert photo_pixels((tmp_path / "a.jpg").read_bytes()) is None
