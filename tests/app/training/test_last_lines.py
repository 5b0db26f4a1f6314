"""The last lines of commands: where what was written lies, and what a newcomer does next."""

import os
import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest

from shapeshift.app import cli
from shapeshift.app.paths import full
from shapeshift.app.training.train import FEW_STEPS, Options, seconds_a_step, what_next
from shapeshift.runtime_models import program
from tests.support.models import random_package

ROOT = Path(__file__).resolve().parents[3]

SMALL = ("--size", "16x12", "--drawing", "tiles", "--context", "none")
VIEW = '[{"matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "fov_y": 0.8}]'
WRITERS = [
    (("render", "random.shift", "--out", "out", *SMALL), "1 picture in {}/out\n"),
    (("export", "random.shift", "--out", "a.ply"), "{}/a.ply: "),
    (("export", "random.shift", "--out", "b.shift"), "{}/b.shift: "),
    (("compare", "random.shift@0", "random.shift@1", "--out", "out", *SMALL), "sheets in {}/out\n"),
    (
        ("simulate", str(ROOT / "examples/touch.scene.json"), "--seconds", "0.02", "--out", "run"),
        "run.jsonl in {}/run\n",
    ),
    (("cameras", "view.json", "--out", "views.json"), "1 camera in {}/views.json\n"),
    (
        ("stability", "random.shift", "--cases", "disparity", "--out", "out", *SMALL),
        "{}/out/stability.csv and pictures",
    ),
]


@pytest.mark.parametrize(("words", "told"), WRITERS, ids=lambda value: value[0])
def test_what_was_written_is_named_from_the_root(tmp_path, monkeypatch, capsys, words, told):
    """A relative --out is a place that is forgotten by tomorrow."""
    random_package(tmp_path, 30)
    (tmp_path / "view.json").write_text(VIEW)
    monkeypatch.chdir(tmp_path)
    assert cli.main(list(words)) in (0, 1)  # a case of stability may fail on so small a scene
    assert told.format(tmp_path) in capsys.readouterr().err.replace(os.sep, "/")


def asked(tmp_path: Path, **more) -> Options:
    return Options(tmp_path / "my photos", tmp_path / "a b.shift", **more)


def test_a_short_training_says_so_and_how_to_go_on(tmp_path):
    few, look = what_next(asked(tmp_path), 35, 20 / 35, False)
    assert few.startswith("35 steps are few: 2,000 are usual, about 19 minutes more on this ")
    start = len(shlex.split(program.program()))
    words = shlex.split(few.split("Go on: ")[1])[start:]
    assert words == ["train", str(tmp_path / "my photos"), "--out", str(tmp_path / "a b.shift"),
                     "--resume", "--iterations", "2000"]  # fmt: skip
    assert look.startswith("look: ")
    assert shlex.split(look)[1 + start :] == [str(tmp_path / "a b.shift")]
    assert "about 6 seconds more" in what_next(asked(tmp_path), 500, 0.004, False)[0]


def test_a_run_that_had_nothing_to_do_says_what_steps_took_before():
    """589 steps in 5.8 s were said to need 38 minutes for 1,411 more."""
    resumed = SimpleNamespace(iteration=589, elapsed=4.6)
    assert seconds_a_step(resumed, 0, 11.78) == pytest.approx(0.02)
    assert seconds_a_step(resumed, 588, 0.5) == 0.5
    assert seconds_a_step(resumed, 589, 1.6) == pytest.approx(4.6 / 589)
    assert seconds_a_step(SimpleNamespace(iteration=0, elapsed=0.0), 0, 1.6) == 0


def test_a_usual_training_only_says_how_to_look(tmp_path):
    (line,) = what_next(asked(tmp_path), FEW_STEPS, 0.06, False)
    assert line.startswith("look: ")
    assert len(what_next(asked(tmp_path), FEW_STEPS - 1, 0.06, False)) == 2


def test_an_interrupted_training_says_how_to_go_on(tmp_path):
    on, look = what_next(asked(tmp_path), 1500, 0.04, True)
    assert on.startswith("go on: ") and on.endswith("--resume") and look.startswith("look: ")


def test_the_program_is_named_so_that_it_starts_from_here(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    assert program.program() in ("python3 launch.py", "py launch.py")
    monkeypatch.chdir(tmp_path)
    assert str(ROOT / "launch.py") in program.program()
    assert full("a/../b") == str(tmp_path / "b")
