"""train --blocks as it is typed: what it refuses, that 1 is a run as ever, and the whole way."""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.training.checkpoint import read_checkpoint
from shapeshift.training.synthetic.balls import make_balls

ROOT = Path(__file__).resolve().parents[3]
SMALL = ("--blocks", "2", "--block-photos", "4", "--max-anchors", "200")


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    folder = tmp_path_factory.mktemp("capture")
    make_balls(folder, size=40, views=6, test_views=1)
    return folder


def files_of(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.mark.parametrize(
    ("out", "more", "said"),
    [
        ("a.shift", ("--blocks", "2"), "name it a.blocks"),
        ("a.blocks", ("--blocks", "0"), "--blocks is '0'"),
        ("a.blocks", ("--blocks", "2,2"), "a grid such as 4x2"),
        ("a.blocks", ("--blocks", "2", "--seconds", "5"), "give --iterations"),
        ("a.blocks", ("--blocks", "2", "--poses", "refine"), "--poses refine"),
        ("a.blocks", ("--blocks", "2", "--separate"), "--separate"),
        ("a.blocks", ("--blocks", "auto", "--max-anchors", "99999"), "leave out --blocks"),
        ("a.shift", ("--coarse-iterations", "9"), "add --blocks"),
        ("a.shift", ("--block", "no.npz"), "no start of a block is there"),
        ("a.shift", ("--block", "no.npz", "--cut", "a"), "give one of them"),
        ("a.shift", ("--block", "no.npz", "--blocks", "2"), "no start of a block is there"),
        ("cut", ("--cut", "no.shift", "--blocks", "2"), "no checkpoint"),
    ],
)
def test_bad_words_are_one_sentence_and_nothing_is_written(
    capture, tmp_path, capsys, out, more, said
):
    assert cli.main(["train", str(capture), "--out", str(tmp_path / out), *more]) == 2
    text = capsys.readouterr().err
    assert said in text and "Traceback" not in text
    assert not list(tmp_path.iterdir())


def test_a_folder_of_something_else_is_not_replaced(capture, tmp_path, capsys):
    out = tmp_path / "a.blocks"
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    assert cli.main(["train", str(capture), "--out", str(out), "--blocks", "2"]) == 2
    assert "no scene in blocks" in capsys.readouterr().err
    assert files_of(out) == {"mine.txt": b"mine"}


def test_one_block_is_a_run_as_ever(capture, tmp_path, capsys):
    """To the byte, package and checkpoint."""
    words = ["train", str(capture), "--iterations", "12", "--max-anchors", "200"]
    for name, more in (("a", ()), ("b", ("--blocks", "1"))):
        assert cli.main([*words, "--out", str(tmp_path / f"{name}.shift"), *more]) == 0
    assert (tmp_path / "a.shift").read_bytes() == (tmp_path / "b.shift").read_bytes()
    read = [read_checkpoint(tmp_path / f"{n}.shift.checkpoint.npz") for n in "ab"]
    states, notes = [state for state, _ in read], [told for _, told in read]
    for told in notes:  # what a clock has measured
        del told["elapsed"], told["start_s"]
    assert notes[0] == notes[1] and states[0].keys() == states[1].keys()
    same = [
        np.array_equal(a, states[1][n], equal_nan=a.dtype.kind == "f") for n, a in states[0].items()
    ]
    assert all(same)
    assert not [path for path in tmp_path.iterdir() if path.suffix == ".work"]


def launched(*words: str) -> subprocess.Popen:
    command = [sys.executable, "-P", str(ROOT / "launch.py"), *words]
    environment = os.environ | {"POCL_MAX_PTHREAD_COUNT": "1"}
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)


