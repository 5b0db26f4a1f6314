"""File habits: addresses, ~, recent files, what is dropped together, names in any script."""

import json
import os
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.editor.panels.status_line import bytes_text, scene_words
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import repair_notes
from shapeshift.app.editor.state.files.opened import Opener, means_cameras, read_files
from shapeshift.app.editor.state.scene_objects import scene_of
from shapeshift.app.editor.state.user.recent import FILE, MOST, RecentFiles
from shapeshift.app.paths import config_folder, plain, plain_path
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.cameras.write_cameras import write_cameras
from tests.support.scene.camera_files import cameras
from tests.support.splat_scenes import random_layers

NAME = "Möbel 3 ツ/stuhl äöü.ply"


def splats(path: Path, count: int = 40, origin=(0.0, 0.0, 0.0)) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    s = random_layers(count)
    write_ply(PlainSplats(s.means, s.scales, s.wxyz, s.opacity, s.sh, origin), path)
    return path


# Addresses


@pytest.mark.parametrize(
    ("text", "path"),
    [
        ("file:///home/a/b.ply", "/home/a/b.ply"),
        ("file:///home/M%C3%B6bel%203%20%E3%83%84/stuhl.ply", "/home/Möbel 3 ツ/stuhl.ply"),
        ("file://localhost/home/a%20b", "/home/a b"),
        ("file:/home/a.ply", "/home/a.ply"),  # what Path makes of the first
        ("FILE:///A.ply", "/A.ply"),
        ("/home/100%25.ply", "/home/100%25.ply"),  # no address: nothing is decoded
        ("a file: b.ply", "a file: b.ply"),
        ("--out=~/x", "--out=~/x"),
        ("~name.ply", "~name.ply"),
        ("", ""),
    ],
)
def test_an_address_is_a_path(text, path):
    assert plain_path(text, windows=False) == path


def test_addresses_of_windows():
    assert plain_path("file:///C:/M%C3%B6bel/a.ply", windows=True) == "C:/Möbel/a.ply"
    assert plain_path("file:///C:/a.ply", windows=False) == "/C:/a.ply"
    assert plain_path(r"C:\a b\c.ply", windows=True) == r"C:\a b\c.ply"


