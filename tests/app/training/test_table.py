"""launch.py table, train --model splats and --separate: a small comparison from end to end."""

import csv
import importlib.util
import json
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.errors import UsageError
from shapeshift.app.training.evaluate import Options as EvalOptions
from shapeshift.app.training.evaluate import run as evaluate
from shapeshift.app.training.table import Options, command_line, run, train_options
from shapeshift.app.training.table_parts import (
    MEAN,
    NAMES,
    TableRow,
    VggRow,
    cells,
    compare,
    mean_row,
)
from shapeshift.app.training.train import Options as TrainOptions
from shapeshift.app.training.train import run as run_training
from shapeshift.app.training.train_baselines import TrainedFile, plain_settings, share_of
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.training.baselines.plain import PlainTrainer
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.training.settings_files import settings_file
from tests.support.training.vgg_files import write_small

SMALL = {"asked": {"max_anchors": 400}, "splats": {"max_splats": 900, "sh_degree": 1}}


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    return make_balls(tmp_path_factory.mktemp("balls"), size=48, views=10, test_views=2)


@pytest.fixture(scope="module")
def compared(balls, tmp_path_factory):
    """A whole comparison, once: its options and the lines of its CSV."""
    folder = tmp_path_factory.mktemp("table")
    write_small(folder / "small.onnx")
    options = Options(
        balls.folder, folder / "out", iterations=20, vgg=folder / "small.onnx", device="cpu",
        settings=settings_file(folder, **SMALL["splats"]), **SMALL,
    )  # fmt: skip
    assert run(options) == 0
    return options, (folder / "out" / "table.csv").read_text().splitlines()


def rows_of(lines: list[str]) -> dict[tuple[str, str], dict]:
    return {(row["method"], row["modality"]): row for row in csv.DictReader(lines[3:])}


def test_every_method_has_a_row_a_modality_and_a_mean(compared):
    options, lines = compared
    rows = rows_of(lines)
    assert set(rows) == {(m, x) for m in NAMES for x in ("RGB", "Thermal", MEAN)}
    for (method, modality), row in rows.items():
        assert 8 < float(row["psnr_db"]) < 45 and 0 < float(row["ssim"]) < 1
        assert float(row["vgg_distance"]) > 0
        # the same budget for each method: the separate models share it
        assert int(row["steps"]) == (20 if method == "joint" or modality == MEAN else 10)
        assert int(row["photos"]) == (4 if modality == MEAN else 2)
    assert lines[0].startswith(
        f"# python3 launch.py table {options.capture.name} --device cpu --iterations 20 --vgg small"
    )
    assert "RGB 10 + 2 photos of 48x48" in lines[2] and "VGG distance by small.onnx" in lines[2]


def test_bytes_are_those_on_disk(compared):
    options, lines = compared
    rows, out = rows_of(lines), options.out
    joint = (out / "joint.shift").stat().st_size / 1e6
    assert float(rows["joint", "RGB"]["mb"]) == float(rows["joint", MEAN]["mb"]) == joint
    for method, ending in (("separate", "shift"), ("splats", "ply"), ("spz", "spz")):
        sizes = [f.stat().st_size / 1e6 for f in sorted((out / method).glob(f"*.{ending}"))]
        assert [float(rows[method, x]["mb"]) for x in ("RGB", "Thermal")] == sizes
        assert float(rows[method, MEAN]["mb"]) == pytest.approx(sum(sizes))
    assert joint < float(rows["splats", MEAN]["mb"]) / 2
    for name in ("RGB", "Thermal", MEAN):  # packed: smaller, trained no longer, nearly as good
        plain, packed = rows["splats", name], rows["spz", name]
        assert float(packed["mb"]) < float(plain["mb"]) / 3
        assert (packed["seconds"], packed["steps"]) == (plain["seconds"], plain["steps"])
        assert abs(float(packed["psnr_db"]) - float(plain["psnr_db"])) < 1


def test_a_finished_comparison_is_not_run_again_and_another_is_refused(compared, capsys):
    options, lines = compared
    before = (options.out / "joint.shift").stat().st_mtime_ns
    assert run(options) == 0
    assert (options.out / "joint.shift").stat().st_mtime_ns == before
    assert capsys.readouterr().err.count("already in") == 4
    assert (options.out / "table.csv").read_text().splitlines() == lines
    with pytest.raises(UsageError, match="is of another run"):
        run(replace(options, iterations=21))


