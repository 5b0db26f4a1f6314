"""The journal of what is open: on the disk while something is not saved, and back after a kill."""

import errno
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state import arrange
from shapeshift.app.editor.state.arrange import redo, undo
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files import journal as journal_module
from shapeshift.app.editor.state.files.journal import Journal
from shapeshift.app.editor.state.files.journal_file import entry_line
from shapeshift.app.editor.state.files.left_work import Restoring, left_names, left_work
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.files.saving import LOSE, unsaved, what_is_lost
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.document import edits
from shapeshift.scene.inspection.marks import Mark
from shapeshift.scene.inspection.marks_file import MarksFile, marks_path
from tools.app import journal as tools_journal


def lay(state: EditorState, name: str) -> None:
    file = state.edited.marks
    mark = Mark(name, "spot", np.array([[0.1, 0.2, 0.3]]))
    tool = Inspecting(state)
    tool.edit(MarksFile(marks=(*file.marks, mark)), what=f"add {name}")


def journal_of(state: EditorState, folder: Path) -> Journal:
    journal = Journal(state, folder / "data" / "journals")
    journal.opened()
    return journal


def files_in(folder: Path) -> list[Path]:
    return sorted((folder / "data" / "journals").glob("*.journal"))


@pytest.fixture
def scene(tmp_path) -> Path:
    return tools_journal.write_scene(tmp_path / "scene")


@pytest.fixture
def worked(scene, tmp_path):
    """(state, journal) after a hundred edits of every kind that were not saved."""
    state = tools_journal.open_state(scene)
    journal = journal_of(state, tmp_path)
    work = tools_journal.Work(state, scene.parent, np.random.default_rng(3))
    work.save = lambda: None
    work.cut()
    for _ in range(100):
        work.step()
        state.record_regions()
        state.rest()
        assert not journal.follow(0.0) and not journal.words
    yield state, journal
    journal.close()


def crash(journal: Journal) -> None:
    """As a kill does: the locks are gone, the files stay."""
    journal.file.close()
    journal.file = None


def test_all_of_it_comes_back_with_its_steps(worked, scene, tmp_path):
    state, journal = worked
    said_before, wanted = what_is_lost(state), tools_journal.described(state)
    assert len(files_in(tmp_path)) == 1 and unsaved(state) and state.edited.pieces
    crash(journal)
    again = tools_journal.open_state(scene)
    assert tools_journal.take_back(again, journal.folder)
    assert tools_journal.described(again) == wanted
    assert [line.split(":")[0] for line in what_is_lost(again)] == [
        line.split(":")[0] for line in said_before
    ]
    for _ in range(60):  # its history, too, as far as it goes back and on
        assert undo(again) == undo(state)
        assert tools_journal.described(again) == tools_journal.described(state)
    while what := redo(state):
        assert redo(again) == what
    assert tools_journal.described(again) == tools_journal.described(state)


def test_a_scene_that_is_taken_back_and_undone_is_not_unsaved(scene, tmp_path):
    state = tools_journal.open_state(scene)
    journal = journal_of(state, tmp_path)
    tools_journal.Work(state, scene.parent, np.random.default_rng(0)).place()
    lay(state, "Sp1")
    journal.follow(0.0)
    crash(journal)
    again = tools_journal.open_state(scene)
    tools_journal.take_back(again, journal.folder)
    assert unsaved(again) and undo(again) == "add Sp1" and unsaved(again)
    undo(again)
    assert not unsaved(again)


@pytest.mark.parametrize("how", ["saved", "refused", "undone", "closed"])
def test_the_file_is_there_exactly_while_something_is_not_saved(scene, tmp_path, how):
    state = tools_journal.open_state(scene)
    journal, saving = journal_of(state, tmp_path), tools_journal.saving_of(state, scene.parent)
    saving.refused = journal.refuse
    journal.follow(0.0)
    assert not files_in(tmp_path)
    lay(state, "Sp1")
    journal.follow(0.0)
    assert len(files_in(tmp_path)) == 1
    if how == "saved":
        assert saving.save()
    elif how == "undone":
        undo(state)
    elif how == "refused":
        saving.before_losing(lambda: None)
        saving.answer(LOSE)
        journal.follow(1.0)
        assert not files_in(tmp_path)
    journal.follow(2.0)
    journal.close()
    assert len(files_in(tmp_path)) == (how == "closed")  # nobody was asked: it is kept


def test_a_drag_is_written_twice_a_second_and_at_its_end(scene, tmp_path):
    state = tools_journal.open_state(scene)
    journal, work = journal_of(state, tmp_path), None
    work = tools_journal.Work(state, scene.parent, np.random.default_rng(0))
    sizes = []
    for frame in range(100):  # a second of them
        work.place()
        journal.follow(frame / 100)
        sizes.append(files_in(tmp_path)[0].stat().st_size)
    assert len(set(sizes)) == 3  # at 0, 0.4 and 0.8 s
    assert journal.follow(1.0), "it asks for a frame to be written in"
    state.rest()
    assert not journal.follow(1.0) and files_in(tmp_path)[0].stat().st_size > sizes[-1]


