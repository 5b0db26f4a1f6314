"""Files as people have them: other spellings, numbers that lack, photos and depth of odd kinds."""

import json
import shutil
import unicodedata

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.capture_files import find_file
from shapeshift.scene.captures.depth_photo import load_depth
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from tests.support.scene.captures import CLOUD, simple, write_transforms


@pytest.mark.parametrize("there, named", [
    ("images/000.JPG", "images/000.jpg"), ("Images/000.png", "images/000.png"),
    ("images/000.PNG", "images\\000.png"), ("Bilder/STRASSE.png", "bilder/straße.png"),
    ("mein Ordner/写真 ☃.png", "mein Ordner/写真 ☃.png"),
    (unicodedata.normalize("NFD", "fotos/grün.png"), "fotos/grün.png"),
])  # fmt: skip
def test_names_that_only_look_alike(tmp_path, there, named):
    path = tmp_path / there
    path.parent.mkdir()
    path.write_bytes(b"")
    assert find_file(tmp_path, named).path == path
    (path.parent / "new.png").write_bytes(b"")  # what is listed once is no longer so
    assert find_file(tmp_path, named.replace(named.split("/")[-1], "NEW.png")).path.exists() or (
        "\\" in named
    )


def test_names_that_only_look_alike_stay_below_the_folder(tmp_path):
    (tmp_path / "capture").mkdir()
    (tmp_path / "A.png").write_bytes(b"")
    for name in ("../a.png", "..\\a.png", "./../a.png"):
        assert not find_file(tmp_path / "capture", name).path.is_file()
    assert not find_file(tmp_path / "gone", "a.png").path.is_file()


def test_lists_of_a_split_name_files_their_own_way(tmp_path):
    frames, more = simple(tmp_path)
    lists = {"train_filenames": ["./images/000.png", "images\\001.png", "images//002.png"],
             "test_filenames": ["images/./003.png"]}  # fmt: skip
    write_transforms(tmp_path, frames, **more, **lists)
    assert [p.split for p in read_capture(tmp_path).photos] == ["train"] * 3 + ["test"]


def test_photos_that_cannot_be_read_say_what_they_are(tmp_path):
    frames, more = simple(tmp_path)
    write_transforms(tmp_path, frames, **more)
    (tmp_path / "images/001.png").write_bytes(b"")
    with pytest.raises(BadFile, match=r"001.png: the image file is empty; copy it again"):
        read_capture(tmp_path)
    (tmp_path / "images/001.png").rename(tmp_path / "images/001.HEIC")
    (tmp_path / "images/001.HEIC").write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic")
    frames[1]["file_path"] = "images/001.HEIC"
    write_transforms(tmp_path, frames, **more)
    with pytest.raises(BadFile, match=r"HEIC photos are not read; save them as JPEG or PNG"):
        read_capture(tmp_path)


def test_poses_that_lie_elsewhere_are_pointed_at(tmp_path):
    (tmp_path / "scan").mkdir()
    frames, more = simple(tmp_path / "scan")
    write_transforms(tmp_path / "scan", frames, **more)
    with pytest.raises(BadFile, match=r"the poses lie below, name that: .*/scan\.?$"):
        read_capture(tmp_path)
    with pytest.raises(BadFile, match="the poses lie in the folder above"):
        read_capture(tmp_path / "scan/images")
    (tmp_path / "scan/transforms.json").rename(tmp_path / "scan/Transforms.json")
    with pytest.raises(BadFile, match=r"name that: .*Transforms.json"):
        read_capture(tmp_path / "scan")
    assert len(read_capture(tmp_path / "scan/Transforms.json").photos) == 4
    (tmp_path / "scan/Transforms.json").write_text("[" * 5)
    with pytest.raises(BadFile, match=r"launch\.py poses"):
        read_capture(tmp_path / "scan")


def depth_capture(folder, values: np.ndarray, ending: str, points=None, **more) -> None:
    frames, rest = simple(folder)
    for i, frame in enumerate(frames):
        path = folder / f"depths\\{i}{ending}".replace("\\", "/")
        path.parent.mkdir(exist_ok=True)
        if ending == ".npy":
            np.save(path, values)
        else:
            Image.fromarray(values).save(path)
        frame["depth_file_path"] = f"depths\\{i}{ending}"
    if points is not None:
        np.savez(folder / "points3d.npz", xyz=points)
    write_transforms(folder, frames, **rest, **more)


METRES = np.linspace(2.5, 3.5, 12 * 16, dtype=np.float32).reshape(12, 16)  # cameras are 3.2 m away


@pytest.mark.parametrize("ending", [".npy", ".tif"])
@pytest.mark.parametrize("points", [None, CLOUD])
@pytest.mark.parametrize("scale, said, unit", [
    (1, {}, 1), (1000, {}, 0.001), (1000, {"depth_unit_scale_factor": 0.001}, 0.001),
    (200, {"depth_unit_scale_factor": 0.005}, 0.005), (1, {"depth_unit": 0.01}, 1),
])  # fmt: skip
def test_depth_of_floats_is_in_metres_or_in_what_nerfstudio_takes(
    tmp_path, ending, points, scale, said, unit
):
    """Nothing in such a file says that it is in millimetres, but how far away its subject is."""
    depth_capture(tmp_path, METRES * np.float32(scale), ending, points, **said)
    capture = read_capture(tmp_path)
    guessed = scale == 1000 and not said
    assert any("millimetres" in doubt for doubt in capture.doubts) == guessed
    for photo in capture.photos:
        np.testing.assert_allclose(load_depth(photo), METRES * (scale * unit), rtol=1e-6)
    write_capture(capture)
    for photo in read_capture(tmp_path).photos:
        np.testing.assert_allclose(load_depth(photo), METRES * (scale * unit), rtol=1e-6)


def test_depth_of_integers_keeps_its_steps(tmp_path):
    steps = np.rint(1000 * METRES).astype(np.uint16)
    depth_capture(tmp_path, steps, ".png")
    for photo in read_capture(tmp_path).photos:
        np.testing.assert_allclose(load_depth(photo), steps / 1000, rtol=1e-6)
    shutil.rmtree(tmp_path / "depths")
    depth_capture(tmp_path, steps[..., None], ".npy", depth_unit_scale_factor=0.001)
    for photo in read_capture(tmp_path).photos:
        np.testing.assert_allclose(load_depth(photo), steps / 1000, rtol=1e-6)


@pytest.mark.parametrize("value", [0, -1, "x", 1e9])
def test_a_unit_that_is_none_is_refused(tmp_path, value):
    depth_capture(tmp_path, METRES, ".npy", depth_unit_scale_factor=value)
    with pytest.raises(BadFile, match=r"'depth_unit_scale_factor' is .*a length above 0"):
        read_capture(tmp_path)
    assert (
        "depth"
        in json.loads((tmp_path / "transforms.json").read_text())["frames"][0]["depth_file_path"]
    )
