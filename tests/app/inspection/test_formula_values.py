"""An index by formula, measured: pixel by pixel of its stops' pictures, by every door."""

import json
import re

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.app.document import Document
from shapeshift.app.drawing import open_renderer
from shapeshift.app.inspection.draw_values import ValueChoice, draw_values, measured_scene
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.layers.layer_list import LIST
from tests.support.band_model import band_model
from tests.support.scene.warm_wall import celsius_at, wall_view, write_wall

INDEX = "(nir - red) / (nir + red)"
STOPS = (
    Stop("RGB", 0.0),
    Stop("NIR", 0.3, "values", "gray", (0.0, 1.0)),
    Stop("Red", 0.6, "values", "gray", (0.2, 0.6)),
    Stop("NDVI", 1.0, "values", "turbo", (-0.5, 0.5), "", "", INDEX),
)
NO_GL = ("--context", "none")


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """s = 0.5 + 0.5 x at x metres in the near infrared, 0.2 + 0.4 s in red."""
    return write_wall(tmp_path_factory.mktemp("index") / "wall", STOPS)


def index_at(x_m):
    """By hand: what the wall's index is at x metres."""
    share = celsius_at(x_m) / 100
    red = 0.2 + 0.4 * share
    return (share - red) / (share + red)


def seen(wall, stop: str):
    with open_renderer("none", "tiles") as (renderer, _):
        scene = measured_scene(Document.of(read_model(wall)), ValueChoice(stop))
        return draw_values(renderer, scene, wall_view())


def test_it_is_the_formula_of_the_pictures_of_its_stops(wall):
    nir, red, index = (seen(wall, name) for name in ("NIR", "Red", "NDVI"))
    wanted = (nir.values - red.values) / (nir.values + red.values)
    np.testing.assert_allclose(index.values, wanted, rtol=1e-12)
    assert np.array_equal(index.known, nir.known & red.known)
    assert index.digits == 3 and not index.is_heat and index.may_exceed
    traced = index_at(index.points[..., 0])
    # A pixel is 0.008 of the wall's share; at the wall's end the index has 1.74 times as much.
    assert np.nanmax(np.abs(index.values - traced)) < 0.02


def test_a_mark_a_table_and_a_report_have_it(wall, tmp_path, capsys):
    code = cli.main(["thermal", str(wall), "--stop", "ndvi", "--spot", "0.2,0,0", "--above", "0.2",
                     "--csv", str(tmp_path / "a.csv"), "--report", str(tmp_path / "a.html"),
                     "--size", "96x72", *NO_GL])  # fmt: skip
    said = capsys.readouterr().out
    assert code == 0 and "highest: " in said and "above 0.2" in said
    row = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()[1].split(",")
    assert float(row[5]) == pytest.approx(index_at(0.2), abs=0.005)
    assert "NDVI inspection" in (tmp_path / "a.html").read_text(encoding="utf-8")
    assert cli.main(["thermal", str(wall), "--stop", "ndvi", "--emissivity", "0.9", *NO_GL]) == 2


def changed(wall, folder, **fields):
    """The wall with other words of its last stop."""
    for file in wall.glob("*.ply"):
        (folder / file.name).write_bytes(file.read_bytes())
    said = json.loads((wall / LIST).read_text(encoding="utf-8"))
    said["stops"][-1] |= fields
    (folder / LIST).write_text(json.dumps(said), encoding="utf-8")
    return folder


def test_division_by_zero_is_unknown(wall, tmp_path):
    """Red less itself is 0 everywhere: nothing is known, and nothing fails."""
    folder = changed(wall, tmp_path, formula="nir / (red - red)")
    assert not seen(folder, "NDVI").known.any()
    inner = changed(wall, tmp_path, formula="1 / (nir / (red - red))")  # not 0 either
    assert not seen(inner, "NDVI").known.any()


@pytest.mark.parametrize(
    ("formula", "words"),
    [("(nir - blue) / nir", "no stop 'blue'"), ("1 + 1", "names no stop"), ("rgb", "no values"),
     ("open('x')", "is wanted before '\\('"), ("ndvi", "no stop 'ndvi'"), (5, "formula")],
)  # fmt: skip
def test_packages_and_layers_with_other_formulas_are_refused(wall, tmp_path, formula, words):
    with pytest.raises(BadFile, match=words) as error:
        read_model(changed(wall, tmp_path, formula=formula))
    assert "\n" not in str(error.value)


def test_style_adds_it_and_takes_it_out(tmp_path, capsys):
    path, out = tmp_path / "bands.shift", tmp_path / "ndvi.shift"
    write_package(band_model(), path)
    words = ["style", str(path), "--formula", INDEX, "--name", "NDVI", "--range", "-1", "1"]
    assert (
        cli.main([*words, "--palette", "turbo", "--after", "red", "--no-pace", "--out", str(out)])
        == 0
    )
    said = capsys.readouterr().err
    decibels = [int(n) for n in re.findall(r"(\d+) dB", said)]
    assert len(decibels) == 3 and min(decibels) >= 90 and f"NDVI: new, {INDEX}" in said
    stop = read_package(out).stops[1]
    assert (stop.name, stop.formula, stop.palette, stop.value_range) == (
        "NDVI",
        INDEX,
        "turbo",
        (-1, 1),
    )
    assert cli.main(["info", str(out), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)["stops"][1]
    assert facts["formula"] == INDEX and facts["value_range"] == [-1, 1]
    assert cli.main(["style", str(out), "--remove", "NIR", "--out", str(tmp_path / "a.shift")]) == 2
    assert "by formula of 'NIR'" in capsys.readouterr().err
    back = ["style", str(out), "--remove", "NDVI", "--no-pace", "--out", str(tmp_path / "b.shift")]
    assert cli.main(back) == 0
    scene = ss.load(path).add_formula("Half", "nir / 2", unit="%", pace=False)
    assert [s.name for s in scene.stops][-1] == "Half"


@pytest.mark.parametrize(
    ("words", "said"),
    [(("--formula", "abs(nir)"), "before '\\('"), (("--formula", "blue / red"), "no stop 'blue'"),
     (("--formula", "nir", "--palette", "sunset"), "no palette 'sunset'"),
     (("--formula", "nir", "--unit", "x" * 25), "24 printable"),
     (("--formula", "nir", "--range", "1", "1"), "lower first"),
     (("--formula", "nir", "--shape", "fur"), "leave --shape out"),
     (("--formula", "nir", "--after", "none"), "--after is 'none'"),
     (("--formula", "nir", "--name", "Red"), "has a stop 'Red'"),
     (("--shape", "fur", "--unit", "%"), "--unit is of values by --formula")],
)  # fmt: skip
def test_what_style_cannot_add(tmp_path, capsys, words, said):
    path = tmp_path / "bands.shift"
    write_package(band_model(), path)
    assert cli.main(["style", str(path), *words, "--out", str(tmp_path / "out.shift")]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and re.search(said, lines[0]), lines
    assert not (tmp_path / "out.shift").exists()
