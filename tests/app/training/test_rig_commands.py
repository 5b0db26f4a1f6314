"""--calibrate of train, table and fit: what was found goes for all that they do, and is kept."""

import csv
import json

import numpy as np
import pytest

from shapeshift.app.errors import UsageError
from shapeshift.app.training import fit, table
from shapeshift.app.training.evaluate import Options as EvalOptions
from shapeshift.app.training.evaluate import run as evaluate
from shapeshift.app.training.train import Options as TrainOptions
from shapeshift.app.training.train import run as train
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.calibration import calibrate as calibration
from shapeshift.training.calibration.extrinsics import (
    moved_by,
    offset_capture,
    offset_of_matrix,
    rig_of,
)
from shapeshift.training.synthetic.balls import make_balls
from tests.support.training.settings_files import settings_file

PLANTED = moved_by(np.array([0.1, -0.2, 0.05, 0.1, 0.05, -0.1]))
ASKED = {"max_anchors": 300, "iterations": 20}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A capture, and the same with cameras of Thermal beside where they stood."""
    right, wrong = (
        make_balls(tmp_path_factory.mktemp(name), size=48, views=8, test_views=2)
        for name in ("right", "wrong")
    )
    write_capture(offset_capture(wrong, "Thermal", np.linalg.inv(PLANTED)))
    return right.folder, wrong.folder


@pytest.fixture
def asked(monkeypatch) -> list[str]:
    """What was looked for; the planted offset is found at once."""
    found = []

    def calibrate(device, capture, settings, modality, **more):
        found.append(modality)
        return offset_of_matrix(PLANTED, 3.0)

    monkeypatch.setattr(calibration, "calibrate", calibrate)
    return found


def decibels(path, capture, capsys, modality: str) -> float:
    capsys.readouterr()
    assert evaluate(EvalOptions(path, capture, modality=modality, json=True)) == 0
    return json.loads(capsys.readouterr().out)["modalities"][modality]["psnr_db"]


def test_a_table_of_wrong_poses_is_that_of_right_ones(folders, asked, tmp_path, capsys):
    rows, out = [], tmp_path
    for folder, calibrate in zip(folders, (None, "Thermal"), strict=True):
        out = tmp_path / folder.name
        options = table.Options(
            folder, out, {"max_anchors": 300}, methods=("joint", "separate", "splats"),
            settings=settings_file(tmp_path, max_splats=300), calibrate=calibrate, iterations=20,
            device="cpu",
        )  # fmt: skip
        assert table.run(options) == 0
        lines = (out / "table.csv").read_text().splitlines()
        rows.append([float(row["psnr_db"]) for row in csv.DictReader(lines[3:])])
    assert len(rows[0]) == 9 and asked == ["Thermal"]
    np.testing.assert_allclose(rows[1], rows[0], atol=0.1)
    assert "--calibrate Thermal" in lines[0]
    assert table.run(options) == 0 and asked == ["Thermal"]  # it is kept
    shown = decibels(out / "joint.shift", folders[1], capsys, "Thermal")
    assert shown == pytest.approx(rows[0][1], abs=0.1)


def test_separate_models_keep_it(folders, asked, tmp_path, capsys):
    options = TrainOptions(
        folders[1], tmp_path / "out", ASKED, separate=True, calibrate="Thermal", device="cpu"
    )
    assert train(options) == 0 and asked == ["Thermal"]
    files = sorted((tmp_path / "out").glob("*.shift"))
    rigs = [json.loads(rig_of(read_package(file).provenance)) for file in files]
    assert len(rigs) == 2
    np.testing.assert_allclose(rigs[1]["Thermal"], PLANTED.ravel(), atol=1e-8)
    right, wrong = (decibels(files[1], folder, capsys, "Thermal") for folder in folders)
    assert wrong > right + 0.5  # its package moves both; only the wrong ones come right


def test_fit_keeps_it(folders, asked, tmp_path, monkeypatch):
    from shapeshift.training.fit.fit import Fit

    monkeypatch.setattr("shapeshift.training.fit.fit.COMPONENTS", ())
    monkeypatch.setattr(Fit.__init__, "__defaults__", ((), None))
    monkeypatch.setattr(Fit, "prune_models", lambda self: None)
    out = tmp_path / "fit.shift"
    options = fit.Options(
        folders[1], out, {"max_anchors": 300}, calibrate="Thermal", seeds=1, iterations=20,
        device="cpu",
    )  # fmt: skip
    assert fit.run(options) == 0 and asked == ["Thermal"]
    kept = json.loads(rig_of(read_package(out).provenance))
    np.testing.assert_allclose(kept["Thermal"], PLANTED.ravel(), atol=1e-8)


def test_what_cannot_keep_an_offset_says_so(tmp_path):
    options = TrainOptions(tmp_path, tmp_path / "out", model="splats", calibrate="Thermal")
    with pytest.raises(UsageError, match="PLY files of plain splats cannot keep the offset"):
        train(options)
    options = TrainOptions(tmp_path, tmp_path / "out.shift", resume=True, calibrate="Thermal")
    with pytest.raises(UsageError, match="--resume goes on with the checkpoint's offset"):
        train(options)