def test_two_windows_on_one_scene_keep_two_files_and_offer_none_of_the_other(scene, tmp_path):
    one, two = tools_journal.open_state(scene), tools_journal.open_state(scene)
    journals = journal_of(one, tmp_path), journal_of(two, tmp_path)
    lay(one, "First")
    lay(two, "Second")
    for journal in journals:
        journal.follow(0.0)
    assert len(files_in(tmp_path)) == 2
    third = tools_journal.open_state(scene)
    assert left_work(third, journals[0].folder, []) is None, "both live"
    crash(journals[0])
    assert tools_journal.take_back(third, journals[0].folder)
    assert [mark.name for mark in third.edited.marks.marks] == ["First"]
    assert left_names(tools_journal.open_state(scene.parent / "cloud.ply"), journals[0].folder) == [
        str(scene)
    ]
    journals[1].refuse()
    assert len(files_in(tmp_path)) == 1


def test_another_scene_is_offered_nothing(scene, tmp_path):
    state = tools_journal.open_state(scene)
    journal = journal_of(state, tmp_path)
    lay(state, "Sp1")
    journal.follow(0.0)
    crash(journal)
    other = tools_journal.open_state(scene.parent / "cloud.ply")
    assert left_work(other, journal.folder, []) is None and files_in(tmp_path)


def last_line(data: bytes) -> int:
    """Where the last entry begins."""
    return data.rindex(b"\n", 0, -1) + 1


def test_a_torn_tail_is_left_out_and_told(worked, scene, tmp_path):
    state, journal = worked
    lay(state, "Last")
    journal.follow(0.0)
    crash(journal)
    (file,) = files_in(tmp_path)
    data = file.read_bytes()
    start = last_line(data)
    tails = [data[start:end] for end in (start + 1, start + 2, start + 9, len(data) - 1)]
    for tail in [*tails, b"\0" * 100, data[start:-40] + b"\0" * 40]:
        file.write_bytes(data[:start] + tail)
        problems: list[str] = []
        again = tools_journal.open_state(scene)
        work = left_work(again, journal.folder, problems)
        assert work is not None and not problems and work.torn == len(tail)
        Restoring(again, work).take_back({})
        assert "Last" not in [mark.name for mark in again.edited.marks.marks]
        assert len(again.edited.marks.marks) == len(state.edited.marks.marks) - 1
        work.file.close()


HURT = {
    "a byte in the midst": (lambda d: d[:300] + bytes([d[300] ^ 1]) + d[301:], "damaged at byte"),
    "another version": (lambda d: d.replace(b"1 ", b"2 ", 1), "of version 2"),
    "a text": (lambda d: b"Dear diary,\n" + d, "no journal"),
    "no journal": (lambda d: b"\x89PNG\r\n\x1a\n" * 10, "no journal"),
    "an entry is gone": (lambda d: d[: d.index(b"\n") + 1] + d[last_line(d) :], "no row"),
    "a list": (lambda d: entry_line([1]) * 3, "is none"),  # type: ignore[arg-type]
    "no numbers": (lambda d: entry_line({}) + entry_line({"at": -1, "last": 0}), "'at'"),
    "no such step": (lambda d: entry_line({}) + entry_line({"at": 1, "last": 3}), "step"),
}  # fmt: skip


@pytest.mark.parametrize("how", HURT)
def test_a_damaged_one_or_one_of_another_version_is_put_aside_and_said(
    worked, scene, tmp_path, how
):
    _, journal = worked
    crash(journal)
    (file,) = files_in(tmp_path)
    hurt, words = HURT[how]
    file.write_bytes(hurt(file.read_bytes()))
    problems: list[str] = []
    again = tools_journal.open_state(scene)
    work = left_work(again, journal.folder, problems)
    if work is not None:  # whole entries, of which one is missing
        with pytest.raises(BadFile, match=words):
            Restoring(again, work)
        work.file.close()
        return
    (problem,) = problems
    (aside,) = (journal.folder / "aside").iterdir()
    assert words in problem and str(aside) in problem and not files_in(tmp_path)
    assert not unsaved(again)


def test_an_empty_one_is_of_nobody(worked, scene, tmp_path):
    _, journal = worked
    crash(journal)
    (file,) = files_in(tmp_path)
    for data in (b"", b"1", b"1 20", file.read_bytes()[:40]):
        file.write_bytes(data)
        problems: list[str] = []
        assert left_work(tools_journal.open_state(scene), journal.folder, problems) is None
        assert not problems and not file.exists()


def no_room(*_) -> int:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def no_entry(*_, **named) -> None:
    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


REFUSALS = {"full": ("write", no_room, "No space left"), "read-only": ("mkdir", no_entry, "denied")}


