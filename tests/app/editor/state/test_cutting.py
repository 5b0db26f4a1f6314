"""Objects made of pieces of a model, junk that is taken away: undone, saved and opened again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state.arrange import edit, place, redo, undo
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source, read_files
from shapeshift.app.editor.state.files.saving import Saving, unsaved
from shapeshift.app.editor.state.object_edits import ObjectEdits
from shapeshift.app.editor.state.parts.cutting import delete_rows, hide_rows, make_object
from shapeshift.app.editor.state.regions import Region
from shapeshift.app.editor.state.touch_state import TouchState
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import AnchorModel, BadFile, ObjectLabel
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import BACKGROUND, HULLS
from shapeshift.scene.inspection.laying import LaidPart, Laying
from shapeshift.scene.inspection.marks import Mark
from shapeshift.scene.inspection.marks_file import MarksFile
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import IDENTITY
from shapeshift.scene.sections.section import PlaneShape, SceneSection
from tests.support.desktop.desktop_stand import ball
from tests.support.models import make_random_model
from tests.support.splat_scenes import front_view

VIEW = front_view((96, 72), distance=3.0)
COUNT = 60


def found(path: Path) -> OpenedFiles:
    return read_files([path], lambda path, told: read_model(path), CameraReading(), None)


def state_of(opened: OpenedFiles) -> EditorState:
    state = EditorState(lambda path: None)
    scene, edited = opened_scene(opened)
    state.open_sources(opened.sources, scene, None, edited)
    state.bodies.follow = lambda edited: None  # colliders are made elsewhere
    return state


@pytest.fixture
def package(tmp_path) -> Path:
    folder = tmp_path / "given"
    folder.mkdir()
    model = make_random_model(COUNT, k=3)
    features = model.features.astype(np.float16).astype(np.float32)
    write_package(replace(model, features=features), folder / "room.shift")
    return folder / "room.shift"


@pytest.fixture
def state(package) -> EditorState:
    return state_of(found(package))


def picture(state: EditorState) -> np.ndarray:
    with Renderer(None) as renderer:
        renderer.update(state.shown(VIEW))
        renderer.draw([VIEW])
        return renderer.resolved().copy()


def names(state: EditorState) -> list[str]:
    return [obj.name for obj in state.scene.objects]


def some(count: int, *, of: int = 4) -> np.ndarray:
    return np.arange(count) % of == 1


def saver(state: EditorState, folder: Path) -> Saving:
    return Saving(state, OwnFiles(None), folder, lambda path: None)


def anchors_of(state: EditorState) -> np.ndarray:
    """(A, 3) metres in the world, sorted: of all objects."""
    places = []
    for obj in state.scene.objects:
        pose = obj.world_from_object.matrix()
        places.append(obj.model.anchors @ pose[:3, :3].T + pose[:3, 3])
    rows = np.concatenate(places)
    return rows[np.lexsort(rows.T)]


def same_picture(one: np.ndarray, other: np.ndarray) -> None:
    # A millionth of a metre, to which poses are rounded, moves no pixel by a step of 8 bits.
    np.testing.assert_allclose(one, other, atol=1 / 255)
    assert np.abs(one - other).mean() < 1e-4


def test_pieces_and_what_is_left_have_the_emissivity_of_what_was_cut(state):
    (name,) = names(state)
    state.edited.record_marks(MarksFile(objects=((name, 0.7),)), "emissivity")
    make_object(state, 0, some(COUNT), "mug")
    assert dict(state.edited.marks.objects) == {BACKGROUND: 0.7, "mug": 0.7}
    undo(state)
    assert state.edited.marks.objects == ((name, 0.7),)


def test_what_is_kept_by_an_objects_name_follows_it(state):
    """Its emissivity, what a mark was laid on, its own slider, its pad; undone, it goes back."""
    make_object(state, 0, some(COUNT), "mug")
    touch, objects = TouchState(state, False), ObjectEdits(state, None, lambda: None)
    part = LaidPart.of("mug", np.array([40.0]))
    laid = Laying("2026-11-29T14:05:00", VIEW, "heat", "C", (0.0, 90.0), (part,))
    mark = Mark("Sp1", "spot", np.zeros((1, 3)), laid=laid)
    before = MarksFile(marks=(mark,), objects=(("mug", 0.6), ("die", 0.3)))  # that one is gone
    state.edited.record_marks(before, "emissivity")
    state.chain.loose.add("mug")
    state.steered = state.chosen = state.split.name = "mug"
    touch.pads["mug"] = (0.5, 0.5)

    def kept() -> tuple:
        marks, split = state.edited.marks, state.split.name
        hand = state.steered, state.chosen, split, *state.chain.loose, *touch.pads
        return dict(marks.objects), marks.marks[0].laid.parts[0].object, *hand

    for step, name, shares in (
        (
            lambda: objects.edit(edits.rename, "mug", "die", what="rename mug"),
            "die",
            {"die": 0.6},
        ),
        (lambda: undo(state), "mug", dict(before.objects)),
        (lambda: redo(state), "die", {"die": 0.6}),
    ):
        step()
        assert kept() == (shares, *[name] * 6)
    objects.duplicate()
    copy = state.chosen
    assert dict(state.edited.marks.objects) == {"die": 0.6, copy: 0.6} and copy != "die"
    assert state.edited.marks.marks[0].laid.parts[0].object == "die"


def test_a_piece_becomes_an_object_in_one_step_and_goes_back(state):
    before, places = picture(state), anchors_of(state)
    rows = some(COUNT)
    assert make_object(state, 0, rows, "mug") == "mug"
    assert names(state) == [BACKGROUND, "mug"] and len(state.edited.history.steps) == 2
    rest, mug = state.scene.objects
    assert (len(rest.model.anchors), len(mug.model.anchors)) == (45, 15)
    assert (rest.label, mug.label) == (0, 1)
    file = state.edited.file
    assert file.background.static and file.items[0].collider == HULLS and not file.items[0].static
    low = places[:, 1].min()
    assert low <= file.floor_y <= low + 0.2 and state.edited.name == "room.scene.json"
    np.testing.assert_allclose(mug.model.anchors.mean(axis=0), 0, atol=1e-6)  # a frame of its own
    np.testing.assert_allclose(anchors_of(state), places, atol=2e-6)
    same_picture(picture(state), before)
    assert mug.model.networks is rest.model.networks  # nothing of them is copied
    assert undo(state) == "make mug" and names(state) == ["room"]
    np.testing.assert_array_equal(picture(state), before)
    assert redo(state) == "make mug" and names(state) == [BACKGROUND, "mug"]
    same_picture(picture(state), before)


def test_it_keeps_its_slider(state):
    make_object(state, 0, some(COUNT), "mug")
    whole = state_of(OpenedFiles(state.sources[:1], None, None))
    assert [obj.model.stops for obj in state.scene.objects] == [
        whole.scene.objects[0].model.stops
    ] * 2
    state.set_x(1, 0.7)
    assert [obj.x for obj in state.scene.objects] == [0.0, 0.7]


def test_pieces_of_pieces(state):
    before = picture(state)
    make_object(state, 0, some(COUNT), "mug")
    place(
        state, 1, Pose(state.scene.objects[1].world_from_object.position, np.array([0, 1.0, 0, 0]))
    )
    turned = picture(state)
    make_object(state, 1, some(15, of=3), "handle")
    assert names(state) == [BACKGROUND, "mug", "handle"]
    assert [len(obj.model.anchors) for obj in state.scene.objects] == [45, 10, 5]
    same_picture(picture(state), turned)
    make_object(state, 0, some(45), "can")
    assert [len(obj.model.anchors) for obj in state.scene.objects] == [34, 10, 5, 11]
    same_picture(picture(state), turned)
    for _ in range(4):
        undo(state)
    assert names(state) == ["room"]
    np.testing.assert_array_equal(picture(state), before)


def test_junk_is_hidden_or_deleted(state):
    rows = some(COUNT)
    assert hide_rows(state, 0, rows) == "hidden"
    hidden = picture(state)
    assert not state.scene.objects[1].visible and state.edited.file.items[0].collider is None
    undo(state)
    delete_rows(state, 0, rows)
    assert names(state) == ["room"] and len(state.scene.objects[0].model.anchors) == 45
    np.testing.assert_allclose(picture(state), hidden, atol=1e-5)
    assert state.edited.history.undoes == "delete 15 anchors"
    undo(state)
    assert len(state.scene.objects[0].model.anchors) == COUNT


@pytest.mark.parametrize("x", [0.0, 0.5, 1.0])
def test_what_is_saved_is_opened_again(state, package, tmp_path, x):
    untouched = package.read_bytes()
    state.set_x(0, x)
    delete_rows(state, 0, np.arange(COUNT) >= 56)
    make_object(state, 0, some(56), "mug")
    make_object(state, 0, some(42, of=7), "oil can")
    for index in range(3):
        state.set_x(index, x)
    place(state, 1, Pose(np.array([0.3, 0.2, 0.1]), np.array([0.6, 0.8, 0.0, 0.0])))
    wanted = picture(state)
    path = tmp_path / "mine" / "room.scene.json"
    saving = saver(state, path.parent)
    assert saving.named(str(path)) and not unsaved(state), state.problem
    files = sorted(file.name for file in path.parent.iterdir())
    assert files == ["room parts.shift", "room.scene.json"] and package.read_bytes() == untouched
    kept = read_model(path.parent / "room parts.shift")
    assert kept.objects == (ObjectLabel(1, "mug"), ObjectLabel(2, "oil can"))
    assert len(kept.anchors) == 56  # what was deleted is not there
    again = state_of(found(path))
    assert names(again) == [BACKGROUND, "mug", "oil can"]
    assert [item.part for item in again.edited.file.all_items] == [0, 1, 2]
    for index in range(3):
        again.set_x(index, x)
    np.testing.assert_allclose(anchors_of(again), anchors_of(state), atol=1e-6)
    np.testing.assert_allclose(picture(again), wanted, atol=1e-5)


def test_saving_again_replaces_what_this_window_wrote_and_nothing_else(state, tmp_path):
    path = tmp_path / "mine" / "room.scene.json"
    saving = saver(state, path.parent)
    make_object(state, 0, some(COUNT), "mug")
    assert saving.named(str(path))
    first = (path.parent / "room parts.shift").read_bytes()
    assert saving.save()  # nothing changed
    assert (path.parent / "room parts.shift").read_bytes() == first
    make_object(state, 0, some(45), "can")
    assert saving.save()
    assert sorted(file.name for file in path.parent.iterdir()) == ["room parts.shift", path.name]
    assert len(read_model(path.parent / "room parts.shift").objects) == 2
    (path.parent / "room parts.shift").write_bytes(first)  # by somebody else
    make_object(state, 0, some(34), "spanner")
    assert saving.save()
    assert (path.parent / "room parts.shift").read_bytes() == first
    assert len(read_model(path.parent / "room parts 2.shift").objects) == 3


def test_what_is_opened_is_cut_further_into_a_file_of_its_own(state, tmp_path):
    path = tmp_path / "mine" / "room.scene.json"
    make_object(state, 0, some(COUNT), "mug")
    saver(state, path.parent).named(str(path))
    again = state_of(found(path))
    before = (path.parent / "room parts.shift").read_bytes()
    make_object(again, 0, some(45), "can")
    wanted = picture(again)
    again_path = tmp_path / "mine" / "other.scene.json"
    assert saver(again, path.parent).named(str(again_path)), again.problem
    assert (path.parent / "room parts.shift").read_bytes() == before
    third = state_of(found(again_path))
    assert names(third) == [BACKGROUND, "mug", "can"]
    np.testing.assert_allclose(picture(third), wanted, atol=1e-5)


def test_labels_of_a_whole_package_become_objects_with_the_first_cut(package):
    model = read_model(package)
    labels = np.where(np.arange(COUNT) < 20, np.uint8(7), np.uint8(0))
    labelled = replace(model, labels=labels, objects=(ObjectLabel(7, "valve"),))
    state = state_of(OpenedFiles((Source(package, labelled),)))
    before = picture(state)
    make_object(state, 0, np.arange(COUNT) >= 50, "mug")
    assert names(state) == [BACKGROUND, "mug", "valve"]
    assert [len(obj.model.anchors) for obj in state.scene.objects] == [30, 10, 20]
    same_picture(picture(state), before)


def test_regions_stay_where_they_were(state):
    obj = state.scene.objects[0]
    state.regions.add("painted", 0, obj, np.zeros(3))
    state.regions.edit(0, painted=np.arange(COUNT) % 2 == 0, x=1.0)
    state.regions.add("sphere", 0, obj, np.array([0.1, 0.0, 0.0]))
    state.regions.edit(1, half=np.full(3, 0.6), x=0.5, border=0.1)
    state.record_regions()
    before = picture(state)
    make_object(state, 0, np.arange(COUNT) < 30, "half")
    assert [(r.kind, r.index) for r in state.regions.items] == [
        ("painted", 0), ("painted", 1), ("sphere", 0), ("sphere", 1),
    ]  # fmt: skip
    same_picture(picture(state), before)
    undo(state)
    assert [(r.kind, r.index) for r in state.regions.items] == [("painted", 0), ("sphere", 0)]
    np.testing.assert_array_equal(picture(state), before)
    assert isinstance(state.regions.items[0], Region)


def test_sections_stay_where_they_were(state):
    """A piece's frame begins elsewhere; its sections cut the same places of the world."""
    section = SceneSection(shape=PlaneShape((0.6, 0.8, 0.0), 0.1), space="object")
    name = state.scene.objects[0].name
    edit(state, edits.set_sections(state.edited.file, name, (section,)), "add a section")
    edit(
        state, edits.set_sections(state.edited.file, "", (replace(section, space="world"),)), "add"
    )
    world = [one.half_spaces_of(IDENTITY) for one in state.scene.objects[0].sections]
    make_object(state, 0, np.arange(COUNT) < 20, "part")
    assert len(state.scene.objects) == 2
    for obj in state.scene.objects:
        matrix = obj.world_from_object.matrix()
        for one, before in zip(obj.sections, world, strict=True):
            (*normal, offset), (*wanted, at) = (
                one.half_spaces_of(obj.world_from_object)[0],
                before[0],
            )
            turned = matrix[:3, :3] @ normal
            assert turned == pytest.approx(wanted, abs=1e-9)
            assert offset + turned @ matrix[:3, 3] == pytest.approx(at, abs=1e-6)


