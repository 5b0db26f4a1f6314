"""Looks and views in the scene file: what is wrong is one sentence with its key."""

import json

import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.appearance import Sky
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import SceneFile
from shapeshift.scene.document.write_scene_file import write_scene_file

VIEW = {"eye": [0, 1, 2], "target": [0, 0, 0]}
RIGHT = {
    "view": VIEW, "views": [VIEW | {"name": "door"}, VIEW | {"name": "plan", "near_m": 1}],
    "sky": {"zenith": [0, 0, 1], "horizon": [1, 1, 1], "ground": [0, 0, 0]},
    "appearance": {"exposure": 1}, "objects": [{"name": "one", "model": "a", "appearance": {}}],
}  # fmt: skip
WRONG = [
    (("view", "orthographic"), 1, "true or false"),
    (("view", "near_m"), -0.1, "0 or more"),
    (("views",), {}, "a list"),
    (("views", 0, "name"), "plan", "of its own"),
    (("views", 0, "name"), "n" * 101, "100 letters"),
    (("views", 1, "eye"), 5, "3 finite"),
    (("sky",), "blue", "braces"),
    (("sky",), [0, 0, 1.1], "0 to 1"),
    (("sky", "horizon"), [0, 0], "3 finite numbers"),
    (("sky", "ground"), [0, 0, -0.1], "0 to 1"),
    (("appearance", "opacity"), 1.1, "0 to 1"),
    (("objects", 0, "appearance", "exposure"), 11, "-10 to 10"),
    (("objects", 0, "appearance", "gamma"), 0, "0.1 to 10"),
    (("objects", 0, "appearance", "tint"), [1, 1, 5], "0 to 4"),
    (("objects", 0, "appearance", "tint"), "red", "3 finite numbers"),
]


@pytest.mark.parametrize("way,value,said", WRONG)
def test_a_wrong_value_is_one_sentence_with_its_key(tmp_path, way, value, said):
    path, data = tmp_path / "a.scene.json", json.loads(json.dumps(RIGHT))
    path.write_text(json.dumps(data))
    assert len(read_scene_file(path).views) == 2
    inner = data
    for key in way[:-1]:
        inner = inner[key]
    inner[way[-1]] = value
    path.write_text(json.dumps(data))
    with pytest.raises(BadFile) as refused:
        read_scene_file(path)
    sentence, key = str(refused.value), next(k for k in reversed(way) if isinstance(k, str))
    assert "\n" not in sentence and f"'{key}'" in sentence and said in sentence


def test_a_sky_of_one_colour_is_a_list(tmp_path):
    file = SceneFile(folder=tmp_path, sky=Sky((0.1, 0.2, 0.3), (0.1, 0.2, 0.3), (0.1, 0.2, 0.3)))
    write_scene_file(file, tmp_path / "a.scene.json")
    assert json.loads((tmp_path / "a.scene.json").read_text())["sky"] == [0.1, 0.2, 0.3]
    assert read_scene_file(tmp_path / "a.scene.json") == file