def test_the_markdown_names_methods_and_what_was_gained(compared):
    options, _ = compared
    text = (options.out / "table.md").read_text()
    table = [line for line in text.splitlines() if line.startswith("| ")]
    assert len(table) == 2 + 12 and len({line.count("|") for line in table}) == 1
    assert all(name in text for name in NAMES.values())
    assert "shape-shifting against 3DGS splats: " in text and "of the bytes" in text


def test_separate_models_are_single_stops_of_the_capture(compared, balls):
    options, _ = compared
    models = [read_model(f) for f in sorted((options.out / "separate").iterdir())]
    assert [m.stops for m in models] == [(stop,) for stop in balls.stops]
    splats = read_model(options.out / "splats")
    assert splats.stops == balls.stops and np.bincount(splats.layer).max() <= 900


def test_one_modality_is_evaluated_alone(compared, balls, capsys):
    options, lines = compared
    asked = EvalOptions(
        options.out / "separate" / "1_Thermal.shift", balls.folder, "Thermal", json=True
    )
    assert evaluate(asked) == 0
    told = capsys.readouterr()
    found = json.loads(told.out)["modalities"]
    wanted = rows_of(lines)["separate", "Thermal"]
    assert list(found) == ["Thermal"] and "VGG" not in told.err
    assert found["Thermal"]["psnr_db"] == pytest.approx(float(wanted["psnr_db"]), abs=1e-3)
    with pytest.raises(BadFile, match="has no stop 'RGB'"):
        evaluate(replace(asked, modality=None))
    with pytest.raises(UsageError, match="no modality 'Xray'; it has RGB, Thermal"):
        evaluate(replace(asked, modality="Xray"))
    assert evaluate(replace(asked, vgg=options.vgg)) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["modalities"]["Thermal"]["vgg_distance"] == float(wanted["vgg_distance"])
    assert told["vgg_file"].startswith("small.onnx, sha256 ")


def test_without_a_file_the_column_is_absent_and_the_reason_is_told(balls, tmp_path, capsys):
    options = Options(
        balls.folder, tmp_path / "out", iterations=4, methods=("splats",),
        settings=settings_file(tmp_path, max_splats=200), device="cpu",
    )  # fmt: skip
    assert run(options) == 0
    lines = (tmp_path / "out" / "table.csv").read_text().splitlines()
    assert "no VGG distance: --vgg names no file" in lines[2]
    assert "vgg_distance" not in lines[3] and len(lines) == 4 + 3
    assert "no VGG distance" in capsys.readouterr().err.replace("\n", " ")


def made(method: str, psnr: float, mb: float, seconds: float = 10.0) -> TableRow:
    return TableRow(method, MEAN, psnr, psnr, 0.9, mb, seconds, 1.0, 100, 5, 4)


def test_the_verdict_is_arithmetic():
    rows = [made("joint", 30.5, 0.5), made("separate", 30.25, 0.8), made("splats", 31.0, 10.0, 5)]
    assert compare(rows) == [
        "shape-shifting against separate models: +0.25 dB in the mean, 0.625 of the bytes, "
        "1.00 of the seconds.",
        "shape-shifting against 3DGS splats: -0.50 dB in the mean, 0.050 of the bytes, "
        "2.00 of the seconds.",
    ]
    assert "3DGS splats as spz: +1.50 dB" in compare([rows[0], made("spz", 29.0, 2.0)])[0]
    assert compare(rows[1:]) == [] and len(compare(rows[:2])) == 1


def test_the_mean_counts_one_file_once(tmp_path):
    (tmp_path / "a").write_bytes(b"x" * 2_000_000)
    (tmp_path / "b").write_bytes(b"x" * 500_000)
    rows = [
        VggRow("splats", "RGB", 30.0, 31.0, 0.8, 2.0, 7.0, 2.5, 70, 1000, 3, 0.1),
        VggRow("splats", "Thermal", 35.0, 34.0, 0.9, 0.5, 3.0, 0.5, 30, 501, 5, 0.3),
    ]
    runs = [
        TrainedFile(tmp_path / "a", 7.0, 70, 2.5),
        TrainedFile(tmp_path / "b", 3.0, 30, 0.5),
    ]
    mean = mean_row(rows, runs)
    assert mean == VggRow("splats", MEAN, 32.5, 32.5, 0.85, 2.5, 10.0, 3.0, 100, 750, 8, 0.2)
    assert mean_row(rows, runs[:1]).mb == 2.0


def test_a_model_of_all_modalities_tells_its_size_once():
    rows = [replace(made("joint", 30, 0.5), modality="RGB"), made("joint", 30, 0.5)]
    _, lines = cells([*rows, made("splats", 31, 9)])
    assert [line[0] for line in lines] == ["shape-shifting", "", "3DGS splats"]
    assert [line[-4:-2] for line in lines] == [["", ""], ["0.50", "100"], ["9.00", "100"]]
    assert [line[-2:] for line in lines] == [["", ""], ["10.0", "1.0"], ["10.0", "1.0"]]


