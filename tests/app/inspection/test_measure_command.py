"""launch.py measure on a wall that is known: figures within their uncertainty, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.write_cameras import write_cameras
from shapeshift.scene.inspection.lengths import Scale
from shapeshift.scene.inspection.marks import Mark
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    marks_path,
    read_marks_file,
    write_marks_file,
)
from tests.support.scene.warm_wall import wall_view, write_wall


@pytest.fixture(scope="module")
def words(tmp_path_factory):
    """The command's first words: the wall, seen in a view of 96x72 pixels."""
    folder = tmp_path_factory.mktemp("wall")
    view = wall_view()
    write_cameras(CameraList((view,), ("",), "test"), folder / "cameras.json", "ours")
    wall = write_wall(folder / "wall")
    return ["measure", str(wall), "--camera", str(folder / "cameras.json"), "--context", "none"]


def test_figures_lie_within_their_uncertainty(words, capsys):
    pixel = 1.5 / wall_view().pinhole()[1]  # metres on the wall
    corners = ["20,20", "60,20", "60,50", "20,50"]
    more = ["--distance", "20,36", "76,36", "--polyline", *corners[:3]]
    more += ["--angle", *corners[:3], "--area", *corners]
    assert cli.main([*words, *more, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["measurements"]
    wanted = [56 * pixel, 70 * pixel, 90.0, 1200 * pixel**2]
    assert [row["unit"] for row in rows] == ["m", "m", "degrees", "m²"]
    for row, value in zip(rows, wanted, strict=True):
        assert abs(row["value"] - value) <= 2 * row["uncertainty"]
        assert 0 < row["uncertainty"] < 0.05 * value


def test_a_known_length_scales_the_rest(words, capsys):
    more = ["--known", "20,36", "76,36", "14", "--distance", "20,36", "48,36"]
    assert cli.main([*words, *more]) == 0
    said = capsys.readouterr().out
    assert said.startswith("distance: 7.") or said.startswith("distance: 6.9")
    assert cli.main([*words, "--distance", "0,0,0", "0,3,4"]) == 0
    assert capsys.readouterr().out == "distance: 5.0000 ± 0.0000 m\n"


def test_a_scale_is_kept_beside_the_scene(words, capsys):
    """By --save, for this command and for Python; other marks of the file stay."""
    beside = marks_path(Path(words[1]))
    write_marks_file(MarksFile((Mark("Sp1", "spot", np.zeros((1, 3))),)), beside)
    try:
        assert cli.main([*words, "--known", "0,0,0", "0,0,2", "5", "--save"]) == 0
        assert "scale 2.5" in capsys.readouterr().err
        assert [mark.name for mark in read_marks_file(beside).marks] == ["Sp1"]
        assert cli.main([*words, "--distance", "0,0,0", "0,3,4"]) == 0
        said = capsys.readouterr()
        assert said.out == "distance: 12.5000 ± 0.0000 m\n" and "multiplied by 2.5" in said.err
        found = ss.load(words[1]).measure("distance", (0, 0, 0), (0, 3, 4), size=(32, 24))
        assert found.value == pytest.approx(12.5)
        assert cli.main([*words, "--distance", "0,0,0", "0,3,4", "--save"]) == 2
        assert "--known" in capsys.readouterr().err
    finally:
        beside.unlink()


def test_what_was_measured_is_kept_in_a_unit_and_reported(words, tmp_path, capsys):
    """Two calls: L1, then L2 in feet; the report has both, the file their uncertainty."""
    beside, report = marks_path(Path(words[1])), tmp_path / "lengths.html"
    try:
        assert cli.main([*words, "--distance", "20,36", "76,36", "--keep"]) == 0
        one = float(capsys.readouterr().out.split()[1])
        more = ["--distance", "0,0,0", "0,0,0.3048", "--unit", "ft", "--keep", "--report"]
        assert cli.main([*words, *more, str(report), str(report.with_suffix(".pdf"))]) == 0
        assert capsys.readouterr().out == "distance: 1.0000 ft\n"  # places in metres are exact
        kept = read_marks_file(beside).lengths
        assert [each.name for each in kept] == ["L1", "L2"]
        found = kept[0].measured(Scale())
        assert found.value == pytest.approx(one, abs=1e-4) and found.uncertainty > 0
        text = report.read_text()
        assert found.words("ft") in text and "1.0000 ft" in text
        assert report.with_suffix(".pdf").stat().st_size > 2000
        assert cli.main([*words, "--report", str(report)]) == 2
        assert "--overwrite" in capsys.readouterr().err
    finally:
        beside.unlink(missing_ok=True)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ([], "nothing is to be measured"),
        (["--keep"], "keeps what is measured"),
        (["--report", "a.docx"], ".html or .pdf"),
        (["--report", "a.html"], "nothing was measured yet"),
        (["--distance", "20,36"], "2 are wanted"),
        (["--angle", "1,2,3", "1,2,3"], "3 are wanted"),
        (["--distance", "0,0", "48,36"], "covers less than half"),
        (["--distance", "500,0", "48,36"], "the picture ends"),
        (["--distance", "a,b", "48,36"], "expected numbers"),
        (["--distance", "1,2,3,4", "48,36"], "column,row or x,y,z"),
        (["--known", "20,36", "76,36", "0", "--distance", "20,36", "48,36"], "known length"),
        (["--known", "20,36", "20,36", "1", "--distance", "20,36", "48,36"], "apart"),
        (["--view", "3", "--distance", "20,36", "48,36"], "cameras 0 to 0"),
        (["--x", "Steam", "--distance", "20,36", "48,36"], "Steam"),
    ],
)
def test_what_cannot_be_measured_is_one_sentence(words, capsys, more, sentence):
    assert cli.main([*words, *more]) == 2
    said = capsys.readouterr().err.strip()
    assert sentence in said and len(said.splitlines()) == 1
