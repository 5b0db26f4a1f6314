"""Scenes are saved from the real window, and nothing is lost or replaced unasked."""

import json
import time

import glfw
import numpy as np
import pytest

from shapeshift.app.editor.panels.sections.camera_panel import begin_with
from shapeshift.app.editor.state.arrange import steer
from shapeshift.app.editor.state.files.edited_file import stamp_of
from shapeshift.app.editor.state.files.journal import Journal
from shapeshift.app.editor.state.files.opened import read_files
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.document import edits
from shapeshift.scene.document.read_scene_file import read_scene_file
from tests.support.desktop.desktop_stand import ball, run_frames, until_opened
from tests.support.desktop.objects_stand import (
    CTRL,
    NAMES,
    SHIFT,
    TOUCH,
    button,
    key,
    mouse,
    names,
    release,
    viewer_of,
)
from tests.support.desktop.real_hands import RealHands
from tests.support.desktop.widgets import Widgets


@pytest.fixture
def viewer(touch_viewer, monkeypatch):
    """On a scene as if the program had brought it along."""
    monkeypatch.setattr("shapeshift.app.paths.ASSETS", TOUCH.parent)
    return touch_viewer


@pytest.fixture
def plain(splats_viewer):
    return splats_viewer


def test_what_the_program_brought_along_is_never_written_over(viewer, tmp_path, display):
    """Ctrl+S by the keyboard itself: a name is asked for, and the one proposed is one's own."""
    before = {path: path.read_bytes() for path in TOUCH.parent.rglob("*") if path.is_file()}
    view = viewer.viewpoint.view().eye_from_world()
    viewer.state.chosen = "ball"
    viewer.objects.edits.delete()
    with RealHands(viewer, display) as hands:
        hands.key("s", "Control_L")
        assert viewer.objects.saving.asking
        hands.key("Return")  # the proposed name
    wanted = tmp_path / "scenes" / "touch.scene.json"
    assert not viewer.objects.saving.asking and not viewer.objects.unsaved
    assert str(wanted) in viewer.state.messages.note  # absolute
    assert [item.name for item in read_scene_file(wanted).items] == ["cube", "ring", "plate"]
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), view)
    after = {path: path.read_bytes() for path in TOUCH.parent.rglob("*") if path.is_file()}
    assert after == before
    again = read_files([wanted], None, CameraReading(), lambda *_: None)
    assert len(again.sources) == 4  # what it names is found from there


@pytest.mark.parametrize("link", [False, True])
def test_a_name_among_what_the_program_brought_along_is_refused(viewer, tmp_path, link):
    before, path = TOUCH.read_bytes(), TOUCH
    if link:
        path = tmp_path / "mine.scene.json"
        path.symlink_to(TOUCH)
    viewer.objects.saving.ask_name()
    assert not viewer.objects.saving.named(str(path), replace=True)
    assert "came with the program" in viewer.state.problem and viewer.objects.saving.asking
    assert TOUCH.read_bytes() == before
    viewer.objects.saving.cancel_name()


def test_ones_own_file_is_written_over_and_anothers_is_not(viewer, tmp_path):
    saving, edited = viewer.objects.saving, viewer.state.edited
    path = tmp_path / "own.scene.json"
    assert not saving.in_place and saving.named(str(path)) and saving.in_place
    viewer.state.chosen = "ball"
    viewer.objects.edits.delete()
    key(viewer, glfw.KEY_S, CTRL)
    assert not saving.asking and not viewer.objects.unsaved
    assert [item.name for item in read_scene_file(path).items] == ["cube", "ring", "plate"]
    other = tmp_path / "other.scene.json"  # as somebody has sent it, and as it was opened
    other.write_bytes(path.read_bytes())
    edited.path, edited.stamp = other, stamp_of(other)
    assert saving.original == other
    key(viewer, glfw.KEY_S, CTRL)
    assert saving.asking and other.read_bytes() == path.read_bytes()
    assert saving.name == str(tmp_path / "scenes" / "other.scene.json")
    saving.cancel_name()


def test_a_file_that_was_opened_is_replaced_when_it_is_said_twice(viewer, tmp_path, monkeypatch):
    saving, edited, widgets = viewer.objects.saving, viewer.state.edited, Widgets(monkeypatch)
    path = tmp_path / "theirs.scene.json"
    path.write_text("{}")
    edited.path, edited.stamp = path, stamp_of(path)
    key(viewer, glfw.KEY_S, CTRL)
    run_frames(viewer, 3)
    for word in ("Over it", "Replace it"):
        assert path.read_text() == "{}"
        mouse(viewer, *widgets.middle(word))
        button(viewer, True)
        button(viewer, False)
        run_frames(viewer, 3)
    assert json.loads(path.read_text())["objects"] and not saving.asking