@pytest.mark.slow
def test_the_whole_way_ended_and_begun_again_gives_the_same_bytes(capture, tmp_path):
    """Killed, then Ctrl-C, then the same command, on a cluster where there is one; one start more
    does nothing any more.
    """
    length = ("--coarse-iterations", "30", "--iterations", "400")
    words = [["train", str(capture), "--out", str(tmp_path / n), *SMALL, *length]
             for n in ("a.blocks", "b.blocks")]  # fmt: skip
    whole = launched(*words[0])
    said = whole.communicate(timeout=300)[1]
    assert whole.returncode == 0, said
    assert "2 blocks" in said and "how good:" in said
    begun = tmp_path / "b.blocks.work" / "0.shift.begun.json"
    for how, code in ((signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)):
        ended = launched(*words[1])
        while ended.poll() is None and not begun.exists():
            time.sleep(0.05)
        time.sleep(4)  # the program has started and trains; its steps take some seconds
        ended.send_signal(how)
        said = ended.communicate(timeout=120)[1]
        assert ended.returncode in (code, 0), said  # 0: a fast machine was through
    shared = ["--cluster", "local:2"] if importlib.util.find_spec("distributed") else []
    again = launched(*words[1], *shared)
    said = again.communicate(timeout=300)[1]
    assert again.returncode == 0, said
    assert files_of(tmp_path / "a.blocks") == files_of(tmp_path / "b.blocks")
    times = {p: p.stat().st_mtime_ns for p in (tmp_path / "b.blocks.work").iterdir()}
    third = launched(*words[1])
    assert third.wait(timeout=60) == 0
    assert times == {p: p.stat().st_mtime_ns for p in (tmp_path / "b.blocks.work").iterdir()}
    scene = ss.load(tmp_path / "b.blocks")
    assert isinstance(scene.model, BlockModel) and len(scene.stops) == 2
    assert np.isfinite(scene.render(size=(40, 30))).all()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"blocks": "2x2", "out": None}, "blocks wants out, a folder NAME.blocks"),
        ({"blocks": 2, "out": "a.shift"}, "^out is a.shift; blocks writes .* a.blocks"),
        ({"blocks": 0}, "^blocks is '0'"),
        ({"blocks": 2, "seconds": 5}, "^seconds: .* give iterations and coarse_iterations"),
        ({"blocks": 2, "poses": "refine"}, "^poses refine"),
        ({"blocks": 2, "grow": False}, "^grow: blocks are trained by commands"),
        ({"blocks": 2, "anchor": 9}, "no setting 'anchor'"),
        ({"blocks": 2, "iterations": 0}, "iterations is 0"),
        ({"blocks": 2, "cluster": "moon"}, "--cluster is 'moon'"),
        ({"blocks": "auto", "max_anchors": 99999}, r"^blocks auto: .*max_anchors\); leave out"),
        ({"coarse_iterations": 9}, "coarse_iterations is of blocks"),
        ({"cluster": "local:2"}, "cluster is of blocks"),
        ({"block_photos": 9, "blocks": "1"}, "block_photos is of blocks"),
    ],
)
def test_python_refuses_in_its_own_words(capture, tmp_path, capfd, more, said):
    given = {"out": "a.blocks"} | more
    out = given.pop("out")
    with pytest.raises(ss.UsageError, match=said):
        ss.train(capture, None if out is None else tmp_path / out, **given)
    assert not [path for path in tmp_path.iterdir() if path.suffix == ".blocks"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_python_trains_blocks_to_the_bytes_of_the_command(capture, tmp_path, capfd):
    """Ended in a block and called again; what the command has done already it does not do."""
    lengths = {"iterations": 60, "max_anchors": 200}
    heard: list[str] = []

    def hear(line: str) -> None:
        heard.append(line)
        if line.startswith("block 1: ") and "steps" in line and not begun:
            begun.append(line)
            raise KeyboardInterrupt

    begun: list[str] = []
    how = {"blocks": 2, "coarse_iterations": 30, "block_photos": 4, "progress": hear}
    with pytest.raises(KeyboardInterrupt):
        ss.train(capture, tmp_path / "a.blocks", **lengths, **how)
    assert not (tmp_path / "a.blocks").exists()
    shared = {"cluster": "local:2"} if importlib.util.find_spec("distributed") else {}
    scene = ss.train(capture, tmp_path / "a.blocks", **lengths, **how, **shared)
    assert capfd.readouterr() == ("", "")
    assert scene.steps == 30 + 2 * 60 and scene.seconds > scene.start_seconds > 0
    assert scene.anchors == len(scene.model.anchors) and set(scene.psnr_db) == {"RGB", "Thermal"}
    assert any(line.startswith("block 0: ") for line in heard) and scene.warnings == ()
    scores = ss.evaluate(tmp_path / "a.blocks", capture)["modalities"]
    for name, found in scores.items():  # which are rounded to four places
        assert scene.psnr_db[name] == pytest.approx(found["psnr_db"], abs=6e-5)
    again = ss.load(tmp_path / "a.blocks")
    assert isinstance(again.model, BlockModel)
    assert np.array_equal(again.render(size=(40, 30)), scene.render(size=(40, 30)))
    times = {p: p.stat().st_mtime_ns for p in (tmp_path / "a.blocks.work").iterdir()}
    before = files_of(tmp_path / "a.blocks")
    words = ["train", str(capture), "--out", str(tmp_path / "a.blocks"), *SMALL]
    assert cli.main([*words, "--coarse-iterations", "30", "--iterations", "60"]) == 0
    assert times == {p: p.stat().st_mtime_ns for p in (tmp_path / "a.blocks.work").iterdir()}
    assert files_of(tmp_path / "a.blocks") == before
