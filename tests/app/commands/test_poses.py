"""poses: as a person starts it, on photos and on a video of a traced room; its refusals."""

import json
import signal
import sqlite3
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("pycolmap", reason="pycolmap is not installed")

from shapeshift.app import cli
from shapeshift.app.commands.poses import parse_length
from shapeshift.app.errors import UsageError
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
