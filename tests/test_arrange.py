"""Edits of what the viewer shows: file, history, world and scene stay one and the same thing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app import arrange
from app.files import opened_scene
from app.opened import Found, Source, read_files
from app.stage import Stage
from runtime_models.model import BadFile, SplatLayers, Stop
from scene import edits
from scene.camera_list import CameraReading
from scene.pose import Pose
from scene.selector import Sphere

ROOT = Path(__file__).resolve().parents[1]
NAMES = ["background", "cube", "ball", "ring", "plate"]


def stage_of(found: Found) -> Stage:
    stage = Stage(lambda path: None)
    scene, document = opened_scene(found)
    stage.take(found.sources, scene, None, document)
    return stage


@pytest.fixture(scope="module")
def touch() -> Found:
    return read_files(
        [ROOT / "assets" / "touch.scene.json"], None, CameraReading(), lambda *_: None
    )


@pytest.fixture
def stage(touch) -> Stage:
    return stage_of(touch)


def model(name: str) -> SplatLayers:
    return SplatLayers(
        np.zeros((3, 3), np.float32), np.full((3, 3), 0.1, np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1)), np.full(3, 0.9, np.float32),
        np.zeros((3, 1, 3), np.float32), np.zeros(3, np.int32),
        (Stop(name, 0.0), Stop("other", 1.0)),
    )  # fmt: skip


@pytest.fixture
def plain() -> Stage:
    """Two files that were opened without a scene file."""
    return stage_of(Found(tuple(Source(Path(f"/data/{n}.ply"), model(n)) for n in ("a", "b"))))


def names(stage: Stage) -> list[str]:
    return [thing.name for thing in stage.scene.objects]


def same_as_file(stage: Stage) -> None:
    """What is drawn is what the file says, and every row belongs to its object."""
    items = stage.document.file.all_items
    assert names(stage) == [item.name for item in items]
    assert len(stage.filed) == len(stage.sweeps) == len(stage.sources) == len(items)
    for thing, item, source in zip(stage.scene.objects, items, stage.sources, strict=True):
        assert (thing.x, thing.visible, thing.selectors) == (item.x, item.visible, item.selectors)
        assert tuple(thing.world_from_object.position) == item.position
        assert source.model is thing.model is stage.document.model(item)


def edit(stage: Stage, change, *values) -> None:
    arrange.edit(stage, change(stage.document.file, *values), change.__name__)


def test_a_scene_file_is_shown_as_it_says(stage):
    assert names(stage) == NAMES
    same_as_file(stage)
    assert not stage.document.unsaved
    assert stage.first_view((640, 360)).world_from_eye.position == pytest.approx((0.05, 0.5, 0.95))
    assert tuple(stage.first_target) == (0.02, 0.04, 0.0)


def test_every_edit_is_shown_and_taken_back(stage):
    first = stage.scene
    pose = Pose(np.array([1.0, 2.0, 3.0]), np.array([1.0, 0, 0, 0]))
    steps = [
        (edits.remove, "cube"), (edits.duplicate, "ball", (0.1, 0.0, 0.0)),
        (edits.rename, "ring", "torus"), (edits.hide, "plate"), (edits.place, "torus", pose),
        (edits.set_x, "ball 2", 1.0), (edits.remove, "background"), (edits.remove, "ball"),
    ]  # fmt: skip
    scenes = [first]
    for step in steps:
        edit(stage, *step)
        same_as_file(stage)
        assert stage.document.unsaved
        scenes.append(stage.scene)
    assert names(stage) == ["ball 2", "torus", "plate"]
    for scene in reversed(scenes[:-1]):
        arrange.undo(stage)
        same_as_file(stage)
        assert told(stage.scene) == told(scene)
    assert not stage.document.unsaved and arrange.undo(stage) == ""
    for scene in scenes[1:]:
        assert arrange.redo(stage) != ""
        same_as_file(stage)
        assert told(stage.scene) == told(scene)


def told(scene) -> list:
    return [
        (t.name, t.x, t.visible, tuple(t.world_from_object.position), id(t.model))
        for t in scene.objects
    ]


def test_what_an_edit_does_not_touch_stays_as_it_stands(stage):
    stage.set_x(2, 0.6)  # as a sweep moves it
    stage.sweeps[3].leg_s = 7.0
    ball = stage.scene.objects[2]
    edit(stage, edits.remove, "cube")
    assert stage.scene.objects[1] is ball and stage.sweeps[2].leg_s == 7.0
    edit(stage, edits.rename, "ball", "globe")
    assert (stage.scene.objects[1].x, stage.scene.objects[1].name) == (0.6, "globe")


def test_the_chosen_object_follows_its_name(stage):
    stage.chosen = "ring"
    edit(stage, edits.remove, "cube")
    assert stage.chosen_index == 2
    edit(stage, edits.rename, "ring", "torus")
    assert stage.chosen == "torus"
    edit(stage, edits.remove, "torus")
    assert stage.chosen == "" and stage.chosen_index is None
    arrange.undo(stage)
    arrange.undo(stage)
    assert stage.chosen == ""


def test_regions_go_with_their_objects(stage):
    inside = Sphere(centre=(0, 0, 0), radius=0.05, x=1.0)
    stage.regions.take((inside,), 3)
    stage.regions.take((inside,), 1)
    edit(stage, edits.remove, "cube")
    assert [region.index for region in stage.regions.items] == [2]
    view = stage.first_view((64, 64))
    assert [len(thing.selectors) for thing in stage.shown(view).objects] == [0, 0, 1, 0]
    file = edits.change(stage.document.file, "ring", selectors=(inside,))
    arrange.edit(stage, file, "a selector")
    assert len(stage.shown(view).objects[2].selectors) == 2  # the file's and the region's


def test_a_hand_on_the_slider_is_one_step(plain):
    for x in (0.1, 0.2, 0.3):
        arrange.steer(plain, 0, x)
    plain.rest()
    arrange.steer(plain, 0, 0.9)
    assert plain.document.history.undoes == "x of a" and not plain.document.unsaved
    assert arrange.undo(plain) == "x of a" and plain.scene.objects[0].x == 0.3
    arrange.undo(plain)
    assert plain.scene.objects[0].x == 0.0
    plain.go_to_stop(1)
    assert [thing.x for thing in plain.scene.objects] == [1.0, 1.0]
    assert arrange.undo(plain) == "stop 2"
    assert [thing.x for thing in plain.scene.objects] == [0.0, 0.0]


def test_what_was_opened_alone_is_a_scene_that_is_not_saved(plain):
    items = plain.document.file.items
    assert [Path(item.model).name for item in items] == ["a.ply", "b.ply"]
    assert all(Path(item.model).is_absolute() for item in items)
    assert plain.document.path is None and not plain.document.unsaved
    edit(plain, edits.remove, "a")
    assert plain.document.unsaved and names(plain) == ["b"]
    edit(plain, edits.remove, "b")
    assert plain.scene.objects == ()
    arrange.undo(plain)
    arrange.undo(plain)
    assert names(plain) == ["a", "b"] and not plain.document.unsaved


def test_two_of_the_same_file_have_names_of_their_own():
    stage = stage_of(Found(tuple(Source(Path("/data/a.ply"), model("a")) for _ in range(3))))
    assert names(stage) == ["a", "a 2", "a 3"]


def test_an_edit_that_cannot_be_leaves_all_as_it_was(stage):
    before = stage.scene
    from scene.selector import Painted

    wrong = edits.change(
        stage.document.file, "ball", selectors=(Painted(np.ones(7, np.float32), 1.0),)
    )
    wrong = edits.add(wrong, replace(edits.find(wrong, "ball"), name="copy"))
    with pytest.raises(BadFile, match="paint it anew"):
        arrange.edit(stage, wrong, "paint")
    assert told(stage.scene) == told(before) and not stage.document.unsaved
