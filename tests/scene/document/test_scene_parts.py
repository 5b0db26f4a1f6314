"""Scene files whose objects are parts of one model."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile, ObjectLabel
from shapeshift.runtime_models.package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.scene.colliders.collider_files import collider_key, colliders_of
from shapeshift.scene.document import edits
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import read_models, scene_of
from shapeshift.scene.document.write_scene_file import write_scene_file
from tests.support.models import make_random_model

WHOLE = make_random_model(anchors=60)
WHOLE = replace(
    WHOLE,
    anchors=(
        WHOLE.anchors + np.resize(np.array([[0, 0, 0], [3, 0, 0], [0, 0, 5]], np.float32), (60, 3))
    ),
    labels=np.resize(np.array([0, 1, 2], np.uint8), 60),
    objects=(ObjectLabel(1, "mug"), ObjectLabel(2, "cup")),
)
MUG = {"name": "mug", "model": "room.shift", "part": "mug"}


def scene_file(folder, *objects, background=None):
    write_package(WHOLE, folder / "room.shift", "float32")
    rows = {"format": "shapeshift-scene 1", "objects": list(objects)}
    rows |= {"background": background} if background else {}
    (folder / "room.scene.json").write_text(json.dumps(rows))
    return folder / "room.scene.json"


def places(thing):
    """(A, 3) anchors in the world."""
    pose = thing.world_from_object.matrix()
    return thing.model.anchors @ pose[:3, :3].T + pose[:3, 3]


def test_all_parts_without_poses_are_the_whole_and_the_package_is_read_once(tmp_path, monkeypatch):
    path = scene_file(
        tmp_path, MUG, {"name": "b", "model": "room.shift", "part": 2},
        {"name": "again", "model": "room.shift", "part": 1},
        background={"model": "room.shift", "part": 0},
    )  # fmt: skip
    opened = []
    read = read_package.read_files
    monkeypatch.setattr(read_package, "read_files", lambda *a: opened.append(a[1]) or read(*a))
    file, models = read_models(read_scene_file(path))
    assert opened == ["room.shift"]
    assert models["again"] is models["mug"]  # by name or by label: the same part
    scene = scene_of(file, models)
    found = np.concatenate([places(thing) for thing in scene.objects[:3]])
    order = np.argsort(np.repeat(np.arange(3), 20) + 3 * np.tile(np.arange(20), 3))
    assert np.abs(found[order] - WHOLE.anchors).max() < 1e-6
    assert [item.placed for item in file.all_items] == [True] * 4
    assert file.background.position == (0, 0, 0) and file.items[0].position[0] > 2


def test_a_pose_says_where_the_middle_of_a_part_is(tmp_path):
    path = scene_file(tmp_path, MUG | {"pose": {"position": [1, 2, 3]}})
    scene = scene_of(*read_models(read_scene_file(path)))
    assert np.abs(places(scene.objects[0]).mean(0) - [1, 2, 3]).max() < 1e-5


@pytest.mark.parametrize("pose", [None, {"position": [0, 0, 0]}])
def test_saved_again_a_part_stays_where_it_is(tmp_path, pose):
    path = scene_file(tmp_path, MUG | ({"pose": pose} if pose else {}))
    file, _ = read_models(read_scene_file(path))
    write_scene_file(edits.duplicate(file, "mug", (0, 1, 0)), tmp_path / "saved.scene.json")
    again, _ = read_models(read_scene_file(tmp_path / "saved.scene.json"))
    assert again.items[0] == file.items[0]
    assert [item.part for item in again.items] == ["mug", "mug"]
    # And what was never opened is written as it was read.
    write_scene_file(read_scene_file(path), tmp_path / "unread.scene.json")
    assert read_scene_file(tmp_path / "unread.scene.json") == read_scene_file(path)


def test_colliders_and_painted_regions_are_of_the_part(tmp_path):
    painted = {"kind": "painted", "x": 1, "weight": [0.5] * 20}
    path = scene_file(
        tmp_path, MUG | {"collider": "hulls", "selectors": [painted]},
        {"name": "whole", "model": "room.shift", "collider": "hulls"},
    )  # fmt: skip
    text = path.read_text()
    file, models = read_models(read_scene_file(path))
    scene_of(file, models)
    keys = {collider_key(item, models[item.name]) for item in file.items}
    assert len(keys) == 2
    made = colliders_of(file, models)
    size = {name: np.ptp(made[name].mesh.vertices, axis=0).max() for name in made}
    assert size["mug"] < 3.5 < 5 < size["whole"]  # metres: one ball of three that are 5 m apart
    path.write_text(text.replace("[0.5", "[0.5, 0.5"))
    with pytest.raises(BadFile, match="painted are 21 weights, its model has 20 anchors"):
        scene_of(*read_models(read_scene_file(path)))


@pytest.mark.parametrize("part", [-1, 1.5, True, "", [1], {"label": 1}, 2**31, "a\nb"])
def test_what_is_no_part_is_refused_by_its_key(tmp_path, part):
    with pytest.raises(
        BadFile, match=r"object 'mug': 'part' is .*a label, which is a whole number"
    ):
        read_scene_file(scene_file(tmp_path, MUG | {"part": part}))


def test_parts_that_do_not_exist_name_the_object_and_what_there_is(tmp_path):
    file = read_scene_file(scene_file(tmp_path, MUG | {"part": "bowl"}))
    with pytest.raises(BadFile, match=r"^object 'mug': 'part': nothing of room.shift is 'bowl'; "
                                      r"it has 0, 1 mug, 2 cup\.$"):  # fmt: skip
        read_models(file)
    write_package(make_random_model(), tmp_path / "room.shift")
    with pytest.raises(BadFile, match=r"'part': room[.]shift has no labels of objects"):
        read_models(file)