def test_options_go_to_the_methods_that_have_them(tmp_path):
    asked = {"max_anchors": 400, "seed": 3}
    options = Options(tmp_path / "c", tmp_path / "o", asked, SMALL["splats"], seconds=60)
    splats, joint = train_options("splats", options), train_options("joint", options)
    assert (splats.splats, splats.model) == ({"max_splats": 900, "sh_degree": 1}, "splats")
    assert splats.asked == {"seconds": 60, "seed": 3}
    assert (joint.splats, joint.model) == ({}, "anchors")
    assert joint.asked == {"seconds": 60} | asked
    assert train_options("separate", options).separate
    words = command_line(options)
    assert (
        "--seconds 60" in words
        and "--max-anchors 400 --seed 3 --settings FILE (max_splats = 900" in words
    )
    assert "--methods" not in command_line(replace(options, methods=("joint",)))


def test_every_modality_gets_its_share(balls):
    settings = share_of(TrainSettings(iterations=101), balls)
    assert settings.iterations == 50 and settings.downscale == 1
    assert share_of(PlainSettings(iterations=None, seconds=9.0), balls).seconds == 4.5
    assert share_of(PlainSettings(iterations=1), balls).iterations == 1


def test_what_cannot_be_compared_is_refused_before_training(balls, tmp_path):
    good = Options(balls.folder, tmp_path / "out", iterations=2, device="cpu")
    with pytest.raises(UsageError, match="give --seconds or --iterations"):
        run(replace(good, iterations=None))
    with pytest.raises(UsageError, match="names none"):
        run(replace(good, methods=()))
    with pytest.raises(UsageError, match="add splats before it"):
        run(replace(good, methods=("joint", "spz")))
    (tmp_path / "file").write_text("x")
    with pytest.raises(UsageError, match="is a file"):
        run(replace(good, out=tmp_path / "file"))
    with pytest.raises(BadFile, match="is no file"):
        run(replace(good, vgg=tmp_path / "absent.onnx"))
    write_small(tmp_path / "small.onnx")
    with pytest.raises(BadFile, match="12x12 pixels are too small"):
        run(replace(good, vgg=tmp_path / "small.onnx", asked={"downscale": 4}))
    assert not (tmp_path / "out").exists()


def test_options_of_another_kind_of_model_are_refused(balls, tmp_path):
    asked = TrainOptions(balls.folder, tmp_path / "out", {"iterations": 2}, model="splats")
    for wrong, words in (
        ({"asked": {"features": 8}}, "^features is of anchor models"),
        ({"separate": True}, "leave out --separate"),
        ({"splats": {"sh_degree": 4}}, "up to degree 3"),
        ({"model": "anchors", "splats": {"sh_degree": 2}}, "^sh_degree is of plain splats"),
    ):
        with pytest.raises(UsageError, match=words):
            run_training(replace(asked, **wrong))
    with pytest.raises(UsageError, match="name a folder"):
        out = tmp_path / "a.shift"
        run_training(replace(asked, model="anchors", separate=True, out=out, device="cpu"))
    assert plain_settings(replace(asked, splats={"sh_degree": 0})).sh_degree == 0
    assert plain_settings(replace(asked, asked={"seconds": 5.0})).iterations is None
    assert plain_settings(replace(asked, asked={"seconds": 5.0, "iterations": 2})).iterations == 2


