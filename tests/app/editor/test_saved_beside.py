"""One history for edits of every kind: what is saved beside the scene, what would be lost."""

import json
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state.arrange import redo, undo
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files import saving as saving_module
from shapeshift.app.editor.state.files.beside import open_beside
from shapeshift.app.editor.state.files.journal import Journal
from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import read_files
from shapeshift.app.editor.state.files.saving import LOSE, Saving, unsaved, what_is_lost
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.recovering import Recovering
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.film.film_path import film_beside
from shapeshift.scene.inspection.marks import Mark
from shapeshift.scene.inspection.marks_file import MarksFile, marks_path, read_marks_file
from tests.support.desktop.desktop_stand import ball
from tools.app import journal as tools_journal


def opened(path: Path) -> EditorState:
    found = read_files([path], lambda path, told: read_model(path), CameraReading(), None)
    state = EditorState(read_model)
    scene, edited = opened_scene(found)
    state.open_sources(found.sources, scene, None, edited)
    open_beside(state)
    return state


def saving_of(state: EditorState, folder: Path) -> Saving:
    return Saving(state, OwnFiles(folder / "own"), folder / "scenes", lambda path: None)


def lay(state: EditorState, name: str) -> None:
    file = state.edited.marks
    mark = Mark(name, "spot", np.array([[0.1, 0.2, 0.3]]))
    tool = Inspecting(state)
    tool.edit(MarksFile(marks=(*file.marks, mark)), what=f"add {name}")


@pytest.fixture
def path(tmp_path) -> Path:
    b = ball(50)
    path = tmp_path / "models" / "ball.ply"
    path.parent.mkdir()
    write_ply(PlainSplats(b.means, b.scales, b.wxyz, b.opacity, b.sh), path)
    return path


def test_edits_of_every_kind_are_one_history_named_and_undone_in_order(path):
    state = opened(path)
    lay(state, "Sp1")
    state.add_region("sphere")
    state.record_regions()
    state.timeline.fill(state.document, None)
    state.record_regions()
    state.timeline.fill(state.document, None)  # as many cameras, and other ones
    state.record_regions()
    lay(state, "Sp2")
    lines = ["Regions: sphere 1", "Marks and lengths: Sp1, Sp2", "Film: 9 keys"]
    assert what_is_lost(state) == lines and unsaved(state)
    done = [undo(state) for _ in range(6)]
    around = "way around the scene"
    assert done == ["add Sp2", around, around, "add sphere 1", "add Sp1", ""]
    assert not unsaved(state) and what_is_lost(state) == []
    while redo(state):
        pass
    assert what_is_lost(state) == lines
    assert [mark.name for mark in state.edited.marks.marks] == ["Sp1", "Sp2"]


def test_marks_and_a_film_alone_go_beside_what_is_open(path, tmp_path):
    state = opened(path)
    lay(state, "Sp1")
    state.timeline.at_s = 2.0
    state.timeline.add_stop("0.5")
    saving = saving_of(state, tmp_path)
    assert saving.save() and not saving.asking and not unsaved(state)
    for beside in (marks_path(path), film_beside(path)):
        assert str(beside) in state.messages.note and beside.exists()
    assert sorted(p.name for p in path.parent.iterdir()) == [
        "ball.film.json", "ball.marks.json", "ball.ply",
    ]  # fmt: skip
    again = opened(path)
    assert not unsaved(again) and not again.problem and undo(again) == ""
    assert [mark.name for mark in again.edited.marks.marks] == ["Sp1"]
    assert again.timeline.keys.stops == state.timeline.keys.stops  # without any camera
    again.timeline.clear()
    assert saving_of(again, tmp_path).save() and not opened(path).timeline.keys.stops


