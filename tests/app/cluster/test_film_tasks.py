"""A film by a cluster: the frames of one process, in runs, and nothing left beside them."""

import os
import sys

import pytest

from shapeshift.app import cli
from shapeshift.app.film import film_tasks
from tests.support.three_stops import three_stop_package

TINY = ("--size", "24x18", "--context", "none", "--fps", "4", "--seconds", "1",
        "--style-path", "RGB@0 Opened@1s")  # fmt: skip


def bytes_of(folder) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*.png")}


@pytest.mark.slow
def test_two_workers_draw_the_frames_of_one(tmp_path, monkeypatch, capsys):
    """In runs of three the four frames are two tasks; a frame that is there is not drawn again."""
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    scene = three_stop_package(tmp_path / "three.shift")
    monkeypatch.setattr(film_tasks, "RUN", 3)
    words = ["film", str(scene), "--cameras", "orbit", *TINY, "--streams", "depth", "--out"]
    alone, many = tmp_path / "alone", tmp_path / "many"
    assert cli.main([*words, str(alone)]) == 0
    assert cli.main([*words, str(many), "--only", "1"]) == 0
    before = os.stat(many / "00001.png").st_mtime_ns
    capsys.readouterr()
    assert cli.main([*words, str(many), "--cluster", "local:2"]) == 0
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("4 frames in ")
    assert bytes_of(many) == bytes_of(alone) and len(bytes_of(many)) == 8
    assert os.stat(many / "00001.png").st_mtime_ns == before
    assert sorted(os.listdir(tmp_path)) == ["alone", "many", "three.shift"]  # no notes are left


def test_without_the_extra_nothing_is_drawn_or_lost(tmp_path, monkeypatch, capsys):
    scene = three_stop_package(tmp_path / "three.shift")
    monkeypatch.setitem(sys.modules, "distributed", None)
    words = ["film", str(scene), "--cameras", "orbit", *TINY, "--out", str(tmp_path / "f")]
    assert cli.main([*words, "--cluster", "local"]) == 2
    said = capsys.readouterr().err
    assert "launch.py extras cluster`" in said and said.count("\n") == 1
    assert cli.main([*words, "--cluster", "moon"]) == 2
    assert "--cluster is 'moon', expected none, local" in capsys.readouterr().err
