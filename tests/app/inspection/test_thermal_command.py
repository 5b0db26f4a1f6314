"""launch.py thermal: values of a wall that is known, files that it writes, refusals."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.document import Document
from shapeshift.app.drawing import open_renderer
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.draw_values import (
    ValueChoice,
    draw_values,
    measured_scene,
    value_of_colors,
)
from shapeshift.app.inspection.held_out import held_out_error
from shapeshift.app.inspection.pictures import (
    ColorScale,
    alarm_picture,
    auto_ends,
    heat_picture,
    scale_ticks,
)
from shapeshift.renderer.colors.palette import PALETTES, palette_values
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.write_cameras import write_cameras
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation
from shapeshift.scene.inspection.marks import Isotherm, Mark, read_mark, spot_at
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import make_random_model
from tests.support.scene.flir_files import write_flir
from tests.support.scene.warm_wall import STOPS, celsius_at, traced, wall_view, write_wall
from tests.support.splat_scenes import one_splat

PIXEL_C = 0.8  # °C across a pixel, 15 mm: splats in order lean to the nearer ones by less
NO_GL = ("--context", "none")


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    return write_wall(tmp_path_factory.mktemp("wall") / "wall")


@pytest.fixture(scope="module")
def cameras(tmp_path_factory):
    views = (wall_view(), wall_view((0.5, 0.2, 1.4)))
    path = tmp_path_factory.mktemp("cameras") / "cameras.json"
    write_cameras(CameraList(views, ("",) * 2, "test"), path, "ours")
    return path


@pytest.fixture(scope="module")
def drawn(wall):
    """The wall's values in the first view."""
    document = Document.of(read_model(wall))
    with open_renderer("none", "tiles") as (renderer, _):
        return draw_values(renderer, measured_scene(document), wall_view())


def thermal(*arguments) -> int:
    return cli.main(["thermal", *map(str, arguments), *NO_GL])


def refused(capsys, *arguments) -> str:
    """The sentence with which the command refuses."""
    assert thermal(*arguments) == 2
    said = capsys.readouterr().err.strip()
    assert len(said.splitlines()) == 1, said
    return said


def test_values_and_depths_are_those_of_the_wall(drawn):
    """Splats of a straight line keep it to one of their spacings, half a degree; 1.5 m away a wall
    that is 1 mm thick is hit within 3 mm."""
    inner = (slice(10, -10), slice(10, -10))
    assert drawn.known[inner].all() and not drawn.known[0, 0]
    wanted = celsius_at(drawn.points[..., 0])
    assert np.abs(drawn.values - wanted)[inner].max() < 0.5
    assert np.abs(drawn.depth_m - 1.5)[inner].max() < 0.003
    assert (drawn.unit, drawn.value_range) == ("°C", (0.0, 100.0))


def test_half_a_coverage_decides_what_is_known(wall):
    model = read_model(wall)
    for opacity, known in ((0.02, False), (0.99, True)):
        thin = replace(model, opacity=np.full_like(model.opacity, opacity))
        with open_renderer("none", "tiles") as (renderer, _):
            values = draw_values(renderer, measured_scene(Document.of(thin)), wall_view())
        assert values.known[36, 48] == known
        spot = Mark("Sp1", "spot", np.zeros((1, 3)))
        assert read_mark(spot, values).samples == int(known)


def test_a_mark_reads_the_same_from_another_view(wall, drawn):
    document = Document.of(read_model(wall))
    spot = spot_at("Sp1", drawn, (60.0, 30.0))
    with open_renderer("none", "tiles") as (renderer, _):
        for eye in ((0.5, 0.2, 1.4), (-0.6, 0.3, 1.3), (0.1, -0.5, 1.5)):
            view = wall_view(eye, (192, 144))  # pixels half as wide as where it was laid
            seen = draw_values(renderer, measured_scene(document), view)
            reading = read_mark(spot, seen)
            assert reading.mean == pytest.approx(celsius_at(spot.points[0, 0]), abs=PIXEL_C)