@pytest.mark.parametrize(("kind", "trainer"), [("splats", PlainTrainer), ("anchors", Trainer)])
def test_ctrl_c_keeps_what_was_trained_and_resume_goes_on(
    balls, tmp_path, monkeypatch, capsys, kind, trainer
):
    step, asked_to_stop = trainer.one_step, []

    def interrupted(self):
        if asked_to_stop and self.iteration == asked_to_stop[0]:
            os.kill(os.getpid(), signal.SIGINT)
            asked_to_stop.clear()
        return step(self)

    monkeypatch.setattr(trainer, "one_step", interrupted)
    small = {} if kind == "splats" else {"max_anchors": 100}
    asked = TrainOptions(
        balls.folder, tmp_path / "whole", {"iterations": 40} | small, model=kind,
        splats={"max_splats": 300} if kind == "splats" else {}, separate=kind == "anchors",
        device="cpu",
    )  # fmt: skip
    assert run_training(asked) == 0
    whole = models_of(tmp_path / "whole")
    asked = replace(asked, out=tmp_path / "out")
    with pytest.raises(BadFile, match="no checkpoint to resume from"):
        run_training(replace(asked, resume=True))
    asked_to_stop.append(5)
    assert run_training(asked) == 130
    told = capsys.readouterr().err
    assert "not trained: Thermal; --resume goes on" in told
    path = tmp_path / "out" if kind == "splats" else tmp_path / "out" / "0_RGB.shift"
    assert [stop.name for stop in read_model(path).stops] == ["RGB"]
    with pytest.raises(UsageError, match="where seed is 0, not 7"):
        run_training(replace(asked, asked=asked.asked | {"seed": 7}, resume=True))
    asked_to_stop.append(10)  # and once more: a run may be ended as often as one likes
    assert run_training(replace(asked, resume=True)) == 130
    assert run_training(replace(asked, resume=True)) == 0
    assert models_of(tmp_path / "out") == whole and len(whole) == 2 + (kind == "splats")
    # Two modalities share a budget: twice as many steps are twice as many for each.
    more = replace(asked, asked={"iterations": 80}, splats={}, resume=True)
    assert run_training(more) == 0 and "40 steps" in capsys.readouterr().err
    assert models_of(tmp_path / "out") != whole


def models_of(folder: Path) -> dict[str, bytes]:
    """All that is in a folder of models; checkpoints lie beside it."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_comparison_that_was_ended_goes_on(balls, tmp_path, monkeypatch):
    """In the middle of the second model: the first is not trained again, the second goes on."""
    table = Options(
        balls.folder, tmp_path / "t", iterations=24, methods=("splats",), device="cpu",
        settings=settings_file(tmp_path, max_splats=300),
    )  # fmt: skip
    step, done = PlainTrainer.one_step, []

    def interrupted(self):
        if len(done) == 12 + 5:
            os.kill(os.getpid(), signal.SIGINT)
        done.append((self.stop.name, self.iteration))
        return step(self)

    monkeypatch.setattr(PlainTrainer, "one_step", interrupted)
    assert run(table) == 130  # no row of half a method
    assert not (tmp_path / "t" / "table.csv").exists()
    assert run(table) == 0
    assert done == [(name, i) for name in ("RGB", "Thermal") for i in range(12)]
    monkeypatch.undo()
    assert run(replace(table, out=tmp_path / "whole")) == 0
    assert models_of(tmp_path / "t" / "splats") == models_of(tmp_path / "whole" / "splats")


@pytest.mark.slow
def test_the_program_of_the_measured_rows(balls, tmp_path, monkeypatch):
    """tools/training/baselines.py at its smallest: budgets, sizes, seeds, nothing twice."""
    path = Path(__file__).resolve().parents[3] / "tools" / "training" / "baselines.py"
    spec = importlib.util.spec_from_file_location("baselines", path)
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    words = [str(balls.folder), "--seconds", "0.3", "--sizes", "0.02", "--downscale", "2"]
    words += ["--seeds", "0", "3"]
    words += ["--out", str(tmp_path / "work"), "--csv", str(tmp_path / "rows.csv")]
    monkeypatch.setattr(
        program, "caps",
        lambda size, asked: ({"max_anchors": 60, "downscale": 2}, {"max_splats": round(99 * size)}),
    )  # fmt: skip
    monkeypatch.setattr(sys, "argv", ["baselines.py", *words])
    assert program.main() == 0
    lines = (tmp_path / "rows.csv").read_text().splitlines()
    assert lines[0].startswith(
        f"# python3 tools/training/baselines.py {balls.folder.name} --seconds"
    )
    assert " --sizes 0.02 --seeds 0 3 --downscale 2 " in lines[0]
    rows = list(csv.DictReader(lines[2:]))
    for seed in ("0", "3"):
        mine = [row for row in rows if row["seed"] == seed]
        assert len(mine) == 4 * 3 + 3 * 3 and {row["size"] for row in mine} == {"1.0", "0.02"}
    work = tmp_path / "work" / balls.folder.name
    for seed, name in ((0, "0.3 s size 1"), (3, "0.3 s size 1 seed 3")):
        provenance = read_model(work / name / "joint.shift").provenance
        assert provenance["settings"]["seed"] == seed
        assert ("--seed 3" in (work / name / "table.csv").read_text()) == bool(seed)
    assert program.main() == 0
    assert (tmp_path / "rows.csv").read_text().splitlines() == lines
    plan = program.plan([60, 9], [1, 0.1], program.METHODS)
    assert plan[-1] == (60, 0.1, ("joint", "splats", "spz"))
    assert program.plan([9], [], ["joint"]) == [(9, 1.0, ("joint",))]
