"""capture.json: which photos an entry of 'modalities' takes, by folder, photos and camera."""

import json
import time

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.modalities.said_modalities import folder_depth, names_photo
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.strangers.modality import heat, light, thermal_gaussian
from tests.support.scene.strangers.situations import Shot, write_colmap, write_frames, write_photos

RGB, HEAT = {"name": "Light", "x": 0}, {"name": "Heat", "x": 1, "kind": "thermal"}


def found(folder, first: dict, second: dict) -> tuple[int, ...]:
    """Photos of light, and of heat."""
    text = json.dumps({"modalities": [RGB | first, HEAT | second]})
    (folder / "capture.json").write_text(text)
    capture = read_capture(folder)
    return tuple(
        len({p.path for p in capture.photos if p.modality == n}) for n in ("Light", "Heat")
    )


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """Two visible cameras, one of heat, in images/; written as a model from Windows."""
    shots = light("rgb_left\\{}.png") + light("rgb_right\\{}.png", 3) + heat("flir\\{}.png", 2)
    return write_colmap(tmp_path_factory.mktemp("rig") / "in", shots)


@pytest.mark.parametrize("first,second", [
    ({"folder": ["rgb_left", "rgb_right"]}, {"folder": "flir"}),
    ({"folder": "rgb_*"}, {"folder": "flir"}),
    ({"folder": "images/rgb_*"}, {"folder": "FLIR"}),
    ({"folder": "**"}, {"folder": "flir"}),
    ({"folder": "*/"}, {"folder": ["flir"]}),
    ({"folder": "rgb_*"}, {"camera": 2}),
    ({"camera": "16x12"}, {"camera": ["12x10"]}),
    ({"camera": 1}, {"camera": [2]}),
    ({"photos": "rgb_*/*.png"}, {"photos": ["flir/0.png", "flir\\1.png"]}),
    ({"folder": "rgb_left", "photos": "**/*"}, {"folder": ["flir", "rgb_right"]}),
    ({"folder": "**"}, {"folder": "**", "camera": 2}),
])  # fmt: skip
def test_lists_patterns_cameras_and_single_photos(rig, first, second):
    wanted = (4, 5) if "rgb_right" in second.get("folder", "") else (7, 2)
    assert found(rig, first, second) == wanted


@pytest.mark.parametrize("first,second,words", [
    ({"folder": "lidar"}, {"folder": "flir"}, '"Light" has no images under images/lidar'),
    ({"folder": "rgb_left"}, {"folder": "flir"}, "belongs to no listed modality"),
    ({"folder": ""}, {"folder": "**"}, '"Light" has no images'),
    ({"folder": 5}, {"folder": "flir"}, "'folder' is 5; a text or a list of texts"),
    ({"folder": []}, {"folder": "flir"}, "'folder'"),
    ({"folder": ["rgb_*", 7]}, {"folder": "flir"}, "'folder'"),
    ({"photos": {}}, {"folder": "flir"}, "'photos'"),
    ({"camera": True}, {"folder": "flir"}, "'camera'"),
    ({"camera": 1.5}, {"folder": "flir"}, "a list of texts or numbers"),
    ({"camera": 9}, {"folder": "flir"}, '"Light" has no images'),
])  # fmt: skip
def test_what_chooses_nothing_or_is_no_choice_is_refused(rig, first, second, words):
    with pytest.raises(BadFile, match=words) as refused:
        found(rig, first, second)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("pattern,name,deep", [
    ("a", "a/x", 2), ("a", "a/b/x", 2), ("a/b", "a/b/x", 3), ("a", "b/x", 0), ("a", "a", 0),
    ("", "x", 1), ("", "a/x", 0), (".", "x", 1), ("a*", "ab/x", 2), ("a*", "b/ab/x", 0),
    ("**/c", "a/b/c/x", 3), ("**/c", "c/x", 3), ("a/**/c", "a/c/x", 4), ("a[1]", "a[1]/x", 2),
    ("a?", "ab/x", 2), ("a\\b", "a/b/x", 3), ("/a/", "a/x", 2), ("**", "x", 2),
])  # fmt: skip
def test_how_deep_a_pattern_names_a_folder(pattern, name, deep):
    assert folder_depth(pattern, name.split("/")) == deep


def test_a_pattern_made_to_take_long_does_not():
    """Each ** and * may stand for anything: steps are at most folders times signs."""
    began = time.process_time()
    assert not names_photo("/".join(["**", "*a*"] * 200) + "/z", ["a" * 200] * 300)
    assert time.process_time() - began < 20  # 2 s measured, beside others


def test_beside_transforms_json_it_says_the_modalities_of_frames_that_name_none(tmp_path):
    folder = write_frames(tmp_path, light("images/a{}.png") + light("images/b{}.png", 3))
    assert found(folder, {"photos": "a*"}, {"photos": "b*"}) == (4, 3)
    assert found(folder, {"folder": "images"}, {"photos": "images/b1.*"}) == (6, 1)
    assert found(folder, {"camera": "16x12"}, {"photos": "b?.png"}) == (4, 3)
    data = json.loads((folder / "transforms.json").read_text())
    for frame in data["frames"]:
        frame["modality"] = "RGB"
    (folder / "transforms.json").write_text(json.dumps(data))
    assert [stop.name for stop in read_capture(folder).stops] == ["RGB"], "frames say it themselves"


def test_thermal_gaussian_has_its_splits_and_one_place_a_pair(tmp_path):
    capture = read_capture(thermal_gaussian()(tmp_path))
    by = {(p.modality, p.path.name): p for p in capture.photos}
    for name in sorted({name for _, name in by}):
        one, other = by["rgb", name], by["thermal", name]
        np.testing.assert_array_equal(one.view.eye_from_world(), other.view.eye_from_world())
        assert one.split == other.split == ("test" if int(name[:3]) % 3 == 0 else "train")


def test_a_pair_of_which_one_is_missing_is_said(tmp_path):
    thermal_gaussian()(tmp_path)
    (tmp_path / "thermal/train/001.png").rename(tmp_path / "thermal/train/001.jpg")  # found
    (tmp_path / "thermal/train/002.png").unlink()
    capture = read_capture(tmp_path)
    assert len(capture.photos) == 11
    assert any("1 images of the model have no photo in each of rgb, thermal" in said
               and "002.png" in said for said in capture.doubts)  # fmt: skip


def test_a_photo_whose_folder_is_there_has_no_twin(tmp_path):
    """images/rgb/2.png is missing, images/thermal/2.png is there and of another place."""
    write_colmap(tmp_path, light("rgb/{}.png") + heat("thermal/{}.png"))
    (tmp_path / "images/rgb/2.png").unlink()
    assert len(read_capture(tmp_path).photos) == 7
    write_photos(tmp_path, [Shot("unused.png")])