def test_a_scene_takes_marks_and_film_along_and_lays_them_over_nobodys(path, tmp_path):
    state = opened(path)
    lay(state, "Sp1")
    state.timeline.fill(state.document, None)
    state.add_region("box")
    saving = saving_of(state, tmp_path)
    scene = tmp_path / "mine.scene.json"
    theirs = marks_path(scene)
    theirs.write_text(json.dumps({"shapeshift_marks": 1, "marks": []}))
    assert not saving.named(str(scene)) and "somebody else" in state.problem
    assert not scene.exists() and unsaved(state) and len(read_marks_file(theirs).marks) == 0
    theirs.unlink()
    assert saving.named(str(scene)) and not unsaved(state)
    again = opened(scene)
    assert len(again.timeline.keys.cameras) == 9 and len(again.edited.marks.marks) == 1
    # Saved over it: what lay beside the scene that goes, goes with it.
    other = opened(path)
    other.add_region("sphere")
    saving = saving_of(other, tmp_path)
    assert not saving.named(str(scene)) and saving.taken
    assert saving.named(str(scene), replace=True)
    again = opened(scene)
    assert not again.timeline.keys.cameras and not again.edited.marks.marks and not again.problem


def test_what_cannot_be_read_beside_is_said_and_left_alone(path, tmp_path):
    marks_path(path).write_text("no marks")
    state = opened(path)
    assert "ball.marks.json" in state.problem and not unsaved(state)
    lay(state, "Sp1")
    assert not saving_of(state, tmp_path).save() and unsaved(state)
    assert "cannot be read" in state.problem and marks_path(path).read_text() == "no marks"


def test_refusing_to_save_is_asked_once_and_told(path, tmp_path):
    state = opened(path)
    saving, told = saving_of(state, tmp_path), []
    saving.refused = lambda: told.append("refused")
    saving.before_losing(lambda: told.append("at once"))
    lay(state, "Sp1")
    saving.before_losing(lambda: told.append("then"))
    assert saving.asking and told == ["at once"]
    saving.answer("Cancel")
    assert not saving.asking and told == ["at once"]
    saving.before_losing(lambda: told.append("then"))
    saving.answer(LOSE)
    assert told == ["at once", "refused", "then"]


class Killed(BaseException):
    """The process ends here."""


@pytest.mark.parametrize("at", ["before", "not ours yet", "half", "all"])
def test_a_kill_amid_saving_is_no_work_of_somebody_else(tmp_path, monkeypatch, at):
    """Scene, list of own files, marks are written in this order; `at`: what there is of it."""
    scene = tools_journal.write_scene(tmp_path / "scene")
    state = tools_journal.open_state(scene)
    journal = Journal(state, tmp_path / "data")
    saving = tools_journal.saving_of(state, scene.parent)
    journal.opened()
    saving.begins = journal.begin_saving
    lay(state, "Sp1")
    tools_journal.Work(state, scene.parent, np.random.default_rng(0)).place()
    done = tools_journal.described(state)

    def ends(*_) -> None:
        raise Killed

    places = {
        "before": (saving_module, "write_whole"), "not ours yet": (saving, "own"),
        "half": (saving_module, "write_beside"),
    }  # fmt: skip
    with monkeypatch.context() as killed, suppress(Killed):
        if at in places:
            killed.setattr(*places[at], ends)
        saving.save()  # nothing was kept before it: the same frame has the edit
    journal.file.close()  # as a kill does: the locks are gone, the files stay
    again = tools_journal.open_state(scene)
    its = tools_journal.saving_of(again, scene.parent)
    recovering = Recovering(again, its, lambda scene: None, lambda: None)
    recovering.begin(Journal(again, journal.folder), Hooks())
    try:
        if at == "all":
            assert recovering.work is None and not [*journal.folder.glob("*.journal")]
            assert again.messages.note.endswith("work.scene.json, work.marks.json.")
        else:
            assert recovering.work is not None
            said = "\n".join(recovering.lines(recovering.work))
            assert "somebody else" not in said
            assert ("work.scene.json has it already, work.marks.json not yet" in said) == (
                at != "before"
            )
            recovering.answer("Take it back")
        assert tools_journal.described(again) == done and not again.problem
        assert (at == "all") != unsaved(again)
        assert its.in_place and (at == "all" or its.save()) and not its.asking
    finally:
        recovering.close()