@pytest.mark.parametrize("kind", REFUSALS)
def test_what_cannot_be_kept_is_said_until_it_can_and_work_goes_on(
    scene, tmp_path, kind, monkeypatch
):
    name, refuse, words = REFUSALS[kind]
    state = tools_journal.open_state(scene)
    journal = journal_of(state, tmp_path)
    if kind == "full":
        lay(state, "Sp0")
        journal.follow(0.0)
    with monkeypatch.context() as patch:
        if kind == "full":
            patch.setattr(os, name, refuse)
        else:
            patch.setattr(Path, name, refuse)
        lay(state, "Sp1")
        assert not journal.follow(1.0)
        assert words in journal.words and "Ctrl+S" in state.problem
        state.problem = ""
        lay(state, "Sp2")
        journal.follow(2.0)
        assert words in journal.words and not state.problem  # said once, shown as long as it is so
    assert len(files_in(tmp_path)) == (kind == "full")
    journal.follow(3.5)
    assert journal.words == "" and len(files_in(tmp_path)) == 1
    crash(journal)
    again = tools_journal.open_state(scene)
    tools_journal.take_back(again, journal.folder)
    assert again.edited.marks.marks[-1].name == "Sp2"
    assert tools_journal.saving_of(state, scene.parent).save()


def test_a_folder_that_somebody_takes_away_is_made_anew(worked, scene, tmp_path):
    state, journal = worked
    shutil.rmtree(journal.folder.parent)
    lay(state, "Last")
    journal.follow(0.0)
    assert not journal.words and "anew" in state.messages.note
    crash(journal)
    again = tools_journal.open_state(scene)
    tools_journal.take_back(again, journal.folder)
    assert tools_journal.described(again) == tools_journal.described(state)


def test_a_file_that_was_written_since_is_not_laid_over(scene, tmp_path):
    state = tools_journal.open_state(scene)
    journal = journal_of(state, tmp_path)
    lay(state, "Mine")
    tools_journal.Work(state, scene.parent, np.random.default_rng(0)).place()
    journal.follow(0.0)
    crash(journal)
    theirs = tools_journal.open_state(scene)
    arrange.edit(theirs, edits.ground(theirs.edited.file, -1.0), "floor")
    lay(theirs, "Theirs")
    assert tools_journal.saving_of(theirs, scene.parent).save()
    before = scene.read_bytes(), marks_path(scene).read_bytes()
    again = tools_journal.open_state(scene)
    work = left_work(again, journal.folder, [])
    assert work is not None and work.stamp != again.edited.stamp
    assert again.edited.file.floor_y == -1.0, "the file as it is, until somebody chooses"
    Restoring(again, work).take_back({})
    work.file.close()
    assert again.edited.file.floor_y is None
    saving = tools_journal.saving_of(again, scene.parent)
    assert not saving.save() and saving.asking
    assert not saving.named(str(scene)) and saving.taken
    assert (scene.read_bytes(), marks_path(scene).read_bytes()) == before


def test_models_that_came_and_went_are_read_again(scene, tmp_path):
    """An object that was added is there; of one whose file is gone the steps are left out."""
    other = scene.parent / "other.ply"
    shutil.copy(scene.parent / "cloud.ply", other)
    state = tools_journal.open_state(scene)
    journal = journal_of(state, tmp_path)
    source = Source(other, read_model(other))
    arrange.edit(state, edits.add(state.edited.file, state.edited.item(source)), "add other")
    lay(state, "Sp1")
    journal.follow(0.0)
    crash(journal)
    again = tools_journal.open_state(scene)
    assert tools_journal.take_back(again, journal.folder) and len(again.scene.objects) == 2
    other.unlink()
    again = tools_journal.open_state(scene)
    with pytest.raises(BadFile, match=r"other\.ply"):
        tools_journal.take_back(again, journal.folder)
    assert len(again.scene.objects) == 1 and not unsaved(again) and files_in(tmp_path)


def test_a_large_file_begins_anew_and_loses_nothing(worked, scene, tmp_path, monkeypatch):
    state, journal = worked
    (file,) = files_in(tmp_path)
    size = file.stat().st_size
    monkeypatch.setattr(journal_module, "LARGEST", size - 1)
    lay(state, "Last")
    journal.follow(0.0)
    (file,) = files_in(tmp_path)
    assert file.stat().st_size < size
    crash(journal)
    again = tools_journal.open_state(scene)
    tools_journal.take_back(again, journal.folder)
    assert tools_journal.described(again) == tools_journal.described(state)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the work is done in a fork")
def test_killed_in_the_midst_nothing_older_than_a_second_is_missing(tmp_path):
    """A short sample of tools/app/journal.py; its row in docs/bench has five hundred."""
    found = tools_journal.kills(4, 11, tmp_path)
    assert max(late for late, _ in found) <= tools_journal.LIMIT_S