def test_a_proposed_name_is_free(plain, tmp_path):
    folder = tmp_path / "scenes"
    folder.mkdir()
    for name in ("ball.scene.json", "ball 2.scene.json"):
        (folder / name).write_text("mine")
    plain.objects.saving.ask_name()
    assert plain.objects.saving.name == str(folder / "ball 3.scene.json")
    plain.objects.saving.cancel_name()


def test_what_somebody_else_has_written_meanwhile_is_asked_about(viewer, tmp_path):
    objects, edited = viewer.objects, viewer.state.edited
    path = tmp_path / "a.scene.json"
    assert objects.saving.named(str(path))
    path.write_text("{}")  # by somebody else
    assert not objects.saving.save() and objects.saving.asking and path.read_text() == "{}"
    run_frames(viewer, 3)
    key(viewer, glfw.KEY_DELETE)  # the box is open: not for the scene
    key(viewer, glfw.KEY_ESCAPE)
    run_frames(viewer, 2)
    assert not objects.saving.asking and path.read_text() == "{}" and names(viewer) == NAMES
    assert objects.saving.in_place  # by its name; what lies there is asked about all the same
    objects.saving.save()
    assert objects.saving.named(str(path), replace=True) and not objects.saving.asking
    assert json.loads(path.read_text())["objects"] and edited.path == path


def test_nothing_is_replaced_unasked(viewer, tmp_path):
    path = tmp_path / "taken.scene.json"
    path.write_text("mine")
    saving = viewer.objects.saving
    assert not saving.named(str(tmp_path / "taken")) and path.read_text() == "mine"
    saving.cancel_name()
    assert not saving.named("  ") and not saving.asking


def test_a_folder_that_cannot_be_written_is_a_sentence(viewer, tmp_path):
    (tmp_path / "file").write_text("")
    assert not viewer.objects.saving.named(str(tmp_path / "file" / "x"))
    assert "cannot be saved" in viewer.state.problem and "\n" not in viewer.state.problem


def test_a_name_is_typed_and_what_goes_wrong_is_said_until_it_is_read(viewer, tmp_path):
    (tmp_path / "file").write_text("")
    for name, right in (("file/x", False), ("mine", True)):
        key(viewer, glfw.KEY_S, CTRL | SHIFT)
        run_frames(viewer, 3)
        for letter in str(tmp_path / name):  # over what stands there, all of it
            viewer.window.on_char(None, ord(letter))
        run_frames(viewer, 3)
        key(viewer, glfw.KEY_ENTER)
        run_frames(viewer, 3)
        assert (tmp_path / "mine.scene.json").is_file() == right
        assert ("cannot be saved" in viewer.state.problem) != right
        key(viewer, glfw.KEY_ESCAPE)  # out of the field, which had taken the key before
        key(viewer, glfw.KEY_ESCAPE)
        run_frames(viewer, 3)
        assert not viewer.objects.saving.asking
        key(viewer, glfw.KEY_ESCAPE)  # it is read
        assert viewer.state.problem == ""
    assert viewer.state.edited.path == tmp_path / "mine.scene.json"


def test_splats_are_saved_as_a_scene_file_and_opened_again(plain, tmp_path):
    state = plain.state
    assert not plain.objects.unsaved and state.world is None
    state.add_region("sphere")
    state.regions.edit(0, x=1.0)
    state.toggle_lens()  # of the eye, not of the file
    key(plain, glfw.KEY_S, CTRL)
    assert plain.objects.saving.asking
    plain.objects.saving.cancel_name()
    run_frames(plain, 2)
    assert plain.objects.saving.named(str(tmp_path / "mine"))
    file = read_scene_file(tmp_path / "mine.scene.json")
    (item,) = file.items
    assert item.model == "models/ball.ply"  # it can be moved with the folder
    assert [type(selector).__name__ for selector in item.selectors] == ["Sphere"]
    run_frames(plain, 1)
    assert "mine.scene.json" in plain.window.title
    again = read_files([tmp_path / "mine.scene.json"], None, CameraReading(), lambda *_: None)
    np.testing.assert_allclose(again.sources[0].model.means, ball(50).means, atol=1e-6)


def test_closing_and_opening_ask_before_something_is_lost(viewer, tmp_path):
    assert viewer.may_close()
    viewer.state.chosen = "ball"
    viewer.objects.edits.delete()
    run_frames(viewer, 1)
    assert viewer.window.title.startswith("* touch.scene.json")
    assert viewer.objects.status() == "not saved"
    assert not viewer.may_close() and not viewer.window.closing
    run_frames(viewer, 3)
    key(viewer, glfw.KEY_ESCAPE)
    run_frames(viewer, 2)
    assert not viewer.objects.saving.asking
    (tmp_path / "ball.shift").write_bytes(b"")
    viewer.open_soon((tmp_path / "ball.shift",))
    until_opened(viewer)
    assert viewer.objects.saving.asking and "cube" in names(viewer)
    viewer.objects.saving.answer("Do not save")
    run_frames(viewer, 2)
    assert names(viewer) == ["ball"] and not viewer.objects.unsaved


