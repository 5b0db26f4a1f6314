"""Edits of a scene file: each gives another file, and all can be undone."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.scene.appearance import Appearance, Sky
from shapeshift.scene.document import edits
from shapeshift.scene.document.edits import Change, History, changes
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import BACKGROUND, FirstView, SceneFile, SceneItem
from shapeshift.scene.document.write_scene_file import write_scene_file
from shapeshift.scene.pose import Pose

ROOT = Path(__file__).resolve().parents[3]
TURN = round(math.sqrt(0.5), 9)


@pytest.fixture
def file() -> SceneFile:
    return read_scene_file(ROOT / "examples" / "touch.scene.json")


def names(file: SceneFile) -> list[str]:
    return [item.name for item in file.all_items]


def test_a_file_is_edited_and_nothing_else_is_touched(file):
    moved = edits.set_pose(file, "ball", Pose(np.array([1.0, 2, 3]), np.array([TURN, TURN, 0, 0])))
    ball = edits.find(moved, "ball")
    assert (ball.position, ball.wxyz) == ((1, 2, 3), (TURN, TURN, 0, 0))
    assert replace(ball, position=(0, 0.061, -0.12), wxyz=(1, 0, 0, 0)) == edits.find(file, "ball")
    for name in names(file):
        assert (edits.find(moved, name) is edits.find(file, name)) == (name != "ball")
    assert edits.find(edits.set_x(file, "cube", 0.25), "cube").x == 0.25
    assert not edits.find(edits.hide(file, BACKGROUND), BACKGROUND).visible
    assert edits.hide(file, "ball", hidden=False) is file  # it is to be seen already
    assert edits.set_pose(moved, "ball", ball.pose) is moved


def test_copies_stand_behind_the_original_under_a_free_name(file):
    twice = edits.duplicate(file, "ball", (0.1, 0, 0))
    assert names(twice) == [BACKGROUND, "cube", "ball", "ball 2", "ring", "plate"]
    copy, ball = edits.find(twice, "ball 2"), edits.find(twice, "ball")
    assert copy.position == (0.1, 0.061, -0.12)
    assert replace(copy, name="ball", position=ball.position) == ball
    thrice = edits.duplicate(twice, "ball 2", (0, 0, 0))
    assert names(thrice)[2:5] == ["ball", "ball 2", "ball 3"]
    table = edits.duplicate(file, BACKGROUND, (0, 1, 0))
    assert names(table)[-1] == "background 2" and table.background is file.background


def test_removing_and_adding(file):
    fewer = edits.remove(edits.remove(file, "cube"), BACKGROUND)
    assert names(fewer) == ["ball", "ring", "plate"] and fewer.background is None
    more = edits.add(fewer, SceneItem(name="ball", model="x.ply"))
    assert names(more) == ["ball", "ring", "plate", "ball 2"]
    assert names(edits.add(SceneFile(folder=Path()), SceneItem(name=BACKGROUND, model="x"))) == [
        "background 2"
    ]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("ball", "cube", "taken"),
        ("ball", BACKGROUND, "background"),
        (BACKGROUND, "table", "always called"),
        ("ball", "  ", "1 to 100"),
        ("ball", "x" * 101, "1 to 100"),
        ("ball", "a\x00b", "1 to 100"),
        ("nobody", "x", "no object"),
    ],
)
def test_a_name_that_cannot_be_is_refused(file, before, after, words):
    with pytest.raises(ValueError, match=words):
        edits.rename(file, before, after)


def test_a_name_on_several_lines_becomes_one(file):
    assert names(edits.rename(file, "ball", " a\n b  c "))[2] == "a b c"
    assert edits.rename(file, "ball", "ball ") is file


@pytest.mark.parametrize("x", [-0.01, 1.01, math.nan])
def test_x_beyond_its_range_is_refused(file, x):
    with pytest.raises(ValueError, match="0 to 1"):
        edits.set_x(file, "ball", x)


@pytest.mark.parametrize("metres", [2e4, math.nan, math.inf])
def test_a_place_out_of_reach_is_refused(file, metres):
    with pytest.raises(ValueError, match="farther"):
        edits.set_pose(file, "ball", Pose(np.array([0, metres, 0]), np.array([1.0, 0, 0, 0])))


def test_a_full_file_takes_no_more():
    items = tuple(SceneItem(name=f"a {n}", model="a.ply") for n in range(edits.MOST_OBJECTS))
    with pytest.raises(ValueError, match="most"):
        edits.add(SceneFile(folder=Path(), items=items), SceneItem(name="b", model="a.ply"))


def test_what_changed(file):
    assert changes(file, file) == []
    ball = edits.find(file, "ball")
    gone = edits.remove(file, "ball")
    assert changes(file, gone) == [Change(ball, None)]
    assert changes(gone, file) == [Change(None, ball)]
    renamed = edits.rename(file, "ball", "globe")
    (change,) = changes(file, renamed)
    assert (change.before.name, change.after.name, change.fields) == ("ball", "globe", {"name"})
    many = edits.set_x(edits.hide(edits.remove(file, "cube"), "ring"), "ring", 0.1)
    one, two = changes(file, many)
    assert (one.before.name, one.after) == ("cube", None)
    assert two.fields == {"x", "visible"}
    assert [c.fields for c in changes(many, file)] == [{"x", "visible"}, set()]


def test_what_is_edited_reads_as_it_was_written(file, tmp_path):
    file = edits.duplicate(edits.set_x(file, "ring", 0.3), "ring", (0, 0.1, 0))
    file = edits.rename(edits.hide(file, "plate"), "plate", "Teller \u00e4")
    write_scene_file(file, tmp_path / "a.scene.json")
    again = read_scene_file(tmp_path / "a.scene.json")
    assert names(again) == names(file)
    for item, read in zip(file.all_items, again.all_items, strict=True):
        assert (tmp_path / read.model).resolve() == (file.folder / item.model).resolve()
        assert replace(read, model=item.model, collider=item.collider) == item


def test_on_another_drive_paths_become_whole(file, tmp_path, monkeypatch):
    def no_way(path, start):
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr("os.path.relpath", no_way)
    write_scene_file(file, tmp_path / "a.scene.json")
    monkeypatch.undo()
    again = read_scene_file(tmp_path / "a.scene.json")
    assert [Path(item.model).is_absolute() for item in again.items] == [True] * 4
    assert Path(again.items[0].model) == ROOT / "examples" / "touch" / "cube"


def test_the_scene_s_own_edits(file):
    assert edits.ground(file, None).floor_y is None and edits.ground(file, -0.7) is file
    with pytest.raises(ValueError, match="floor"):
        edits.ground(file, math.nan)
    view = edits.rounded(FirstView((0.1, 0.2, 1 / 3), (0, 0, 0), 0.8, True, 0.25))
    assert view == FirstView((0.1, 0.2, 0.333333), (0, 0, 0), 0.8, True, 0.25)
    assert edits.look_from(file, view).view == view
    with pytest.raises(ValueError, match="straight"):
        edits.look_from(file, FirstView((0, 1, 0), (0, 0, 0)))
    sky = Sky((0, 0, 1), (1, 1, 1), (0.2, 0.2, 0.2))
    assert edits.set_sky(file, sky).sky == sky and edits.set_sky(file, None) is file
    look = Appearance(exposure=1.0)
    assert edits.set_appearance(file, "", look).appearance == look
    ball = edits.find(edits.set_appearance(file, "ball", look), "ball")
    assert ball.appearance == look and edits.set_appearance(file, "", Appearance()) is file


def test_named_views(file):
    view, other = FirstView((0, 1, 2), (0, 0, 0)), FirstView((3, 1, 2), (0, 0, 0))
    two = edits.keep_view(edits.keep_view(file, view), other)
    assert [(v.name, v.view) for v in two.views] == [("view 1", view), ("view 2", other)]
    named = edits.rename_view(two, "view 2", "  from \n the door ")
    assert [v.name for v in named.views] == ["view 1", "from the door"]
    assert edits.remove_view(named, "view 1").views == named.views[1:]
    # A name that was freed is given again, one that is there never.
    assert edits.keep_view(edits.remove_view(two, "view 1"), view).views[1].name == "view 1"
    for bad in ("", "view 1", "x" * 101):
        with pytest.raises(ValueError):
            edits.rename_view(two, "view 2", bad)
    with pytest.raises(ValueError, match="straight"):
        edits.keep_view(file, FirstView((0, 1, 0), (0, 0, 0)))
    for _ in range(98):
        two = edits.keep_view(two, view)
    with pytest.raises(ValueError, match="100 named views"):
        edits.keep_view(two, view)


# History


def test_undo_and_redo_walk_the_same_files(file):
    history, files = History.of(file), [file]
    for number in range(5):
        files.append(edits.set_x(files[-1], "ball", (number + 1) / 10))
        history = history.record(files[-1], f"edit {number}")
    assert history.undoes == "edit 4" and history.redoes == ""
    for number in range(4, -1, -1):
        history = history.undo()
        assert history.file is files[number]
    assert history.undo().file is file and history.undoes == "" and history.redoes == "edit 0"
    for number in range(1, 6):
        history = history.redo()
        assert history.file is files[number]
    assert history.redo().file is files[-1]
    back = history.undo().undo()
    other = edits.hide(back.file, "cube")
    after = back.record(other, "hide")
    assert after.redoes == "" and after.undoes == "hide" and after.undo().file is files[3]
    assert after.record(other, "nothing new") is after


def test_a_drag_is_one_step_until_the_hand_lets_go(file):
    history = History.of(file)
    for x in (0.1, 0.2, 0.3):
        history = history.record(edits.set_x(history.file, "ball", x), "x of ball", "x ball")
    history = history.rest()
    for x in (0.4, 0.5):
        history = history.record(edits.set_x(history.file, "ball", x), "x of ball", "x ball")
    history = history.record(edits.set_x(history.file, "cube", 0.5), "x of cube", "x cube")
    xs = []
    while history.undoes:
        history = history.undo()
        xs.append(edits.find(history.file, "ball").x)
    assert xs == [0.5, 0.3, 0.0]
    assert history.rest() is history


def test_a_long_history_forgets_its_beginning(file):
    history = History.of(file)
    for number in range(edits.MOST_STEPS + 100):
        history = history.record(edits.set_x(history.file, "ball", number % 2 / 2 + 0.1), "x")
    count = 0
    while history.undoes:
        history, count = history.undo(), count + 1
    assert count == edits.MOST_STEPS
