"""What is done in a headset is kept as on a desk, and offered at the next start of either."""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.left_work import left_work
from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import read_files
from shapeshift.app.editor.state.object_edits import ObjectEdits
from shapeshift.app.headset import worn_journal
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.headset.worn_journal import WornJournal
from shapeshift.app.opening import ReadingOptions
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from shapeshift.scene.document.write_scene_file import write_scene_file
from shapeshift.scene.pose import Pose
from tests.support.desktop.desktop_stand import ball

AT = np.array([0.3, 0.7, -0.2])


@pytest.fixture
def scene(tmp_path, monkeypatch) -> Path:
    """Two balls in the air, nothing falls, no body: hands are played by `move_object`."""
    monkeypatch.setattr(worn_journal, "EVERY_S", 0.0)
    write_ply(ball(), tmp_path / "ball.ply")
    items = tuple(SceneItem(name=name, model="ball.ply", collider=None) for name in ("a", "b"))
    path = tmp_path / "balls.scene.json"
    write_scene_file(SceneFile(folder=tmp_path, items=items, gravity_m_s2=0.0), path)
    return path


def worn(scene: Path) -> EditorState:
    return open_xr(scene, ReadingOptions())[1]


def carry(editor: EditorState, name: str, pose: Pose) -> None:
    editor.bodies.living.move_object(name, pose)
    editor.follow_world()


def place_of(editor: EditorState, name: str) -> np.ndarray:
    return next(o.world_from_object.position for o in editor.scene.objects if o.name == name)


def test_a_grab_and_an_edit_come_back_in_the_headset_and_are_offered_at_the_desk(scene, tmp_path):
    folder, editor = tmp_path / "journals", worn(scene)
    with WornJournal(editor, folder) as journal:
        assert not journal.offers
        journal.each_frame()
        assert not list(folder.glob("*")), "nothing was done"
        ObjectEdits(editor, None, lambda: None).edit(edits.hide, "b", what="hide b")
        carry(editor, "a", Pose(AT, np.array([1.0, 0, 0, 0])))
        journal.each_frame()
        kept = list(folder.iterdir())
    assert kept and list(folder.iterdir()) == kept, "leaving is no refusal"

    opened = read_files([scene], lambda path, told: read_model(path), CameraReading(), None)
    desk = EditorState(read_model)
    shown, edited = opened_scene(opened)
    desk.open_sources(opened.sources, shown, None, edited)
    work = left_work(desk, folder, [])
    assert work is not None and work.deeds == ["keep as it stands", "hide b"]
    work.file.close()

    again = worn(scene)
    with WornJournal(again, folder) as journal:
        assert journal.offers and "panel" in again.messages.note
        journal.answer("Take it back")
        while journal.offers or not np.allclose(place_of(again, "a"), AT, atol=1e-6):
            journal.each_frame()
        assert [o.visible for o in again.scene.objects] == [True, False]
        assert again.edited.history.undoes == "keep as it stands" and again.edited.unsaved


def test_what_is_put_back_or_discarded_leaves_nothing(scene, tmp_path):
    folder, editor = tmp_path / "journals", worn(scene)
    start = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
    with WornJournal(editor, folder) as journal:
        carry(editor, "a", Pose(AT, start.wxyz))
        journal.each_frame()
        assert list(folder.iterdir())
        carry(editor, "a", start)
        journal.each_frame()
        assert not list(folder.iterdir())
        carry(editor, "b", Pose(AT, start.wxyz))
    with WornJournal(worn(scene), folder) as journal:
        journal.answer("Later")
        assert not journal.offers
    with WornJournal(worn(scene), folder) as journal:
        journal.answer("Discard")
    assert not list(folder.iterdir())


def test_our_own_scenes_are_played_with_and_a_measured_run_keeps_nothing(
    scene, tmp_path, monkeypatch
):
    folder = tmp_path / "journals"
    for bundled, where in ((True, folder), (False, None)):
        monkeypatch.setattr(worn_journal, "is_bundled", lambda path, bundled=bundled: bundled)
        editor = worn(scene)
        with WornJournal(editor, where) as journal:
            carry(editor, "a", Pose(AT, np.array([1.0, 0, 0, 0])))
            journal.each_frame()
        assert not folder.exists() or not list(folder.iterdir())