def test_colours_of_a_known_palette_are_looked_up():
    """Luminance of ironbow only grows, so every colour has one place: to half a fine step."""
    share = np.linspace(0, 1, 1001)
    for palette in ("ironbow", "gray", "rainbow", "arctic", "perceptual"):
        found, away = value_of_colors(palette_values(share, palette), palette)
        assert np.abs(found - share).max() < 1e-3 and away.max() < 0.02
    _, away = value_of_colors(np.array([[0.0, 1.0, 0.0]]), "ironbow")
    assert away[0] > 0.3  # green is none of its colours


def test_what_looking_up_colours_costs_is_said(wall, cameras, capsys):
    words = ("--stop", "Thermal", "--spot", "48,36", "--camera", cameras)
    assert thermal(wall, *words) == 0
    assert "looked up" not in capsys.readouterr().out  # values are values
    far = {}
    for palette in ("gray", "ironbow"):  # the wall's values are grays
        assert thermal(wall, *words, "--colors", palette) == 0
        said = capsys.readouterr().out
        far[palette] = float(re.search(r"pixels are ([\d.]+) or less", said)[1])
    assert far["gray"] < 0.01 < 0.1 < far["ironbow"]


def test_emissivity_is_of_all_or_of_one_mark_and_is_kept(wall, cameras, tmp_path, capsys):
    marks = tmp_path / "kept.marks.json"
    words = ("--camera", cameras, "--marks", marks)
    assert thermal(wall, "--spot", "a=48,36", "--spot", "b=48,36", *words, "--save") == 0
    plain = read_of(capsys.readouterr().out, "a")
    given = ("--emissivity", "0.8", "b=0.5", "--reflected", "10")
    assert thermal(wall, *words, *given, "--save", "--csv", tmp_path / "a.csv") == 0
    said = capsys.readouterr().out
    assert "temperatures of surfaces: emissivity 0.8, 10 °C reflected; an error" in said
    emission = Emission(SurfaceRadiation(0.8, 10.0))
    for name, share in (("a", 0.8), ("b", 0.5)):
        want = emission.corrected(np.array(plain), "°C", share)
        assert read_of(said, name) == pytest.approx(float(want), abs=0.2)  # printed tenths
    rows = {row["mark"]: row["emissivity"] for row in csv.DictReader((tmp_path / "a.csv").open())}
    assert rows == {"a": "0.8000", "b": "0.5000"}
    assert thermal(wall, *words) == 0  # kept
    again = capsys.readouterr().out
    assert [read_of(again, n) for n in "ab"] == [read_of(said, n) for n in "ab"]


def test_what_the_camera_was_set_to_comes_from_its_photo(wall, cameras, tmp_path, capsys):
    """Alone it changes no value; another emissivity is then instead of the camera's own."""
    pytest.importorskip("flyr", reason="the optional extra thermal is not installed")
    photo = write_flir(tmp_path / "a.jpg", np.full((3, 4), 30.0), (4, 3))
    words = ("--camera", cameras, "--spot", "a=48,36")
    readings = []
    for more in ((), ("--taken-as", photo), ("--taken-as", photo, "--emissivity", "0.8")):
        assert thermal(wall, *words, *more) == 0
        readings.append(read_of(capsys.readouterr().out, "a"))
    assert readings[0] == readings[1]
    want = Emission(SurfaceRadiation(0.8, 20.0)).corrected(np.array(readings[0]), "°C")
    assert readings[2] == pytest.approx(float(want), abs=0.2)  # printed tenths
    assert thermal(wall, *words, "--taken-as", photo, "--unit", "K") == 2
    assert "'K': give --taken-with and --taken-air" in capsys.readouterr().err
    assert thermal(wall, *words, "--taken-as", tmp_path / "no.jpg") == 2
    assert "--taken-as: " in capsys.readouterr().err


def read_of(said: str, name: str) -> float:
    """The mean that the printed table has for a mark."""
    row = next(line for line in said.splitlines() if re.match(rf"\W*{name}\s", line))
    mean = row.split("│")[4]  # its unit may stand below it
    return float(re.match(r"\s*([-\d.]+)", mean)[1])


