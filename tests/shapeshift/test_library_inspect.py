"""Degrees, depths, marks and lengths through the library, on a wall that is known."""

import json
import math
from datetime import datetime
from types import SimpleNamespace

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.scene.inspection import laying
from shapeshift.scene.inspection.marks_file import MarksFile, write_marks_file
from tests.support.scene.warm_wall import celsius_at, wall_view, write_wall

PIXEL_C = 0.8  # °C across a pixel of the view


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return ss.load(write_wall(tmp_path_factory.mktemp("wall") / "wall"))


def of_half_a_mirror(celsius: float) -> float:
    """°C of what sends half its radiation beside half that of 20 °C, where both look like this."""
    photons = [math.expm1(14387.77 / 9.8 / (c + 273.15)) ** -1 for c in (celsius, 20.0)]
    return 14387.77 / 9.8 / math.log1p(1 / (2 * photons[0] - photons[1])) - 273.15


def test_degrees_and_metres_at_pixels_and_places(scene):
    view = wall_view()
    seen = scene.values(view)
    assert isinstance(seen, ss.ValuePicture) and seen.unit == "°C"
    assert scene.temperature((48, 36), view) == pytest.approx(celsius_at(0), abs=PIXEL_C)
    assert scene.temperature((0.2, 0.1, 0.0), view) == pytest.approx(60, abs=PIXEL_C)
    assert scene.temperature((0.2, 0.1, 0.0)) == pytest.approx(60, abs=0.3)  # small pixels
    bare = scene.temperature((0.2, 0.1, 0.0), emissivity=0.5)
    assert bare == pytest.approx(of_half_a_mirror(60.0), abs=0.6)
    with pytest.raises(ss.UsageError, match="the emissivity is 7"):
        scene.values(view, emissivity=7)
    assert scene.depth((48, 36), view) == pytest.approx(1.5, abs=0.003)
    for nothing in ((0.5, 0.5), (500, 20), (0.2, 0.1, -0.5)):
        assert math.isnan(scene.temperature(nothing, view))
    assert math.isnan(scene.temperature((0.0, 0.0, 3.0)))  # in the air
    assert math.isnan(scene.depth((0.5, 0.5), view))


def test_marks_beside_a_scene_are_read(scene, tmp_path):
    marks = (ss.Mark("Sp1", "spot", np.array([(0.2, 0.0, 0.0)])),)
    (reading,) = scene.read_marks(marks, wall_view())
    assert isinstance(reading, ss.MarkReading)
    assert reading.mean == pytest.approx(60, abs=PIXEL_C)
    with pytest.raises(ss.BadFile, match=r"wall\.marks\.json"):
        scene.read_marks(camera=wall_view())
    write_marks_file(MarksFile(marks), scene.path.with_name("wall.marks.json"))
    for given in (None, str(scene.path.with_name("wall.marks.json"))):
        (again,) = scene.read_marks(given, wall_view())
        assert again.mean == reading.mean


def test_lengths_come_with_their_uncertainty(scene):
    view = wall_view()
    wide = scene.measure("distance", (20, 36), (76, 36), camera=view)
    truth = 56 * 1.5 / view.pinhole()[1]
    assert abs(wide.value - truth) <= 2 * wide.uncertainty and wide.unit == "m"
    known = ((20, 36), (76, 36), 10.0)
    scaled = scene.measure("distance", (20, 36), (48, 36), camera=view, known=known)
    assert scaled.value == pytest.approx(5, abs=2 * scaled.uncertainty)
    assert scene.measure("angle", (1, 0, 0), (0, 0, 0), (0, 1, 0), camera=view).value == 90
    for places in (((0, 0), (48, 36)), ((48, 36),), ((1, 2, 3, 4), (48, 36))):
        with pytest.raises(ss.UsageError, match=r"^[^\n]+\.$"):
            scene.measure("distance", *places, camera=view)


def test_an_inspection_is_that_of_the_command(scene, tmp_path, capsys, monkeypatch):
    from shapeshift.app import cli
    from shapeshift.scene.cameras.camera_list import CameraList
    from shapeshift.scene.cameras.write_cameras import write_cameras

    at_noon = SimpleNamespace(now=lambda: datetime(2026, 1, 2, 12))  # of both layings
    monkeypatch.setattr(laying, "datetime", at_noon)
    cameras, table = tmp_path / "cameras.json", tmp_path / "a.csv"
    write_cameras(CameraList((wall_view(),), ("",), "test"), cameras, "ours")
    marks = {"spot": ("mid=48,36", "0.2,0,0"), "line": "10,36,86,36"}
    words = ["--spot", *marks["spot"], "--line", marks["line"], "--above", "60", "--marks",
             str(tmp_path / "a.marks.json"), "--save", "--csv", str(table)]  # fmt: skip
    words = ["thermal", str(scene.path), "--camera", str(cameras), *words]
    assert cli.main([*words, "--out", str(tmp_path / "a.png")]) == 0
    capsys.readouterr()
    kept = {"marks": tmp_path / "b.marks.json", "save": True, "csv": tmp_path / "b.csv"}
    found = scene.thermal(cameras, **marks, **kept, above=60.0, out=tmp_path / "b.png")
    assert capsys.readouterr() == ("", "")
    for name in ("csv", "Li1.csv", "marks.json", "png"):
        assert (tmp_path / f"b.{name}").read_bytes() == (tmp_path / f"a.{name}").read_bytes(), name
    assert isinstance(found, ss.Inspection)
    readings = {reading.mark.name: reading.mean for reading in found.views[0].readings}
    assert readings["Sp1"] == pytest.approx(60, abs=PIXEL_C)
    assert found.views[0].isotherms[0].share > 0


def test_a_length_is_kept_and_reported_as_by_the_command(scene, tmp_path, capsys):
    from shapeshift.app import cli

    folder = scene.path.parent
    beside, report = folder / "wall.marks.json", tmp_path / "l.html"
    before = beside.read_bytes() if beside.exists() else None
    ends, left = ("-0.2,0,0", "0.3,0,0"), []
    words = ["measure", str(scene.path), "--distance", *ends, "--keep", "--overwrite", "--report"]
    for by_command in (True, False):
        beside.unlink(missing_ok=True)
        if by_command:
            assert cli.main([*words, str(report), "--json"]) == 0
            (row,) = json.loads(capsys.readouterr().out)["measurements"]
        else:
            made = scene.measure("distance", (-0.2, 0, 0), (0.3, 0, 0), size=(640, 480), keep=True,
                                 report=[report], overwrite=True)  # fmt: skip
            assert capsys.readouterr() == ("", "")
            assert row == {name: getattr(made, name) for name in row}
        left.append(beside.read_bytes())
    assert left[0] == left[1]
    beside.unlink()
    if before is not None:
        beside.write_bytes(before)


def test_scenes_without_heat_say_so(scene):
    with pytest.raises(ss.UsageError, match="no stop 'Steam'"):
        scene.values(wall_view(), stop="Steam")
    plain = ss.Scene.from_splats(scene.splats("RGB"))
    with pytest.raises(ss.UsageError, match="no thermal stop"):
        plain.temperature((0, 0, 0))
    with pytest.raises(ss.UsageError, match="lies in no file"):
        plain.read_marks()
