"""Edits of what the viewer shows: file, history, world and scene stay one and the same thing."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state import arrange
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source, read_files
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.colliders import collider_files
from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.document import edits
from shapeshift.scene.pose import Pose
from shapeshift.scene.selectors.selector import Painted, Sphere
from shapeshift.scene.world.follow import reset_objects
from tests.support.desktop.opened_states import model, state_of

ROOT = Path(__file__).resolve().parents[4]
NAMES = ["background", "cube", "ball", "ring", "plate"]


@pytest.fixture(scope="module")
def touch() -> OpenedFiles:
    return read_files(
        [ROOT / "examples" / "touch.scene.json"], None, CameraReading(), lambda *_: None
    )


@pytest.fixture
def state(touch) -> EditorState:
    return state_of(touch)


@pytest.fixture
def plain() -> EditorState:
    """Two files that were opened without a scene file."""
    return state_of(OpenedFiles(tuple(Source(Path(f"/{n}.ply"), model(n)) for n in ("a", "b"))))


def cube() -> Collider:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    quads = [(0, 2, 1, 3), (4, 5, 6, 7), (0, 1, 4, 5), (2, 6, 3, 7), (0, 4, 2, 6), (1, 3, 5, 7)]
    faces = np.array([f for a, b, c, d in quads for f in ((a, b, c), (b, d, c))], np.int32)
    return Collider((corners * 0.05,), TriangleMesh(corners, faces))


def names(state: EditorState) -> list[str]:
    return [obj.name for obj in state.scene.objects]


def same_as_file(state: EditorState) -> None:
    """What is drawn is what the file says, and every row belongs to its object."""
    items = state.edited.file.all_items
    assert names(state) == [item.name for item in items]
    assert len(state.filed) == len(state.sweeps) == len(state.sources) == len(items)
    for obj, item, source in zip(state.scene.objects, items, state.sources, strict=True):
        assert (obj.x, obj.visible, obj.selectors) == (item.x, item.visible, item.selectors)
        assert tuple(obj.world_from_object.position) == item.position
        assert source.model is obj.model is state.edited.model(item)


def edit(state: EditorState, change, *values) -> None:
    arrange.edit(state, change(state.edited.file, *values), change.__name__)


def test_a_scene_file_is_shown_as_it_says(state):
    assert names(state) == NAMES
    same_as_file(state)
    assert not state.edited.unsaved
    assert state.first_view((640, 360)).world_from_eye.position == pytest.approx((0.05, 0.5, 0.95))
    assert tuple(state.first_target) == (0.02, 0.04, 0.0)


def test_every_edit_is_shown_and_taken_back(state):
    first = state.scene
    pose = Pose(np.array([1.0, 2.0, 3.0]), np.array([1.0, 0, 0, 0]))
    steps = [
        (edits.remove, "cube"), (edits.duplicate, "ball", (0.1, 0.0, 0.0)),
        (edits.rename, "ring", "torus"), (edits.hide, "plate"), (edits.set_pose, "torus", pose),
        (edits.ground, -0.3), (edits.remove, "background"), (edits.remove, "ball"),
    ]  # fmt: skip
    scenes = [first]
    for step in steps:
        edit(state, *step)
        same_as_file(state)
        assert state.edited.unsaved
        scenes.append(state.scene)
    assert names(state) == ["ball 2", "torus", "plate"]
    for scene in reversed(scenes[:-1]):
        arrange.undo(state)
        same_as_file(state)
        assert shown_as(state.scene) == shown_as(scene)
    assert not state.edited.unsaved and arrange.undo(state) == ""
    for scene in scenes[1:]:
        assert arrange.redo(state) != ""
        same_as_file(state)
        assert shown_as(state.scene) == shown_as(scene)


def shown_as(scene) -> list:
    return [
        (t.name, t.x, t.visible, tuple(t.world_from_object.position), id(t.model))
        for t in scene.objects
    ]


def test_what_an_edit_does_not_touch_stays_as_it_stands(state):
    state.set_x(2, 0.6)  # as a sweep moves it
    state.sweeps[3].leg_s = 7.0
    ball = state.scene.objects[2]
    edit(state, edits.remove, "cube")
    assert state.scene.objects[1] is ball and state.sweeps[2].leg_s == 7.0
    edit(state, edits.rename, "ball", "globe")
    assert (state.scene.objects[1].x, state.scene.objects[1].name) == (0.6, "globe")


def test_the_chosen_object_follows_its_name(state):
    state.chosen = "ring"
    edit(state, edits.remove, "cube")
    assert state.chosen_index == 2
    edit(state, edits.rename, "ring", "torus")
    assert state.chosen == "torus"
    edit(state, edits.remove, "torus")
    assert state.chosen == "" and state.chosen_index is None
    arrange.undo(state)
    arrange.undo(state)
    assert state.chosen == ""


def test_a_stop_has_the_name_that_the_scene_gives_it(state):
    """The cube's last stop is called "again" in its folder, and is the ring's beginning."""
    assert [stop.name for stop in state.stops(1)] == [
        "normal", "ice", "fire", "charcoal", "normal",
    ]  # fmt: skip


def test_regions_go_with_their_objects(state):
    inside = Sphere(centre=(0, 0, 0), radius=0.05, x=1.0)
    state.regions.add_selectors((inside,), 3)
    state.regions.add_selectors((inside,), 1)
    edit(state, edits.remove, "cube")
    assert [region.index for region in state.regions.items] == [2]
    view = state.first_view((64, 64))
    assert [len(obj.selectors) for obj in state.shown(view).objects] == [0, 0, 1, 0]
    file = edits.change(state.edited.file, "ring", selectors=(inside,))
    arrange.edit(state, file, "a selector")
    assert len(state.shown(view).objects[2].selectors) == 2  # the file's and the region's


def test_a_hand_on_the_slider_is_a_look_that_is_saved_but_not_undone(plain):
    arrange.steer(plain, 0, 0.3)
    assert plain.edited.file.items[0].x == 0.3  # where it starts, once it is saved
    assert arrange.undo(plain) == "" and not plain.edited.unsaved
    edit(plain, edits.hide, "b")
    arrange.steer(plain, 0, 0.7)
    arrange.all_go_to_stop(plain, 1)
    plain.advance(1.0)
    assert [obj.x for obj in plain.scene.objects] == [1.0, 1.0]
    assert arrange.undo(plain) == "hide"
    same_as_file(plain)
    assert [obj.x for obj in plain.scene.objects] == [1.0, 1.0]
    assert all(obj.visible for obj in plain.scene.objects) and arrange.undo(plain) == ""
    arrange.steer(plain, 1, 0.2)
    assert arrange.redo(plain) == "hide"  # a look between them takes nothing away
    same_as_file(plain)
    assert [(obj.x, obj.visible) for obj in plain.scene.objects] == [
        (1.0, True),
        (0.2, False),
    ]


def test_a_look_goes_with_an_object_that_is_renamed_back(plain):
    edit(plain, edits.rename, "a", "c")
    arrange.steer(plain, 0, 0.6)
    arrange.undo(plain)
    same_as_file(plain)
    assert (plain.scene.objects[0].name, plain.scene.objects[0].x) == ("a", 0.6)


def test_what_is_deleted_comes_back_with_the_x_it_had(plain):
    arrange.steer(plain, 0, 0.4)
    edit(plain, edits.remove, "a")
    arrange.undo(plain)
    same_as_file(plain)
    assert plain.scene.objects[0].x == 0.4


def test_regions_are_undone_with_everything_else_in_the_order_it_was_done(plain):
    regions = plain.regions
    plain.add_region("sphere")
    plain.record_regions()
    for x in (0.1, 0.2, 0.3):  # a drag on its slider
        regions.edit(0, x=x)
        plain.record_regions()
    plain.rest()
    edit(plain, edits.hide, "b")
    regions.edit(0, name="lid")
    regions.toggle_lens(plain.scene.objects[0])  # a look
    assert arrange.undo(plain) == "rename sphere 1"
    assert [r.name for r in regions.items] == ["sphere 1", "lens 1"]
    assert arrange.undo(plain) == "hide" and plain.scene.objects[1].visible
    assert arrange.undo(plain) == "x of sphere 1" and regions.items[0].x == 1.0
    assert arrange.undo(plain) == "add sphere 1"
    assert [r.name for r in regions.items] == ["lens 1"]
    assert arrange.undo(plain) == "" and [r.name for r in regions.items] == ["lens 1"]
    for what in ("add sphere 1", "x of sphere 1", "hide", "rename sphere 1"):
        assert arrange.redo(plain) == what
    assert [(r.name, r.x) for r in regions.items] == [("lid", 0.3), ("lens 1", 1.0)]
    assert arrange.redo(plain) == ""


def test_strokes_are_undone_one_by_one(plain):
    regions, view = plain.regions, plain.first_view((64, 64))
    plain.paint(view, (32, 32), 0.0, False)  # nothing is under the brush: the region alone
    plain.record_regions()
    for mask in ([1, 0, 0], [1, 1, 0]):
        regions.edit(0, painted=np.array(mask, bool))
        plain.record_regions()
    plain.rest()
    regions.edit(0, painted=np.array([1, 1, 1], bool))
    assert arrange.undo(plain) == "paint painted 1" and regions.items[0].painted.sum() == 2
    assert arrange.undo(plain) == "paint painted 1" and regions.items[0].painted.sum() == 0
    assert arrange.undo(plain) == "add painted 1" and regions.items == ()
    arrange.redo(plain)
    assert arrange.redo(plain) == "paint painted 1" and regions.items[0].painted.sum() == 2


def test_a_region_comes_back_with_its_deleted_object(state):
    state.chosen = "cube"
    state.regions.add_selectors((Sphere(centre=(0, 0, 0), radius=0.05, x=1.0),), 3)
    state.keep_regions()
    assert state.edited.history.undoes == ""
    edit(state, edits.remove, "ring")
    assert state.regions.items == ()
    edit(state, edits.remove, "cube")
    arrange.undo(state)
    arrange.undo(state)
    assert [region.index for region in state.regions.items] == [3]
    assert names(state)[3] == "ring" and state.regions.kept == state.edited.saved_regions
    arrange.redo(state)
    assert state.regions.items == ()


def test_paint_of_another_level_of_detail_is_none_after_undoing(plain):
    plain.paint(plain.first_view((64, 64)), (32, 32), 0.0, False)
    plain.record_regions()
    plain.regions.edit(0, painted=np.ones(3, bool))
    plain.record_regions()
    plain.rest()
    edit(plain, edits.hide, "b")
    finer = replace(model("a"), **{
        name: np.repeat(getattr(model("a"), name), 2, axis=0)
        for name in ("means", "scales", "wxyz", "opacity", "sh", "layer")
    })  # fmt: skip
    plain.replace_model(0, finer)
    assert len(plain.regions.items[0].painted) == 6
    arrange.undo(plain)
    assert plain.regions.items[0].painted.tolist() == [False] * 6


def test_what_was_opened_alone_is_a_scene_that_is_not_saved(plain):
    items = plain.edited.file.items
    assert [Path(item.model).name for item in items] == ["a.ply", "b.ply"]
    assert all(Path(item.model).is_absolute() for item in items)
    assert plain.edited.path is None and not plain.edited.unsaved
    edit(plain, edits.remove, "a")
    assert plain.edited.unsaved and names(plain) == ["b"]
    edit(plain, edits.remove, "b")
    assert plain.scene.objects == ()
    arrange.undo(plain)
    arrange.undo(plain)
    assert names(plain) == ["a", "b"] and not plain.edited.unsaved


def test_two_of_the_same_file_have_names_of_their_own():
    state = state_of(OpenedFiles(tuple(Source(Path("/data/a.ply"), model("a")) for _ in range(3))))
    assert names(state) == ["a", "a 2", "a 3"]


@pytest.mark.parametrize("seed", range(4))
def test_whatever_is_edited_undone_and_redone_all_stay_one(state, seed, monkeypatch):
    """Hundreds of edits by chance: file, scene and world tell the same after each."""
    monkeypatch.setattr(collider_files, "one_collider", lambda *_: cube())
    rng = np.random.default_rng(seed)
    ready(state)
    for _ in range(150):
        state.world.paused = True
        do_something(state, rng)
        ready(state)
        same_as_file(state)
        same_in_world(state)
        if rng.random() < 0.1:  # things fall, answer, and are put where the file says
            state.world.paused = False
            for _ in range(5):
                state.world.step()
            reset_objects(state.world)
            state.follow_world()
            same_as_file(state)
    for _ in range(500):
        arrange.undo(state)
    ready(state)
    same_as_file(state)
    same_in_world(state)
    assert names(state) == NAMES and not state.edited.unsaved


def do_something(state: EditorState, rng: np.random.Generator) -> None:
    file = state.edited.file
    name = rng.choice(names(state)) if state.scene.objects else ""
    deed = rng.integers(0, 12)
    if deed < 2:
        arrange.undo(state)
    elif deed < 4:
        arrange.redo(state)
    elif not name or (deed == 4 and len(file.items) < 12):
        item = replace(edits.find(file, name), name=f"new {rng.integers(5)}") if name else None
        item = item or state.edited.history.steps[0].file.items[0]
        arrange.edit(state, edits.add(file, item), "add")
    elif deed == 5:
        arrange.edit(state, edits.remove(file, name), "delete")
    elif deed == 6 and len(file.items) < 12:
        arrange.edit(state, edits.duplicate(file, name, tuple(rng.normal(size=3))), "copy")
    elif deed == 7 and name != "background":
        wanted = f"name {rng.integers(100)}"
        if edits.find(file, wanted) is None:
            arrange.edit(state, edits.rename(file, name, wanted), "rename")
    elif deed == 8:
        turn = rng.normal(size=4)
        pose = Pose(rng.normal(size=3), turn / np.linalg.norm(turn))
        arrange.place(state, names(state).index(name), pose)
    elif deed == 9:
        arrange.steer(state, names(state).index(name), float(rng.random()))
    elif deed == 10:
        file = edits.change(file, name, collider=None if rng.random() < 0.5 else "hulls")
        if name != "background":
            file = edits.change(file, name, static=bool(rng.random() < 0.5))
        arrange.edit(state, file, "body")
    else:
        file = edits.hide(file, name, bool(rng.random() < 0.5))
        arrange.edit(state, edits.ground(file, float(rng.random())), "hide, and another floor")
    if rng.random() < 0.5:
        state.rest()


def ready(state: EditorState) -> None:
    end = time.monotonic() + 30
    while state.bodies.poll(state.edited) and time.monotonic() < end:
        time.sleep(0.0005)
    assert state.bodies.problem == "" and not state.bodies.busy


def same_in_world(state: EditorState) -> None:
    """The world has the same objects in the same order, places, values and bodies."""
    items = state.edited.file.all_items
    assert list(state.world.objects) == [item.name for item in items]
    for item, obj in zip(items, state.world.objects.values(), strict=True):
        assert obj.item is item and obj.reaction_state.x == item.x
        assert (obj.body is not None) == (item.collider is not None)
        assert obj.pose.position == pytest.approx(item.position, abs=1e-5)


def test_an_edit_that_cannot_be_leaves_all_as_it_was(state):
    before = state.scene
    wrong = edits.change(
        state.edited.file, "ball", selectors=(Painted(np.ones(7, np.float32), 1.0),)
    )
    wrong = edits.add(wrong, replace(edits.find(wrong, "ball"), name="copy"))
    with pytest.raises(BadFile, match="paint it anew"):
        arrange.edit(state, wrong, "paint")
    assert shown_as(state.scene) == shown_as(before) and not state.edited.unsaved