@pytest.mark.parametrize(
    "words,said",
    [
        (("0.05",), "the emissivity is 0.05; a number from 0.1 to 1"),
        (("b=x",), "a number from 0.1 to 1 is wanted, or NAME=NUMBER"),
        (("Q=0.5",), "no mark and no object is called 'Q'; there are scene."),
        (("0.5", "0.6"), "has 0.5 and 0.6 for all; one is wanted"),
        (("0.5", "--unit", "bar"), "'bar'; emissivity is of temperatures in °C, °F or K"),
        (("0.5", "--reflected", "5000"), "the reflected temperature is 5000"),
        (("0.5", "--taken-with", "0", "20"), "the emissivity is 0;"),
    ],
)
def test_wrong_emissivities_are_one_sentence(wall, cameras, words, said, capsys):
    assert thermal(wall, "--camera", cameras, "--emissivity", *words) == 2
    assert said in capsys.readouterr().err


def test_command_prints_writes_and_keeps(wall, cameras, tmp_path, capsys):
    out, table, marks = tmp_path / "a.png", tmp_path / "a.csv", tmp_path / "kept.marks.json"
    words = (
        wall, "--camera", cameras, "--spot", "mid=48,36", "0.2,0,0", "--box", "20,20,40,50",
        "--line", "10,36,86,36", "--circle", "0,0,0,0.1", "--difference", "Sp1,mid",
        "--above", 60, "--between", 20, 30, "--out", out, "--csv", table, "--marks", marks,
        "--save",
    )  # fmt: skip
    assert thermal(*words) == 0
    said = capsys.readouterr().out
    assert "Sp1 less mid: 10." in said or "Sp1 less mid: 9.9" in said
    rows = {row["mark"]: row for row in csv.DictReader(table.open())}
    assert float(rows["mid"]["mean"]) == pytest.approx(50, abs=0.5)
    assert float(rows["Sp1"]["mean"]) == pytest.approx(60, abs=0.5)
    assert float(rows["Ci1"]["max"]) == pytest.approx(55, abs=1)
    assert float(rows["Sp1"]["depth_m"]) == pytest.approx(1.5, abs=0.01)
    profile = list(csv.reader((tmp_path / "a.Li1.csv").open()))
    assert profile[0] == ["metres", "°C"] and len(profile) > 50
    assert Image.open(out).height == 72 and np.asarray(Image.open(out)).std() > 20
    assert [m["name"] for m in json.loads(marks.read_text())["marks"]] == [
        "mid", "Sp1", "Li1", "Ci1", "Ar1",
    ]  # fmt: skip
    # the same marks from another view, without laying them again
    again = (wall, "--camera", cameras, "--view", 1, "--marks", marks, "--csv", tmp_path / "b.csv")
    assert thermal(*again, "--forget", "Ar1") == 0
    rows = {row["mark"]: row for row in csv.DictReader((tmp_path / "b.csv").open())}
    assert float(rows["Sp1"]["mean"]) == pytest.approx(60, abs=PIXEL_C) and "Ar1" not in rows
    assert len(json.loads(marks.read_text())["marks"]) == 5  # without --save nothing is written