def test_the_home_is_meant_by_a_wave(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    assert plain("~/a b.ply") == tmp_path / "a b.ply"
    assert plain(Path("~")) == tmp_path


def test_where_settings_are_kept(tmp_path):
    given = {"XDG_CONFIG_HOME": str(tmp_path), "APPDATA": "C:/Roaming"}
    assert config_folder(given, "linux") == tmp_path / "shapeshift"
    assert config_folder(given, "win32") == Path("C:/Roaming") / "shapeshift"
    home = Path(os.path.expanduser("~"))
    for given in ({}, {"XDG_CONFIG_HOME": ""}, {"XDG_CONFIG_HOME": "relative"}):
        assert config_folder(given, "linux") == home / ".config/shapeshift"
    assert config_folder({}, "win32").name == config_folder({}, "darwin").name == "shapeshift"
    assert home / ".config" not in config_folder().parents  # tests keep theirs elsewhere


def test_every_command_takes_any_name(tmp_path, capsys, monkeypatch):
    path = splats(tmp_path / NAME)
    monkeypatch.setenv("HOME", str(tmp_path))
    for given in (str(path), path.as_uri(), f"~/{NAME}"):
        assert cli.main(["info", given, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["splats"] == 40
    out = path.parent / "bilder ß"
    tiny = ["--size", "16x12", "--context", "none", "--drawing", "tiles"]
    assert cli.main(["render", str(path), "--out", str(out), *tiny]) == 0
    with Image.open(next(out.glob("*.png"))) as picture:
        assert picture.size == (16, 12)
    assert cli.main(["lint", str(path)]) == 0
    assert cli.main(["export", str(path), "--out", str(path.parent / "neu ツ.ply")]) == 0
    assert read_model(path.parent / "neu ツ.ply").splat_count == 40
    write_cameras(cameras(), path.parent / "kameras ツ.json", "ours")
    again = path.parent / "ü/neu"
    assert cli.main(["cameras", str(path.parent / "kameras ツ.json"), "--out", str(again)]) == 0
    capsys.readouterr()
    assert cli.main(["cameras", str(again), "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert listed["count"] == 3 and listed["cameras"][1]["name"] == "sub folder/b ä ツ.jpg"


# Cameras as a command


def test_a_conversion_never_writes_over_what_it_reads(tmp_path, capsys):
    path = tmp_path / "cameras.json"
    write_cameras(cameras(), path, "inria")
    write_cameras(cameras(), tmp_path, "colmap-bin")
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}

    def refused(*arguments) -> str:
        assert cli.main(["cameras", *map(str, arguments)]) == 2
        out, err = capsys.readouterr()
        assert not out and len(err.splitlines()) == 1
        return err

    assert "what is read" in refused(path, "--out", path, "--to", "ours", "--overwrite")
    assert "what is read" in refused(tmp_path, "--out", path, "--to", "ours", "--overwrite")
    table = tmp_path / "sparse/0/images.bin"
    over = ("--out", tmp_path, "--to", "colmap-bin", "--overwrite")
    assert "what is read" in refused(table, *over)
    assert "exists" in refused(path, "--out", tmp_path, "--to", "colmap-bin")
    assert "--out" in refused(path, "--to", "ours")
    assert "--fov-y" in refused(path, "--fov-y", 180)
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before
    assert cli.main(["cameras", str(path), *map(str, over)]) == 0  # another's model may be


def test_a_list_for_people_and_one_for_programs(tmp_path, capsys):
    path = tmp_path / "cameras.json"
    write_cameras(cameras(), path, "inria")
    assert cli.main(["cameras", str(path)]) == 0
    out, err = capsys.readouterr()
    assert "3DGS cameras.json, 3 cameras" in out and "a.png" in out and not err


# Recent files


def test_recent_files_are_ten_newest_first_each_once(tmp_path):
    recent = RecentFiles.read(tmp_path / "not" / "there")
    assert recent.paths == ()
    for number in (*range(15), 3):
        recent.add(tmp_path / f"{number} ä.ply")
    assert [path.name for path in recent.paths] == [
        f"{number} ä.ply" for number in (3, *range(14, 5, -1))
    ]
    assert len(recent.paths) == MOST
    assert RecentFiles.read(recent.folder).paths == recent.paths
    recent.clear()
    assert RecentFiles.read(recent.folder).paths == ()


def test_two_windows_share_the_list(tmp_path):
    one, other = RecentFiles.read(tmp_path), RecentFiles.read(tmp_path)
    one.add(tmp_path / "one")
    other.add(tmp_path / "other")
    one.add(tmp_path / "third")
    assert [path.name for path in one.paths] == ["third", "other", "one"]


@pytest.mark.parametrize(
    "data",
    [b"", b"\xff", b"[", b"[" * 99999, b"3", b"[]", b'{"recent": 3}', b'{"recent": [3, null, ""]}',
     b'{"recent": ["a\\u0000b"]}', b" " * (2 << 20)],
    ids=lambda data: str(data[:20]),
)  # fmt: skip
def test_a_broken_list_is_empty_and_written_anew(tmp_path, data):
    (tmp_path / FILE).write_bytes(data)
    recent = RecentFiles.read(tmp_path)
    assert recent.paths == ()
    recent.add(tmp_path / "a")
    assert RecentFiles.read(tmp_path).paths == (tmp_path / "a",)


def test_a_name_that_is_no_text_is_kept(tmp_path):
    path = tmp_path / os.fsdecode(b"st\xfchl.ply")  # Latin-1, as old discs have it
    RecentFiles.read(tmp_path).add(path)
    assert RecentFiles.read(tmp_path).paths == (path,)


# What is dropped together


def read(path: Path, progress):
    return read_model(path)


def silent(what: str, part: float) -> None:
    pass


def test_scenes_and_cameras_are_told_apart_by_what_is_in_them(tmp_path):
    scene = splats(tmp_path / "scene" / "a.ply")
    own = tmp_path / "my views.JSON"
    write_cameras(cameras(), own, "ours")
    model = tmp_path / "model"
    write_cameras(cameras(), model, "colmap-txt")
    for path in (own, model, model / "sparse/0/images.txt"):
        assert means_cameras(path)
    (tmp_path / "meta.json").write_text('{"means": {}}')
    run = tmp_path / "run"
    splats(run / "point_cloud/iteration_7/point_cloud.ply")
    write_cameras(cameras(), run, "colmap-bin")  # trained within its own capture
    for path in (scene, scene.parent, tmp_path / "meta.json", run, tmp_path / "absent.json"):
        assert not means_cameras(path)
    found = read_files([scene, own], read, CameraReading(), silent)
    assert [source.path for source in found.sources] == [scene]
    assert len(found.cameras.views) == 3 and found.floor is None
    assert found.sources[0].facts["splats"] == 40
    only = read_files([model], read, CameraReading(), silent)
    assert only.sources == () and only.cameras.format == "COLMAP text"


def test_cameras_beside_a_scene_come_with_it_unless_others_are_named(tmp_path):
    scene = splats(tmp_path / "a.ply")
    write_cameras(cameras(), tmp_path / "cameras.json", "inria")
    write_cameras(cameras(), tmp_path / "a_vr.json", "vr")
    found = read_files([scene], read, CameraReading(), silent)
    assert found.cameras.format == "3DGS cameras.json" and found.floor is not None
    write_cameras(cameras(), tmp_path / "own.json", "ours")
    found = read_files([scene, tmp_path / "own.json"], read, CameraReading(), silent)
    assert found.cameras.format == "our own list"
    (tmp_path / "cameras.json").write_text("[{")
    found = read_files([scene], read, CameraReading(), silent)
    assert found.cameras is None and "beside it cannot be read" in found.notes[0]
    with pytest.raises(BadFile):  # but one that was named must be good
        read_files([scene, tmp_path / "model" / "images.txt"], read, CameraReading(), silent)


def test_scenes_far_from_zero_stay_where_they_are_to_each_other(tmp_path):
    one = splats(tmp_path / "one.ply", origin=(5e5, 0.0, -2e6))
    other = splats(tmp_path / "other.ply", origin=(5e5 + 3, 1.0, -2e6))
    sources = read_files([one, other], read, CameraReading(), silent).sources
    scene = scene_of(sources)
    places = [
        obj.model.means.astype(np.float64) + obj.world_from_object.position for obj in scene.objects
    ]
    np.testing.assert_allclose(np.median(places[1] - places[0], axis=0), (3, 1, 0), atol=0.25)


def test_the_status_line_says_what_is_open(tmp_path):
    state = EditorState(read_model)
    assert scene_words(state) == ["nothing is open"]
    path = splats(tmp_path / "a.ply", count=1234)
    sources = read_files([path], read, CameraReading(), silent).sources
    state.open_sources(sources, scene_of(sources))
    words = scene_words(state)
    assert words[1:4] == ["1\u2009234 splats", "SH 1", "1 stop"]
    assert words[-1] == bytes_text(path.stat().st_size)
    state.open_sources(sources * 2, scene_of(sources * 2))
    assert scene_words(state)[:2] == ["2 objects", "2\u2009468 splats"]


def test_what_was_repaired_is_told_at_opening(tmp_path):
    path = splats(tmp_path / "a.ply")
    whole = bytearray(path.read_bytes())
    start = whole.index(b"end_header\n") + len(b"end_header\n")
    whole[start : start + 4] = np.float32(np.nan).tobytes()
    path.write_bytes(whole)
    found = read_files([path], read, CameraReading(), silent)
    assert (
        "a.ply" in repair_notes(found)
        and "NaN" in repair_notes(found)
        and "dropped" in repair_notes(found)
    )
    good = read_files([splats(tmp_path / "b.ply")], read, CameraReading(), silent)
    assert repair_notes(good) == ""
    assert repair_notes(replace(found, notes=("A note.",))).endswith("\nA note.")
    many = replace(found, sources=found.sources * 5)
    assert repair_notes(many).splitlines()[-1] == "and 3 more."


def test_bytes_have_three_digits_and_a_unit():
    texts = [bytes_text(n) for n in (0, 999, 1000, 33_878_410, 999_600, 2_148_000_000, 99_960_000)]
    assert texts == ["0 bytes", "999 bytes", "1.0 kB", "33.9 MB", "1.0 MB", "2.1 GB", "100 MB"]


# The thread that reads


def wait(opener: Opener):
    end = time.monotonic() + 30
    while opener.busy and time.monotonic() < end:
        found = opener.poll()
        if found is not None:
            return found
        time.sleep(0.002)
    return None


def test_reading_goes_on_beside_the_window():
    opener, go = Opener(), threading.Event()

    def slow(paths, progress):
        progress("reading a.ply", 0.25)
        assert go.wait(30)
        return paths

    opener.start((Path("a.ply"),), slow)
    while "25%" not in opener.note:
        time.sleep(0.002)
    assert opener.busy and opener.poll() is None
    assert opener.note == "Opening a.ply \u2026 25%"
    go.set()
    assert wait(opener) == (Path("a.ply"),) and not opener.busy and opener.poll() is None


def test_the_last_wish_wins():
    opener, go = Opener(), threading.Event()
    began = []

    def slow(paths, progress):
        began.append(paths[0].name)
        assert go.wait(30)
        return paths

    for name in "abc":
        opener.start((Path(name),), slow)
    go.set()
    assert wait(opener) == (Path("c"),)
    assert began == ["a", "c"]


@pytest.mark.parametrize("error", [BadFile("no"), OSError("no"), ZeroDivisionError("no")])
def test_what_the_reading_raised_is_raised_in_the_window(error):
    def bad(paths, progress):
        raise error

    opener = Opener()
    opener.start((Path("a"),), bad)
    with pytest.raises(type(error), match="no"):
        wait(opener)
    assert not opener.busy
