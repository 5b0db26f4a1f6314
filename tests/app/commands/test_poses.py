"""poses: as a person starts it, on photos and on a video of a traced room; its refusals."""

import contextlib
import json
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("pycolmap", reason="pycolmap is not installed")

from shapeshift.app import cli
from shapeshift.app.commands.poses import Options, frames_of, parse_length, refuse_target
from shapeshift.app.errors import UsageError
from shapeshift.decomposition.poses import write_posed
from shapeshift.decomposition.poses.colmap_run import clear_others
from shapeshift.decomposition.poses.find_poses import PoseSettings, describe, start_job
from shapeshift.decomposition.poses.photo_list import list_photos
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.program import ROOT, assert_refused, launch
from tests.support.scene.textured_room import camera, photo, write_photos


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("poses") / "photos"
    write_photos(folder, 6)
    return folder


def poses(*arguments):
    return cli.main(["poses", *map(str, arguments)])


def test_photos_become_a_capture_and_the_next_step_is_named(photos, tmp_path, capsys):
    out = tmp_path / "room"
    assert poses(photos, "--out", out) == 0
    told = capsys.readouterr().out
    assert "6 of 6 photos placed" in told and f"train {out} --out scene.shift" in told
    assert "Scale: arbitrary" in told
    assert len(read_capture(out).photos) == 6


def test_what_is_there_is_replaced_only_on_request(photos, tmp_path, capsys):
    out = tmp_path / "room"
    assert poses(photos, "--out", out, "--json") == 0
    assert json.loads(capsys.readouterr().out)["placed"] == 6
    before = {p: p.stat().st_mtime_ns for p in out.rglob("*") if p.is_file()}
    assert poses(photos, "--out", out) == 2
    assert "add --overwrite" in capsys.readouterr().err
    assert {p: p.stat().st_mtime_ns for p in out.rglob("*") if p.is_file()} == before
    assert poses(photos, "--out", out, "--overwrite", "--every", 2) == 0
    assert len(read_capture(out).photos) == 3


@pytest.mark.parametrize("words,arguments", [
    ("which holds the photos", lambda photos, out: (photos, "--out", photos)),
    ("which holds the photos", lambda photos, out: (photos, "--out", photos.parent)),
    ("which holds mine.txt", lambda photos, out: (photos, "--out", out)),
    ("which is a file", lambda photos, out: (photos, "--out", out / "mine.txt")),
    ("does not exist", lambda photos, out: (photos / "no", "--out", out / "new")),
    ("--every is 0", lambda photos, out: (photos, "--out", out / "new", "--every", 0)),
    ("--metres is '3'", lambda photos, out: (photos, "--out", out / "new", "--metres", 3)),
    ("no video that can be read", lambda photos, out: (out / "bad.mp4", "--out", out / "new")),
    ("--frames is 2", lambda photos, out: (out / "bad.mp4", "--out", out / "n", "--frames", 2)),
    ("masks lie on", lambda photos, out: (photos, "--out", out / "n", "--masks", photos,
                                          "--undistort")),
])  # fmt: skip
def test_refusals_are_one_sentence_and_write_nothing(photos, tmp_path, capsys, words, arguments):
    if "video" in words:
        pytest.importorskip("av", reason="PyAV is not installed")
    there = tmp_path / "there"
    there.mkdir()
    (there / "mine.txt").write_text("mine")
    (there / "bad.mp4").write_bytes(b"no video")
    if words == "which holds mine.txt":
        (there / "bad.mp4").unlink()
    assert poses(*arguments(photos, there)) == 2
    told = capsys.readouterr()
    assert words in told.err and told.out == "" and len(told.err.strip().splitlines()) == 1
    assert (there / "mine.txt").read_text() == "mine"
    assert not list(there.rglob("*.bin")) and len(list(photos.iterdir())) == 6


@pytest.mark.parametrize("text", ["0:a.jpg:1,2:3,4", "-1:a.jpg:1,2:3,4", "nan:a.jpg:1,2:3,4",
                                  "1:a.jpg:1,2", "1:a.jpg:1:2,3", "1::1,2:3,4", "x"])  # fmt: skip
def test_lengths_that_say_nothing_are_refused(text):
    with pytest.raises(UsageError, match="give LENGTH:PHOTO:X,Y:X,Y"):
        parse_length(text)


def test_a_length_names_a_photo_with_a_colon_and_folders():
    length = parse_length("0.24:a:b/c 1.jpg:120,300.5:410,310")
    assert length.metres == 0.24 and length.photo == "a:b/c 1.jpg"
    assert length.ends == ((120, 300.5), (410, 310))


def test_a_kill_of_the_search_loses_nothing_that_is_done(photos, tmp_path):
    """Ctrl-C as soon as the first photo has features: exit 130, its words, and then the rest."""
    out = tmp_path / "room"
    command = [sys.executable, "-m", "shapeshift", "poses", str(photos), "--out", str(out)]
    child = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    database, limit = out / "poses.work/database.db", time.monotonic() + 100
    while features_in(database) < 1 and time.monotonic() < limit:
        time.sleep(0.01)
    child.send_signal(signal.SIGINT)
    said = child.communicate(timeout=60)[1]
    assert child.returncode == 130 and "the same command goes on there" in said
    assert "Traceback" not in said
    kept = features_in(database)
    assert kept >= 1 and not (out / "sparse").exists()
    done = launch("poses", photos, "--out", out)
    assert done.returncode == 0 and "6 of 6 photos placed" in done.stdout, done.stderr
    assert not (out / "poses.work").exists()


