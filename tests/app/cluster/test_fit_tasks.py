"""fit by a cluster: the report and the bytes of one process; one training by hand; bad settings."""

import json
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from shapeshift.app.cluster.run_task import Here, TaskFailed
from shapeshift.app.cluster.task import Task
from shapeshift.app.command_line import parse
from shapeshift.app.errors import UsageError
from shapeshift.app.training.fit import Options, run
from shapeshift.app.training.run_loop import INTERRUPTED
from shapeshift.app.training.run_trials import Trials, calibrated_once
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.checkpoint import checkpoint_path
from shapeshift.training.fit.ablation import COMPONENTS
from shapeshift.training.fit.fit import Fit, read_settings
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls

NEVER: tuple[Any, ...] = ([], {}, float("nan"), float("inf"), -1, "\x1b[2J")  # of any setting
SMALL: dict[str, Any] = {"max_anchors": 90, "splats_per_anchor": 2, "features": 4, "hidden": 8}


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    return make_balls(tmp_path_factory.mktemp("balls"), size=32, views=6, test_views=2).folder


@pytest.fixture(scope="module", autouse=True)
def two_parts():
    """Only splats and anchors are taken away: trials that depend on each other."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Fit.__init__, "__defaults__", (COMPONENTS[-2:], None))
        yield


def options(balls: Path, out: Path, **more) -> Options:
    wished: dict[str, Any] = {
        "tolerance_db": 5.0,
        "iterations": 20,
        "device": "cpu",
        "asked": dict(SMALL),
    }
    return Options(balls, out, **wished | more)


def report(out: Path) -> object:
    return read_package(out).provenance["need"]


class InThisProcess:
    """A cluster whose tasks are calls; it notes what it has run."""

    def __init__(self, most: int = 1000) -> None:
        self.ran: list[str] = []
        self.most = most

    def run(self, tasks: Sequence[Task]) -> None:
        for task in tasks:
            if task.is_done(key := task.key()):
                continue
            if len(self.ran) >= self.most:
                raise KeyboardInterrupt
            asked = parse(Options, list(task.argv[1:]), task.argv[0])
            assert run(asked) == 0
            task.note_done(key)
            self.ran.append(task.name)


def use(monkeypatch, cluster: InThisProcess) -> InThisProcess:
    @contextmanager
    def opened(where, certificates, gpus):
        assert where == "local:2"
        yield cluster

    monkeypatch.setattr("shapeshift.app.cluster.open_cluster.open_cluster", opened)
    monkeypatch.setattr("shapeshift.app.cluster.open_cluster.check_cluster", lambda options: None)
    return cluster


@pytest.fixture(scope="module")
def alone(balls, two_parts, tmp_path_factory) -> Path:
    """The scene of --cluster none."""
    out = tmp_path_factory.mktemp("alone") / "fit.shift"
    assert run(options(balls, out)) == 0
    return out


@pytest.mark.slow
def test_tasks_make_the_report_and_the_bytes_of_one_process(balls, alone, tmp_path, monkeypatch):
    """Also where the first start is interrupted between two seeds of a trial."""
    out = tmp_path / "fit.shift"
    first = use(monkeypatch, InThisProcess(most=3))
    with pytest.raises(KeyboardInterrupt):
        run(options(balls, out, cluster="local:2"))
    assert not out.exists() and len(first.ran) == 3
    second = use(monkeypatch, InThisProcess())
    assert run(options(balls, out, cluster="local:2")) == 0
    ran = first.ran + second.ran
    assert len(set(ran)) == len(ran) >= 6 and ran[0] == "the largest, seed 1 of 2"
    assert report(out) == report(alone) and out.read_bytes() == alone.read_bytes()
    # Another tolerance asks for some of the same trainings: none is done twice.
    third = use(monkeypatch, InThisProcess())
    assert run(options(balls, out, cluster="local:2", tolerance_db=4.0)) == 0
    assert not third.ran


@pytest.mark.slow
def test_two_workers_make_the_report_of_one_process(balls, alone, tmp_path):
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    out = tmp_path / "fit.shift"
    assert run(options(balls, out, cluster="local:2")) == 0
    assert report(out) == report(alone) and out.read_bytes() == alone.read_bytes()
    kept = {p: p.stat().st_mtime_ns for p in (tmp_path / "fit.shift.trials").glob("*.shift")}
    assert run(options(balls, out, cluster="local:2")) == 0
    assert len(kept) >= 6 and all(path.stat().st_mtime_ns == at for path, at in kept.items())


def test_a_training_that_is_interrupted_goes_on_to_the_same_bytes(balls, tmp_path, monkeypatch):
    file, whole, cut = settings_file(tmp_path), tmp_path / "whole.shift", tmp_path / "cut.shift"
    assert run(Options(balls, whole, only=file, device="cpu")) == 0

    def stopped(trainer, save) -> bool:
        steps = trainer.steps()
        while trainer.iteration < 12:
            next(steps)
        return True

    with monkeypatch.context() as patch:
        patch.setattr("shapeshift.app.training.run_trials.train", stopped)
        assert run(Options(balls, cut, only=file, device="cpu")) == INTERRUPTED
    assert not cut.exists() and checkpoint_path(cut).exists()
    other = settings_file(tmp_path, seed=1)
    with pytest.raises(UsageError, match="is of other settings; leave out --resume"):
        run(Options(balls, cut, only=other, resume=True, device="cpu"))
    settings_file(tmp_path)
    assert run(Options(balls, cut, only=file, resume=True, device="cpu")) == 0
    assert cut.read_bytes() == whole.read_bytes() and not checkpoint_path(cut).exists()


def test_an_offset_is_looked_for_once(balls, tmp_path, monkeypatch):
    found: list[int] = []

    def look(device, capture, settings, modality):
        found.append(settings.seed)
        return replace(settings, rig="{}")

    monkeypatch.setattr("shapeshift.app.training.run_loop.calibrated", look)
    asked = options(balls, tmp_path / "fit.shift", calibrate="Thermal")
    for seed in (0, 0, 1):  # other settings: it may be another
        capture = read_capture(balls)
        assert calibrated_once(None, capture, TrainSettings(seed=seed), asked).rig == "{}"
    assert found == [0, 1]


def test_a_trial_that_fails_says_its_own_sentence(balls, tmp_path):
    """A process of the program: its sentence stands behind the name of the task."""
    trials = Trials(Here(), options(balls, tmp_path / "fit.shift"))
    with pytest.raises(TaskFailed, match=r"largest: .*max_anchors.*is 4,?294,?967,?296; a whole"):
        trials.train_seeds({"the largest": TrainSettings(iterations=2, max_anchors=1 << 32)})


def settings_file(folder: Path, **wrong) -> Path:
    file = folder / "settings.json"
    file.write_text(json.dumps(TrainSettings(iterations=20, **SMALL).as_dict() | wrong))
    return file


def test_settings_come_back_out_of_their_file(tmp_path):
    settings = TrainSettings(
        seconds=0.1 + 0.2, iterations=None, max_mb=1.5, points="hull", downscale=2, seed=3,
        masks="valid", fixed="offset,scale", view_dependent=False, anchor_attributes="",
        rig='{"Thermal": [1, 0]}', depth_share=0.0,
    )  # fmt: skip
    assert read_settings(settings_file(tmp_path, **settings.as_dict())) == settings


@pytest.mark.parametrize("wrong", [
    *({each.name: value} for each in fields(TrainSettings) for value in NEVER),
    {"iterations": 0}, {"iterations": True}, {"iterations": 1 << 40}, {"iterations": 2.5},
    {"iterations": None, "seconds": None}, {"seconds": 0}, {"seconds": "5"}, {"seed": None},
    {"hidden": (1 << 12) + 1}, {"hidden": 10**400}, {"points": "/etc/passwd"}, {"points": None},
    {"masks": "none"}, {"fixed": "offset,nose"}, {"fixed": "x" * 1001}, {"grow": 1},
    {"anchor_attributes": "hat"}, {"blended_shapes": 1.01}, {"hiden": 8},
], ids=str)  # fmt: skip
def test_settings_that_cannot_be_are_refused(tmp_path, wrong):
    file = settings_file(tmp_path, **wrong)
    with pytest.raises(BadFile) as said:
        read_settings(file)
    text = str(said.value)
    assert text.startswith(str(file)) and text.isprintable() and len(text) < len(str(file)) + 900
    words = {"hat": "no attribute 'hat'", "offset,nose": "no head 'nose'"}
    key, value = next(iter(wrong.items()))
    ends = "needs an end" in text if len(wrong) == 2 else words.get(str(value), key) in text
    assert ends


@pytest.mark.parametrize("text", ["", "{", "[]", "7", "[" * 50000, '{"seed": 1, "seed": 2}', "{}"])
def test_files_that_hold_no_settings_are_refused(balls, tmp_path, text):
    (tmp_path / "settings.json").write_text(text)
    with pytest.raises(BadFile, match=r"settings\.json"):
        run(Options(balls, tmp_path / "out.shift", only=tmp_path / "settings.json"))
    assert not (tmp_path / "out.shift").exists()


def test_large_and_lacking_files_are_refused(tmp_path):
    (tmp_path / "large.json").write_text(" " * ((1 << 16) + 1))
    with pytest.raises(BadFile, match="has 65,537 bytes; at most 65,536 are read"):
        read_settings(tmp_path / "large.json")
    with pytest.raises(BadFile, match="is no file"):
        read_settings(tmp_path / "none.json")


def test_options_that_do_not_go_together(balls, tmp_path):
    file, out = settings_file(tmp_path), tmp_path / "out.shift"
    for more, name in (
        ({"asked": {"max_anchors": 9}}, "max-anchors"), ({"seeds": 3}, "seeds"),
        ({"cluster": "local"}, "cluster"), ({"calibrate": "RGB"}, "calibrate"),
        ({"iterations": 9}, "iterations"), ({"json": Path("-")}, "json"),
    ):  # fmt: skip
        with pytest.raises(UsageError, match=f"--only trains what its file says.*--{name}"):
            run(Options(balls, out, only=file, **more))
    with pytest.raises(UsageError, match=r"expected NAME\.shift"):
        run(Options(balls, tmp_path / "folder", only=file))
    with pytest.raises(UsageError, match="--resume goes on with one training; add --only"):
        run(Options(balls, out, resume=True))
    with pytest.raises(UsageError, match="--cluster is 'local:0'"):
        run(Options(balls, out, cluster="local:0"))
    with pytest.raises(BadFile, match="no checkpoint to resume from"):
        run(Options(balls, out, only=file, resume=True))


def test_places_where_trainings_cannot_lie_are_refused(balls, tmp_path, monkeypatch):
    use(monkeypatch, InThisProcess())
    with pytest.raises(UsageError, match="lies in the capture"):
        run(options(balls, balls / "fit.shift", cluster="local:2"))
    (tmp_path / "fit.shift.trials").write_text("mine")
    with pytest.raises(UsageError, match=r"fit\.shift\.trials is a file"):
        run(options(balls, tmp_path / "fit.shift", cluster="local:2"))
    assert (tmp_path / "fit.shift.trials").read_text() == "mine"
