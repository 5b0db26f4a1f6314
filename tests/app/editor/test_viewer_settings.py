"""What the viewer keeps between starts: the size of the text, whose files are one's own."""

import json

import pytest

from shapeshift.app.editor.state.user.own_files import MOST, OwnFiles
from shapeshift.app.editor.state.user.settings import (
    TEXT_SIZES,
    ProgramSettings,
    default_text_size,
    other_text_size,
)
from shapeshift.app.paths import ASSETS, DEMO, TOUCH, WorkFolders, is_bundled


def test_settings_come_back(tmp_path):
    settings = ProgramSettings.read(tmp_path / "config")
    assert (settings.text_size, settings.panel_open) == (None, None)
    settings.text_size, settings.panel_open = 1.5, False
    settings.keep()
    again = ProgramSettings.read(tmp_path / "config")
    assert (again.text_size, again.panel_open) == (1.5, False)
    assert [path.name for path in (tmp_path / "config").iterdir()] == ["settings.json"]


@pytest.mark.parametrize(
    "text",
    [
        "", "nonsense", "[]", "7", "null", '{"text_size": "big", "panel_open": 1}', "[" * 10**5,
        '{"text_size": true}', '{"text_size": NaN}', '{"text_size": 1e9}', '{"text_size": 0.7}',
        '{"text_size": -Infinity}', " " * 70_000,
    ],
)  # fmt: skip
def test_what_is_no_setting_counts_as_none(tmp_path, text):
    (tmp_path / "settings.json").write_text(text)
    assert ProgramSettings.read(tmp_path) == ProgramSettings(tmp_path)


def test_without_a_folder_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ProgramSettings(None, 1.5).keep()
    OwnFiles().wrote(tmp_path / "a", (1, 2))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("high_px", "high_mm", "scale", "wanted"),
    [
        (1080, 296, 1.0, 1.0),  # 24 inches
        (2160, 336, 1.0, 1.5),  # 27 inches, and no scale set
        (2160, 336, 2.0, 1.0),  # the same with the desktop set to 200 %
        (2160, 336, 1.5, 1.0),
        (2160, 0, 1.0, 1.5),  # a monitor that does not say how large it is
        (2160, 1, 1.0, 1.5),  # or says nonsense, as projectors do
        (2160, 571, 1.0, 1.5),  # a television: by its pixels
        (1440, 336, 1.0, 1.0),
        (1600, 190, 1.0, 2.0),  # a laptop with 214 pixels an inch
        (720, 190, 1.0, 1.0), (0, 0, 1.0, 1.0), (4320, 0, 1.0, 3.0),
    ],
)  # fmt: skip
def test_the_size_of_the_text_follows_the_monitor(high_px, high_mm, scale, wanted):
    assert default_text_size(high_px, high_mm, scale) == wanted


def test_sizes_go_up_and_down_and_end():
    size, seen = TEXT_SIZES[0], []
    for _ in range(len(TEXT_SIZES) + 2):
        seen.append(size)
        size = other_text_size(size, 1)
    assert tuple(seen[: len(TEXT_SIZES)]) == TEXT_SIZES and seen[-1] == TEXT_SIZES[-1]
    assert other_text_size(TEXT_SIZES[0], -1) == TEXT_SIZES[0]
    assert other_text_size(1.3, -1) == 1.25 and other_text_size(1.3, 1) == 1.5


# Whose files are one's own


def test_a_file_is_ones_own_until_somebody_else_writes_it(tmp_path):
    own, path = OwnFiles(tmp_path / "config"), tmp_path / "a.scene.json"
    assert not own.has(path, (1, 2)) and not own.has(path, ())
    own.wrote(path, (1, 2))
    for files in (own, OwnFiles(tmp_path / "config")):  # also after the next start
        assert files.has(path, (1, 2)) and not files.has(path, (1, 3))
        assert not files.has(tmp_path / "b.scene.json", (1, 2)) and not files.has(path, ())


def test_two_windows_do_not_forget_each_others_files(tmp_path):
    one, other = OwnFiles(tmp_path), OwnFiles(tmp_path)
    one.wrote(tmp_path / "a", (1, 1))
    other.wrote(tmp_path / "b", (2, 2))
    assert OwnFiles(tmp_path).has(tmp_path / "a", (1, 1))
    assert OwnFiles(tmp_path).has(tmp_path / "b", (2, 2))


def test_the_oldest_are_forgotten(tmp_path):
    own = OwnFiles()
    for number in range(MOST + 1):
        own.wrote(tmp_path / str(number), (number, 1))
    assert not own.has(tmp_path / "0", (0, 1))
    assert own.has(tmp_path / "1", (1, 1)) and own.has(tmp_path / str(MOST), (MOST, 1))


@pytest.mark.parametrize(
    "text",
    [
        "", "{}", '{"saved": 3}', '{"saved": [1, null, {}]}', "[" * 10**5,
        '{"saved": [{"path": 3, "stamp": [1]}, {"path": "/a", "stamp": "x"}]}',
        '{"saved": [{"path": "/a", "stamp": [true]}, {"path": "/a", "stamp": [1.5]}]}',
    ],
)  # fmt: skip
def test_a_broken_list_is_empty(tmp_path, text):
    (tmp_path / "saved.json").write_text(text)
    own = OwnFiles(tmp_path)
    own.wrote(tmp_path / "a", (1, 2))
    rows = json.loads((tmp_path / "saved.json").read_text())["saved"]
    assert rows == [{"path": str(tmp_path / "a"), "stamp": [1, 2]}]


# Where one's work goes


def test_work_goes_to_the_documents_and_is_told_absolutely(tmp_path, monkeypatch):
    monkeypatch.setattr("platformdirs.user_documents_path", lambda: tmp_path / "Documents")
    folders = WorkFolders.of()
    assert folders.pictures == tmp_path / "Documents" / "Shapeshift" / "pictures"
    assert folders.scenes.parent == folders.exports.parent == folders.pictures.parent
    assert not (tmp_path / "Documents").exists()  # before something is written
    monkeypatch.chdir(tmp_path)
    named = WorkFolders.of(DEMO.relative_to(DEMO.parents[1]))
    assert all(path.is_absolute() for path in (named.pictures, named.scenes, named.exports))
    assert named.pictures.parent == tmp_path / "assets"


def test_what_came_with_the_program_is_known_through_links(tmp_path):
    link = tmp_path / "link"
    link.symlink_to(ASSETS)
    for path in (DEMO, ASSETS, ASSETS / "new.scene.json", link / TOUCH.name):
        assert is_bundled(path)
    assert not is_bundled(tmp_path / TOUCH.name)
    assert not is_bundled(ASSETS.parent / "mine.scene.json")
    assert not is_bundled(ASSETS / ".." / "mine.scene.json")