def test_names_are_no_formulas_in_tables(wall, cameras, tmp_path):
    table = tmp_path / "a.csv"
    assert thermal(wall, "--camera", cameras, "--spot", "=1+1=48,36", "--csv", table) == 0
    assert [row["mark"] for row in csv.DictReader(table.open())] == ["'=1+1"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--spot", "1,2,3,4"), "column,row in pixels"),
        (("--spot", "a=b"), "expected numbers"),
        (("--spot", "nan,1"), "expected numbers"),
        (("--spot", "500,20"), "outside of the picture"),
        (("--spot", "0,0"), "covers less than half"),
        (("--spot", "9,9,9"), "outside of the scene"),
        (("--circle", "48,36,0"), "radius"),
        (("--line", "0,0,3,0"), "covers by a half"),
        (("--difference", "A,B"), "no mark is called 'A'"),
        (("--between", "5", "5"), "lower value first"),
        (("--palette", "blue"), "no palette 'blue'"),
        (("--stop", "Cold"), "no stop 'Cold'"),
        (("--stop", "RGB"), "--range LOW HIGH"),
        (("--stop", "RGB", "--range", "0", "1"), "--colors NAME"),
        (("--range", "5", "1"), "lower one first"),
        (("--colors", "none"), "no palette 'none'"),
        (("--span", "0"), "--span is 0"),
        (("--auto", "--level", "5"), "--auto"),
        (("--level", "5"), "--level is of pictures"),
        (("--palette", "gray"), "--palette is of pictures"),
        (("--view", "2"), "cameras 0 to 1"),
        (("--out", "a.jpg"), ".png"),
        (("--csv", "a.txt"), ".csv"),
        (("--marks", "none.marks.json"), "does not exist"),
        (("--forget", "Sp1"), "no mark is called 'Sp1'"),
        (("--photo", "Film"), "the scene has RGB, Thermal"),
    ],
)
def test_what_cannot_be_is_one_sentence(wall, cameras, capsys, words, sentence):
    assert sentence in refused(capsys, wall, "--camera", cameras, *words)


def test_scenes_without_heat_or_range_are_one_sentence():
    plain = make_random_model(20)
    without = replace(plain, stops=(Stop("A", 0.0), Stop("B", 1.0)))
    with pytest.raises(UsageError, match=r"no thermal stop \(it has A, B\)"):
        measured_scene(Document.of(without))
    unknown = replace(plain, stops=(Stop("A", 0.0), Stop("T", 1.0, "thermal", "ironbow")))
    with pytest.raises(UsageError, match="--range LOW HIGH"):
        measured_scene(Document.of(unknown))
    said = measured_scene(Document.of(unknown), ValueChoice(value_range=(0, 9), unit="K"))
    assert (said.stop.value_range, said.stop.unit) == ((0.0, 9.0), "K")


def test_nothing_is_overwritten_unasked(wall, cameras, tmp_path, capsys):
    out = tmp_path / "a.png"
    out.write_text("mine")
    assert "exists" in refused(capsys, wall, "--camera", cameras, "--out", out)
    assert out.read_text() == "mine"


def test_pictures_of_values(drawn):
    scale = ColorScale(20.0, 80.0, "white-hot")
    heat = heat_picture(drawn, scale)
    row = heat[36, 12:-12, 0]
    wanted = np.clip((drawn.values[36, 12:-12] - 20) / 60, 0, 1)
    np.testing.assert_allclose(row, wanted, atol=0.01)
    below = np.full((*drawn.values.shape, 3), 0.5, np.float32)
    alarms = alarm_picture(below, drawn, [Isotherm("above", low=60.0)])
    red = (alarms[..., 0] > alarms[..., 1] + 0.2) & drawn.known
    np.testing.assert_array_equal(red, drawn.values > 60)
    low, high = auto_ends(drawn.values)
    known = drawn.values[drawn.known]
    assert known.min() <= low < high <= known.max()
    with pytest.raises(ValueError, match="nothing is covered"):
        auto_ends(np.full((2, 2), np.nan))
    assert (ColorScale(20, 80, "gray").level, ColorScale(20, 80, "gray").span) == (50, 60)


@pytest.mark.parametrize(("low", "high"), [(15, 95), (0, 1), (-1e-3, 2e-3), (20.0, 20.1), (0, 9e5)])
def test_ticks_are_round_and_inside(low, high):
    ticks = scale_ticks(low, high, 6)
    assert 2 <= len(ticks) <= 8 and low <= min(ticks) and max(ticks) <= high + 1e-9
    assert np.ptp(np.diff(ticks)) == pytest.approx(0, abs=1e-9 * (high - low))


def test_thermal_cameras_palettes_are_there():
    assert {"white-hot", "black-hot", "rainbow", "arctic"} <= PALETTES.keys()
    assert STOPS[1].palette in PALETTES