def test_a_slider_alone_asks_nothing(viewer):
    steer(viewer.state, 1, 0.5)
    run_frames(viewer, 1)
    assert viewer.objects.status() == "" and viewer.may_close()
    assert viewer.state.edited.file.all_items[1].x == 0.5  # saved when something else is


def test_the_floor_and_the_first_look_are_edits(viewer, tmp_path):
    objects, state = viewer.objects, viewer.state
    first = state.world
    assert objects.edits.edit(edits.ground, -0.2, what="floor")
    assert state.edited.file.floor_y == -0.2 and state.world is not first
    assert state.world.paused and list(state.world.objects) == NAMES
    viewer.viewpoint.camera.turn(0.3, -0.1)
    run_frames(viewer, 60)
    begin_with(state, viewer.viewpoint.stated())
    eye = viewer.viewpoint.view().world_from_eye.position
    assert state.edited.file.view.eye == pytest.approx(eye, abs=1e-6)
    assert objects.saving.named(str(tmp_path / "a"))
    again = state.first_view((900, 640))
    np.testing.assert_allclose(
        again.world_from_eye.matrix(), viewer.viewpoint.view().world_from_eye.matrix(), atol=1e-4
    )
    key(viewer, glfw.KEY_Z, CTRL)
    key(viewer, glfw.KEY_Z, CTRL)
    assert state.edited.file.floor_y == -0.7 and objects.unsaved


def test_paint_on_what_is_no_file_yet_is_asked_about_and_a_lens_is_not(plain):
    plain.state.toggle_lens()
    run_frames(plain, 1)
    assert not plain.objects.unsaved and plain.may_close()
    plain.state.add_region("sphere")
    run_frames(plain, 1)
    assert plain.objects.unsaved and not plain.may_close()
    plain.objects.saving.answer("Cancel")
    plain.objects.edits.undo()
    assert not plain.objects.unsaved and plain.may_close()


def begin_journal(viewer, folder) -> Journal:
    journal = Journal(viewer.state, folder / "data" / "journals")
    viewer.objects.recovering.begin(journal, viewer.hooks)
    return journal


def press(viewer, widgets, label: str) -> None:
    run_frames(viewer, 3)
    mouse(viewer, *widgets.middle(label))
    button(viewer, True)
    button(viewer, False)
    run_frames(viewer, 3)


def test_what_a_killed_window_has_left_is_offered_and_comes_back(
    window, touch_found, viewer, tmp_path, monkeypatch
):
    viewer.state.bodies.follow = lambda edited: None
    journal, widgets = begin_journal(viewer, tmp_path), Widgets(monkeypatch)
    viewer.state.chosen = "ball"
    viewer.objects.edits.delete()
    run_frames(viewer, 2)
    (left,) = journal.folder.iterdir()
    assert not viewer.objects.recovering.status()
    journal.file.close()  # as a kill does
    again = viewer_of(window, touch_found, tmp_path)
    recovering = again.objects.recovering
    begin_journal(again, tmp_path)
    for answer in ("Later", "Take it back"):
        run_frames(again, 3)
        assert recovering.work is not None
        assert recovering.asked() and names(again) == NAMES and not again.objects.unsaved
        assert recovering.lines(recovering.work)[1] == "delete ball"
        key(again, glfw.KEY_DELETE)  # the box is open: not for the scene
        press(again, widgets, answer)
        if answer == "Later":
            assert left.exists() and not recovering.asked() and names(again) == NAMES
            recovering.opened()
    end = time.monotonic() + 20
    while recovering.work is not None and time.monotonic() < end:
        run_frames(again, 1)
    assert "ball" not in names(again) and again.objects.unsaved
    assert "delete ball" in again.state.messages.note
    (kept,) = journal.folder.iterdir()
    again.objects.edits.undo()
    assert kept != left and names(again) == NAMES
    run_frames(again, 2)
    assert not list(journal.folder.iterdir()), "nothing is unsaved any more"
    recovering.close()
    release(again)


def test_what_is_refused_at_closing_is_not_offered_again(viewer, tmp_path, monkeypatch):
    journal, widgets = begin_journal(viewer, tmp_path), Widgets(monkeypatch)
    viewer.state.chosen = "ball"
    viewer.objects.edits.delete()
    run_frames(viewer, 2)
    assert list(journal.folder.iterdir()) and not viewer.may_close()
    press(viewer, widgets, "Do not save")
    assert viewer.window.closing and viewer.may_close() and not list(journal.folder.iterdir())
    viewer.window.keep_open()
    viewer.objects.recovering.close()