def test_plain_splats_are_cut_and_saved(tmp_path):
    b = ball(200)
    path = tmp_path / "ball.ply"
    write_ply(PlainSplats(b.means + 0.5, b.scales, b.wxyz, b.opacity, b.sh), path)
    state = state_of(found(path))
    before = picture(state)
    make_object(state, 0, b.means[:, 1] > 0.3, "cap")
    delete_rows(state, 0, some(len(state.scene.objects[0].model.means), of=9))
    wanted = picture(state)
    assert np.abs(wanted - before).max() > 0.01
    scene = tmp_path / "mine" / "ball.scene.json"
    assert saver(state, scene.parent).named(str(scene)), state.problem
    again = state_of(found(scene))
    assert names(again) == [BACKGROUND, "cap"]
    np.testing.assert_allclose(picture(again), wanted, atol=2e-3)  # logits and logarithms


def test_what_cannot_be_is_a_sentence_and_changes_nothing(state, tmp_path):
    history, pieces = state.edited.history, dict(state.edited.pieces)
    for rows, words in (
        (np.zeros(COUNT, bool), "Nothing"),
        (np.ones(COUNT, bool), "all of 'room'"),
    ):
        with pytest.raises(BadFile, match=words):
            make_object(state, 0, rows)
        with pytest.raises(BadFile, match=words):
            delete_rows(state, 0, rows)
    assert state.edited.history is history and state.edited.pieces == pieces
    layers = state_of(OpenedFiles((Source(tmp_path / "two.ply", ball(50)),)))  # of two stops
    make_object(layers, 0, some(50), "some")
    assert not saver(layers, tmp_path / "mine").named(str(tmp_path / "mine" / "two.scene.json"))
    assert "layers" in layers.problem and not (tmp_path / "mine" / "two.scene.json").exists()


def test_steps_that_are_gone_take_their_pieces_along(state):
    for n in range(6):
        rows = np.zeros(len(state.scene.objects[0].model.anchors), bool)
        rows[:2] = True
        make_object(state, 0, rows, f"part {n}")
    assert len(state.edited.pieces) == 12
    for _ in range(6):
        undo(state)
    delete_rows(state, 0, some(COUNT))
    assert len(state.edited.pieces) == 1
    assert isinstance(state.scene.objects[0].model, AnchorModel)
