"""launch.py fit as a whole: what two scenes need, the report, and what cannot be asked."""

import json
from dataclasses import replace

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.app.errors import UsageError
from shapeshift.app.training import fit as command
from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import HEADS, BadFile
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.training.fit.ablation import COMPONENTS, DROPPED, KEPT, SHAPE_HEADS
from shapeshift.training.fit.fit import Fit
from shapeshift.training.settings import TrainSettings
from tests.support.training.fit_scenes import make_shapes

SMALL = TrainSettings(
    iterations=250,
    grow=False,
    max_anchors=400,
    splats_per_anchor=3,
    features=8,
    hidden=16,
)


@pytest.fixture(scope="module")
def captures(tmp_path_factory) -> dict:
    return {n: make_shapes(tmp_path_factory.mktemp(n), n) for n in ("shared", "apart")}


def needs(capture, components, settings=SMALL, tolerance=1.0):
    return Fit(
        open_device("cpu"), capture, settings, tolerance, 1, lambda what, done: None, components
    ).run()


def test_stops_of_one_shape_share_it(captures):
    need = needs(captures["shared"], COMPONENTS[:5])
    first = need.decisions[0]
    assert (first.part, first.verdict) == ("shape that follows x", DROPPED)
    assert need.settings.layout(2).fixed == SHAPE_HEADS
    model = need.fitted.models[0]
    assert all(("control" in model.networks[n].inputs) == (n == "color") for n in HEADS)
    assert "rotation that follows x" not in [v.part for v in need.decisions]  # went with the shape
    assert set(need.outlines) == {("RGB", "Thermal")}


def test_stops_of_two_shapes_do_not(captures):
    need = needs(captures["apart"], COMPONENTS[:1])
    first = need.decisions[0]
    assert first.verdict == KEPT and first.needed_by == ("Ball", "Cube")
    assert all(c.mean < -2 and c.error < -c.mean / 2 for c in first.change.values())
    assert need.settings.fixed == ""


def test_what_goes_without_training_changes_next_to_nothing(captures):
    need = needs(captures["apart"], (), tolerance=0.05)
    words = {verdict.part: verdict.verdict for verdict in need.decisions}
    assert words["features as float32 instead of float16"] == DROPPED
    assert need.fitted.bytes < need.full.bytes
    saved = sum(v.bytes for v in need.decisions if v.verdict == DROPPED)
    assert need.full.bytes - need.fitted.bytes == saved
    for name, before in need.full.psnr.items():
        change = need.fitted.psnr[name] - before
        assert change.shape == (1, 4) and change.mean() > -0.05


def test_the_command_writes_a_package_with_its_report(captures, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        "shapeshift.training.fit.fit.Fit.__init__.__defaults__", (COMPONENTS[-2:], None)
    )
    options = command.Options(
        captures["shared"].folder, tmp_path / "fit.shift", tolerance_db=5.0, seeds=2,
        json=True, iterations=20,
        asked={"max_anchors": 90, "splats_per_anchor": 2, "features": 4, "hidden": 8},
    )  # fmt: skip
    assert command.run(options) == 0
    told = capsys.readouterr()
    result = json.loads(told.out)
    model = read_package(tmp_path / "fit.shift")
    assert model.provenance["need"] == command.without_times(result)
    assert result["fitted"]["anchors"] == len(model.anchors)
    assert result["fitted"]["splats_per_anchor"] == model.splats_per_anchor == 1
    assert result["seeds"] == 2 and result["held_out"] == {"RGB": 4, "Thermal": 4}
    row = result["parts"][0]
    assert (row["part"], row["verdict"]) == ("one splat of every anchor", "dropped")
    assert row["saves_bytes"] > 0 and row["change"]["RGB"]["error"] > 0
    shown = told.err
    assert "one splat of every anchor" in shown and "Outlines of RGB and Thermal" in shown


def test_the_library_searches_as_the_command_does(captures, tmp_path, monkeypatch, capsys):
    """The same search is asked for, and what is made of what it finds is the same to the byte."""
    asked, need = [], needs(captures["shared"], (), replace(SMALL, iterations=20), tolerance=9.0)

    def run(fit):
        asked.append((fit.settings, fit.last, fit.tolerance_db, fit.seeds))
        return need

    monkeypatch.setattr(Fit, "run", run)
    monkeypatch.setattr("shapeshift.renderer.pace.measure_pace", lambda *_: ())  # a second a call
    folder, sizes = captures["shared"].folder, {"max_anchors": 90, "features": 4, "hidden": 8}
    how = {"tolerance_db": 5.0, "seeds": 3, "iterations": 20, "final_iterations": 30}
    files = tmp_path / "command.shift", tmp_path / "library.shift"
    assert command.run(command.Options(folder, files[0], asked=sizes, **how)) == 0
    capsys.readouterr()
    fitted = ss.fit(folder, files[1], **sizes, **how)
    assert capsys.readouterr() == ("", "")
    assert asked[0] == asked[1] and asked[0][1].iterations == 30
    assert files[0].read_bytes() == files[1].read_bytes() and fitted.need == need.as_dict()
    np.testing.assert_array_equal(fitted.model.anchors, read_package(files[0]).anchors)
    unwritten = ss.fit(folder, seeds=1)
    assert unwritten.path is None and asked[2][0].iterations == 600 and asked[2][3] == 1


def test_the_chosen_model_is_trained_once_more(captures):
    steps = []
    fit = Fit(
        open_device("cpu"), captures["shared"], replace(SMALL, iterations=20), 9.0, 1,
        lambda what, done: steps.append(what), (), replace(SMALL, iterations=50),
    )  # fmt: skip
    need = fit.run()
    assert steps.count("the largest") == 20 and steps.count("the chosen model") == 50
    assert need.settings.iterations == need.fitted.models[0].provenance["iterations"] == 50
    assert need.full.models[0].provenance["iterations"] == 20
    before, after = (np.mean(list(m.psnr.values())) for m in (need.full, need.fitted))
    assert after > before + 1


def test_too_few_photos_to_tell_are_refused(captures):
    capture = captures["shared"]
    photos = [p for p in capture.photos if p.split == "train" or "test_000" in p.path.name]
    one = replace(capture, photos=tuple(photos))
    with pytest.raises(BadFile, match=r"1 photos of 'RGB' are held out.*or give --seeds 2"):
        needs(one, ())
    none = replace(capture, photos=tuple(p for p in photos if p.split == "train"))
    with pytest.raises(BadFile, match=r"0 photos of 'RGB' are held out.*with split 'test'."):
        needs(none, ())


def test_a_trial_that_ends_unsettled_is_refused(captures, monkeypatch):
    monkeypatch.setattr("shapeshift.training.train.Trainer.settled", False)
    with pytest.raises(BadFile, match="of 2 steps ends while new anchors still settle"):
        needs(captures["shared"], (), replace(SMALL, iterations=2))


def test_a_last_run_that_cannot_be_is_refused_before_the_trials(captures, tmp_path):
    options = command.Options(captures["shared"].folder, tmp_path / "fit.shift", final_seconds=-1.0)
    with pytest.raises(UsageError, match=r"seconds is -1\.0"):
        command.run(options)


@pytest.mark.parametrize("wrong", [{"seeds": 0}, {"tolerance_db": -1.0}, {"tolerance_db": np.nan}])
def test_options_that_cannot_be(captures, tmp_path, wrong):
    options = command.Options(captures["shared"].folder, tmp_path / "fit.shift", **wrong)
    with pytest.raises(UsageError, match=r"--(seeds|tolerance-db) is"):
        command.run(options)