def features_in(database) -> int:
    """Photos of which the database has features; 0 where it cannot be read yet."""
    try:
        with sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True) as base:
            return base.execute("select count(*) from keypoints").fetchone()[0]
    except sqlite3.Error:
        return 0


def test_a_capture_without_poses_names_this_command(photos):
    assert_refused(launch("train", photos, "--out", "x.shift"), "launch.py poses")


def test_a_video_gives_its_sharpest_frames(tmp_path, capsys):
    """Of each three frames the first and the last are blurred; the middle ones are taken."""
    av = pytest.importorskip("av", reason="PyAV is not installed")
    from shapeshift.decomposition.poses.video_frames import take_frames

    video, sharp = tmp_path / "walk.mp4", []
    with av.open(str(video), "w") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        stream.bit_rate = 20_000_000
        for i in range(6):
            picture = photo(camera(i, 6))
            sharp.append(picture)
            small = Image.fromarray(picture).resize((40, 30))
            blurred = np.asarray(small.resize((320, 240)))
            for shown in (blurred, picture, blurred):
                frame = av.VideoFrame.from_ndarray(shown, format="rgb24")
                container.mux(stream.encode(frame))
        container.mux(stream.encode())
    out = tmp_path / "frames"
    out.mkdir()
    assert take_frames(video, out, 6, lambda *_: None) == 6
    for i, path in enumerate(sorted(out.iterdir())):
        taken = np.asarray(Image.open(path)).astype(float)
        # The codec and JPEG cost some grey levels; the blurred frames are 15 and more away.
        assert np.abs(taken - sharp[i]).mean() < 8
    assert poses(video, "--out", tmp_path / "room", "--frames", 6) == 0
    assert "6 of 6 photos placed" in capsys.readouterr().out
    assert not (tmp_path / "room/frames").exists()


# What a run that was killed leaves, and what is put in the place of its input meanwhile.


def test_parts_of_a_killed_run_are_no_strange_files(tmp_path):
    """Killed while frames were taken: a part and the note of the video lie in --out."""
    out = tmp_path / "room"
    (out / ".shapeshift-0123456789abcdef.part").mkdir(parents=True)
    (out / "frames.txt").write_text("of a video")
    refuse_target(Options(tmp_path / "walk.mp4", out))
    assert [path.name for path in out.iterdir()] == ["frames.txt"]


def test_frames_of_another_video_are_not_used(tmp_path, monkeypatch):
    taken: list[Path] = []

    def take(video, folder, count, progress):
        taken.append(video)
        (folder / "00000.jpg").touch()

    monkeypatch.setattr("shapeshift.decomposition.poses.video_frames.take_frames", take)
    one, other, out = tmp_path / "a.mp4", tmp_path / "b.mp4", tmp_path / "room"
    one.write_bytes(b"one")
    other.write_bytes(b"other")
    folder = frames_of(Options(one, out), None)
    assert frames_of(Options(one, out), None) == folder and taken == [one]
    copy = tmp_path / "copy.mp4"
    copy.write_bytes(b"one")  # the same by content
    assert frames_of(Options(copy, out), None) == folder and taken == [one]
    for options in (Options(other, out), Options(one, out, frames=6)):
        with pytest.raises(UsageError, match="frames of another video or --frames"):
            frames_of(options, None)
    refuse_target(Options(other, out, overwrite=True))
    assert frames_of(Options(other, out), None) == folder and taken == [one, other]


def test_other_photos_of_the_same_names_are_another_search(photos, tmp_path):
    work = tmp_path / "work"
    work.mkdir()
    mine = tmp_path / "photos"
    shutil.copytree(photos, mine)
    start_job(work, describe(list_photos(mine), work, PoseSettings(), None))
    start_job(work, describe(list_photos(mine), work, PoseSettings(), None))
    first, second = sorted(mine.iterdir())[:2]
    first.write_bytes(second.read_bytes())
    with pytest.raises(BadFile, match=rf"other photos or options \({first.name} is another pict"):
        start_job(work, describe(list_photos(mine), work, PoseSettings(), None))
    (work / "job.json").write_text("[]")  # damaged, or of another version
    with pytest.raises(BadFile, match="other photos or options; give those again"):
        start_job(work, describe(list_photos(mine), work, PoseSettings(), None))


def test_matches_that_were_guided_go_before_the_first_attempt(tmp_path):
    """A run that was killed in guided matches begins again as one that was never started."""
    cleared: list[str] = []
    base = SimpleNamespace(clear_matches=lambda: cleared.append("matches"),
                           clear_two_view_geometries=lambda: None)  # fmt: skip
    colmap = SimpleNamespace(
        Database=SimpleNamespace(open=lambda path: contextlib.nullcontext(base))
    )
    mark = tmp_path / "guided"
    for guided, times, kept in (
        (False, 0, False), (True, 1, True),  # a run, killed
        (False, 2, False), (True, 3, True), (True, 3, True), (False, 4, False), (False, 4, False),
    ):  # fmt: skip
        clear_others(colmap, tmp_path / "database.db", mark, guided)
        assert (len(cleared), mark.exists()) == (times, kept)


def test_what_makes_it_a_capture_is_written_last(photos, tmp_path, monkeypatch):
    out, written = tmp_path / "room", []
    real = write_posed.write_whole
    monkeypatch.setattr(
        write_posed, "write_whole", lambda path, data: (written.append(path.name), real(path, data))
    )
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    assert poses(photos, "--out", out) == 0
    assert written[-1] == "images.bin" and written.count("images.bin") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["room"]  # no log of a library's