def test_the_held_out_error_is_what_the_photos_are_off_by(wall, tmp_path):
    """Photos of the formula plus 5 °C, cut out by their alpha: 5 °C, but for edges and bytes."""
    photos = []
    for number, eye in enumerate([(0, 0, 1.5), (0.5, 0.2, 1.4)]):
        truth = traced(eye, (192, 144))
        grey = np.nan_to_num((truth.values + 5) / 100 * 255 + 0.5).astype(np.uint8)
        alpha = np.where(truth.known, 255, 0).astype(np.uint8)
        path = tmp_path / f"{number}.png"
        Image.fromarray(np.dstack([grey, grey, grey, alpha])).save(path)
        photos.append(Photo(truth.view, path, "Thermal", None, "test"))
    none = np.zeros((0, 3), np.float32)
    capture = Capture(tmp_path, STOPS, tuple(photos), none, none, (0.0, 0.0, 0.0), {})
    document = Document.of(read_model(wall))
    with open_renderer("none", "tiles") as (renderer, _):
        thermal_stop = measured_scene(document)
        error = held_out_error(renderer, thermal_stop, document, capture)
        assert (error.photos, error.mean) == (2, pytest.approx(5, abs=0.3))
        assert error.percentile_95 == pytest.approx(5, abs=1.0)
        train = tuple(replace(photo, split="train") for photo in photos)
        with pytest.raises(BadFile, match="is held out for testing"):
            held_out_error(renderer, thermal_stop, document, replace(capture, photos=train))


def test_what_has_no_heat_hides_heat_and_has_none(wall, drawn):
    """A white ball before the wall: unknown where it is, the wall's degrees around it."""
    ball = SceneObject("ball", one_splat(means=[[0, 0, 0.4]], opacity=[0.99]))
    document = Document(Scene((SceneObject("wall", read_model(wall), x=1.0), ball)))
    with open_renderer("none", "tiles") as (renderer, _):
        values = draw_values(renderer, measured_scene(document), wall_view())
    assert not values.known[36, 48] and values.known[36, 20]
    beside = np.s_[15:-15, 15:25]
    assert np.abs(values.values - drawn.values)[beside].max() < 0.2
    spot = Mark("Sp1", "spot", np.zeros((1, 3)))
    assert read_mark(spot, values).samples == 0


def test_objects_that_mean_another_range_are_refused(wall):
    model = read_model(wall)
    other = replace(model, stops=(STOPS[0], replace(STOPS[1], value_range=(0.0, 50.0))))
    pair = (SceneObject("a", model), SceneObject("b", other))
    with pytest.raises(UsageError, match="different palettes, ranges or units"):
        measured_scene(Document(Scene(pair)))


def test_marks_have_notes_and_photos_that_go_into_reports(wall, tmp_path, capsys):
    """Kept by one call, shown by the next, taken away by a third."""
    photo, marks, report = (tmp_path / name for name in ("a.png", "w.marks.json", "r.html"))
    Image.new("RGB", (900, 600), (10, 200, 30)).save(photo)
    common = ("thermal", str(wall), "--marks", str(marks), "--drawing", "tiles", *NO_GL)
    laid = ("--spot", "pump=320,240", "--remark", "pump=worn = hot", "--mark-photo")
    assert cli.main([*common, *laid, f"pump={photo}", "--save"]) == 0
    (mark,) = json.loads(marks.read_text())["marks"]
    assert mark["note"] == "worn = hot" and len(mark["photo"]) > 100
    assert cli.main([*common, "--report", str(report), str(report.with_suffix(".pdf"))]) == 0
    text = report.read_text()
    assert "pump: worn = hot" in text and text.count("data:image/png") == 3  # and two of the view
    assert report.with_suffix(".pdf").read_bytes().count(b"/Subtype /Image") >= 3
    assert cli.main([*common, "--remark", "pump=", "--mark-photo", "pump=", "--save"]) == 0
    (mark,) = json.loads(marks.read_text())["marks"]
    assert "note" not in mark and "photo" not in mark
    capsys.readouterr()
    for wrong in (("--remark", "fan=x"), ("--mark-photo", "pump"), ("--mark-photo", "pump=no.jpg")):
        assert cli.main([*common, *wrong]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and ("pump" in said or "no.jpg" in said)
