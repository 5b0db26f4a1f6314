"""A mark has one value, and every door says the same: on two walls with three emissivities.

The formula is written anew here: photons of Planck's law at 9.8 micrometres, e of them the
surface's own and the rest those of what it mirrors.
"""

import csv
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.inspection import pictures
from shapeshift.app.inspection.pictures import label_places
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.app.inspection.window.marks_over import label_words
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation
from shapeshift.scene.inspection.marks import (
    BEHIND,
    GONE,
    OUTSIDE,
    Mark,
    box_around,
    read_mark,
)
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    laid,
    read_marks_file,
    surface_picture,
    write_marks_file,
)
from shapeshift.scene.pose import View, look_at
from tests.support.scene.warm_wall import celsius_at, traced, write_wall
from tests.support.web.page_texts import Page

SHARES = {"of all": 0.9, "right": 0.7, "Ar1": 0.5}
ALARM = 100.0  # between what the box has at its hottest and what the wall around it has
AWAY_M = 1.3  # from one wall's middle to the other's
NEAR_C = 1e-3  # between four pixels the formula bends, and values are read between them
MIDDLE = (AWAY_M / 2, 0.0, 0.0)
BOTH = View(look_at((AWAY_M / 2, 0.0, 3.2), MIDDLE), (-0.42, 0.42, -0.19, 0.19), 0.01, 100.0,
            (160, 72))  # fmt: skip
SEEN = ("--camera", "eyes.json", "--context", "none")


def of_surface(celsius: float, share: float, mirrored: float = 20.0) -> float:
    """°C of a surface of which a camera says this."""
    photons = [1 / math.expm1(14387.77 / 9.8 / (c + 273.15)) for c in (celsius, mirrored)]
    own = (photons[0] - (1 - share) * photons[1]) / share
    return 14387.77 / 9.8 / math.log1p(1 / own) - 273.15


@pytest.fixture(scope="module")
def walls(tmp_path_factory) -> Path:
    """Two of the same wall beside each other, of which the right one has its own emissivity."""
    folder = tmp_path_factory.mktemp("walls")
    write_wall(folder / "wall")
    rows = [
        {"name": name, "model": "wall", "up": "+Y",
         "pose": {"position": [x, 0.0, 0.0], "wxyz": [1.0, 0.0, 0.0, 0.0]}}
        for name, x in (("left", 0.0), ("right", AWAY_M))
    ]  # fmt: skip
    path = folder / "walls.scene.json"
    path.write_text(json.dumps({"format": "shapeshift-scene 1", "objects": rows}))
    eye = {"matrix": BOTH.world_from_eye.matrix().tolist(), "tangents": BOTH.tangents,
           "size": BOTH.size}  # fmt: skip
    (folder / "eyes.json").write_text(json.dumps([eye]))
    marks = (
        Mark("Sp1", "spot", np.array([(0.2, 0.0, 0.0)])),
        Mark("Sp2", "spot", np.array([(AWAY_M + 0.2, 0.0, 0.0)])),
        replace(box_around("Ar1", np.array([0.4, 0.0, 0.0]), np.array([0.1, 0.1, 0.1])),
                emissivity=SHARES["Ar1"]),
    )  # fmt: skip
    emission = Emission(SurfaceRadiation(SHARES["of all"], 20.0))
    file = MarksFile(marks, emission=emission, objects=(("right", SHARES["right"]),))
    write_marks_file(file, folder / "walls.marks.json")
    return path


@pytest.fixture(scope="module")
def doors(walls):
    """The scene, and what the library has measured and written of it."""
    folder, scene = walls.parent, ss.load(walls)
    found = scene.thermal(
        BOTH, above=ALARM, report=(folder / "r.html", folder / "r.pdf"),
        csv=folder / "r.csv", out=folder / "r.png",
    )  # fmt: skip
    return scene, found


def test_all_doors_say_the_same_and_it_is_the_formulas(walls, doors, capsys, monkeypatch):
    scene, found = doors
    folder, plain = walls.parent, scene.values(BOTH)
    monkeypatch.chdir(folder)
    raw = {m.name: read_mark(replace(m, emissivity=None), plain) for m in found.file.marks}
    assert raw["Sp1"].mean == pytest.approx(celsius_at(0.2), abs=1.0)  # a pixel has 0.8
    shares = {"Sp1": SHARES["of all"], "Sp2": SHARES["right"], "Ar1": SHARES["Ar1"]}
    want = {n: of_surface(raw[n].most, share) for n, share in shares.items()}
    assert want["Ar1"] > ALARM > want["Sp2"] > want["Sp1"] > raw["Sp1"].most

    # The library, and the window, which is handed the very picture.
    inside = found.views[0]
    inner = {r.mark.name: r.most for r in inside.readings}
    assert inner == pytest.approx(want, abs=NEAR_C)
    assert {r.mark.name: r.most for r in scene.read_marks(camera=BOTH)} == inner
    tool = Inspecting(EditorState(read_model))
    tool.edit(found.file, what="emissivity")
    tool.saw(plain)
    assert {n: r.most for n, r in tool.readings.items()} == inner
    shown = [label_words(m, tool.readings[m.name], tool.picture, "")[0] for m in tool.file.marks]
    for name, value in want.items():
        said = want[name] if name == "Ar1" else tool.readings[name].mean
        assert f"{name} {said:.1f} °C" in shown, value

    # The hottest place is the mark's, its pixels are alarmed and no others, in every picture.
    hottest = max(want.values())
    assert inside.values.hottest()[1] == pytest.approx(hottest, abs=NEAR_C)
    (alarm,) = inside.isotherms
    assert alarm.most == pytest.approx(hottest, abs=NEAR_C)
    alarmed = inside.values.values > ALARM
    assert alarmed.any() and not alarmed[:, 80:].any()
    np.testing.assert_array_equal(tool.picture.values, inside.values.values)

    # The command: JSON, table of cells, report in both forms.
    assert cli.main(["thermal", str(walls), *SEEN, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)["views"][0]
    assert {m["name"]: m["max"] for m in printed["marks"]} == inner
    assert {m["name"]: m["emissivity"] for m in printed["marks"]} == shares
    assert printed["hottest"]["value"] == pytest.approx(hottest, abs=NEAR_C)
    assert printed["hottest"]["emissivity"] == SHARES["Ar1"]
    rows = {row["mark"]: row for row in csv.DictReader((folder / "r.csv").open())}
    for name, value in want.items():
        assert float(rows[name]["max"]) == pytest.approx(value, abs=NEAR_C)
        assert float(rows[name]["emissivity"]) == shares[name]
    texts = Page((folder / "r.html").read_text()).texts
    for name, value in want.items():
        assert texts[texts.index(name) :].index(f"{value:.1f} °C") < 12, name
    assert any(t.startswith(f"hottest: {hottest:.1f} °C") and "0.5" in t for t in texts)
    assert any(t.endswith(f"to {hottest:.1f} °C") for t in texts)


def test_pdf_and_picture_say_it_too(doors, tmp_path, monkeypatch):
    from matplotlib.figure import Figure
    from PIL import ImageDraw

    scene, found = doors
    cells: list[str] = []
    text = Figure.text
    monkeypatch.setattr(
        Figure, "text", lambda self, x, y, s, **how: (cells.append(s), text(self, x, y, s, **how))
    )
    drawn: list[str] = []
    monkeypatch.setattr(
        ImageDraw.ImageDraw, "text", lambda self, at, words, **how: drawn.append(words)
    )
    scene.thermal(BOTH, out=tmp_path / "p.png", report=(tmp_path / "p.pdf",))
    for reading in found.views[0].readings:
        assert any(w.startswith(f"{reading.mark.name} {reading.value:.1f}") for w in drawn), drawn
        assert f"{reading.most:.1f} °C" in cells


# ---- One value: that of the laying.


def test_a_laid_mark_keeps_its_value_from_every_side():
    """The picture of another moment is 7 degrees warmer: the mark's value is not, today's is."""
    first = replace(traced(), stop="Thermal")
    mark = laid(box_around("Ar1", np.zeros(3), np.array([0.2, 0.1, 0.1])), first)
    here = read_mark(mark, first)
    assert (here.least, here.mean, here.most) == pytest.approx(
        (here.now.least, here.now.mean, here.now.most), abs=1e-6
    )
    there = replace(traced((0.5, 0.2, 1.4)), stop="Thermal")
    warmer = replace(there, values=there.values + 7)
    again = read_mark(mark, warmer)
    assert (again.least, again.mean, again.most) == (here.least, here.mean, here.most)
    assert again.now.most == pytest.approx(here.most + 7, abs=1.0)
    assert label_words(mark, again, warmer, "")[1] == f"{again.now.most:.1f} °C"
    assert label_words(mark, here, first, "")[1] == ""
    # Of another stop, or another range of it, the laying says nothing.
    for other in (replace(warmer, stop="Night"), replace(warmer, value_range=(0.0, 50.0))):
        assert read_mark(mark, other).most == again.now.most


@pytest.mark.parametrize("size", [(8, 6), (96, 72)])  # fewer and more samples than are kept
def test_emissivity_that_is_said_later_is_that_of_every_sample(size):
    """Means of groups stand for their samples: 64 of them to a hundredth of a degree."""
    picture = replace(traced(size=size), stop="Thermal")
    mark = laid(box_around("Ar1", np.zeros(3), np.array([0.5, 0.3, 0.1])), picture)
    for share in (0.1, 0.5, 1.0):
        emission = Emission(SurfaceRadiation(share, 20.0))
        later = read_mark(mark, surface_picture(picture, emission, (mark,)))
        inside = later.now
        assert later.least == pytest.approx(inside.least, abs=1e-5)
        assert later.most == pytest.approx(inside.most, abs=1e-5)
        assert later.mean == pytest.approx(inside.mean, abs=0.01)


def test_a_laying_is_kept_in_the_file_and_moves_with_the_world(tmp_path):
    picture = replace(traced(), stop="Thermal")
    marks = tuple(
        laid(mark, picture)
        for mark in (
            Mark("Sp1", "spot", np.array([(0.1, 0.0, 0.0)])),
            box_around("Ar1", np.zeros(3), np.array([0.3, 0.2, 0.1])),
        )
    )
    path = tmp_path / "a.marks.json"
    write_marks_file(MarksFile(marks, objects=(("mug", 0.6),)), path)
    read = read_marks_file(path)
    assert read.objects == (("mug", 0.6),)
    for before, after in zip(marks, read.marks, strict=True):
        assert after.laid is not None and after.laid.moment == before.laid.moment
        np.testing.assert_allclose(
            after.laid.view.world_from_eye.matrix(), before.laid.view.world_from_eye.matrix()
        )
        one, two = (read_mark(m, picture) for m in (before, after))
        assert (one.least, one.mean, one.most) == pytest.approx((two.least, two.mean, two.most))
    rows = json.loads(path.read_text())
    for wrong in ({"samples": 0}, {"ends": [2, 1]}, {"means": [1, 2]}, {"more": 1}):
        rows["marks"][0]["laid"]["values"] = [{"samples": 1, "ends": [1, 1], "means": [1]} | wrong]
        path.write_text(json.dumps(rows))
        with pytest.raises(BadFile, match=next(iter(wrong))):
            read_marks_file(path)


def test_marks_that_are_not_seen_say_why():
    picture = traced()
    spots = {
        BEHIND: (0.1, 0.0, -0.3), GONE: (0.1, 0.0, 0.3), OUTSIDE: (3.0, 0.0, 0.0),
    }  # fmt: skip
    for why, place in spots.items():
        spot = Mark("Sp1", "spot", np.array([place]))
        ball = Mark("Ci1", "circle", np.array([place]), 0.05)
        block = box_around("Ar1", np.array(place), np.full(3, 0.05))
        for mark in (spot, ball, block):
            assert read_mark(mark, picture).hidden == why, (mark.kind, why)
    assert read_mark(Mark("Sp1", "spot", np.zeros((1, 3))), picture).hidden == ""
    assert read_mark(Mark("Sp1", "spot", np.array([(0.0, 0.0, 9.0)])), picture).hidden == OUTSIDE


@pytest.mark.parametrize("count", [0, 1, 2, 30])
def test_labels_do_not_overlap_and_stay_inside(count):
    rng = np.random.default_rng(count)
    sizes = [(float(w), 12.0) for w in rng.integers(20, 90, count)]
    corners = list(rng.normal((620, 300), 15, (count, 2)))  # nearly all in one corner
    places = label_places(corners, sizes, (640, 480))
    boxes = [
        (*place, place[0] + size[0], place[1] + size[1])
        for place, size in zip(places, sizes, strict=True)
        if place is not None
    ]
    assert len(boxes) >= min(count, 20)
    for i, (left, top, right, low) in enumerate(boxes):
        assert left >= 0 and top >= 0 and right <= 640 and low <= 480
        for a, t, r, d in boxes[:i]:
            assert right <= a or r <= left or low <= t or d <= top
    assert label_places([np.zeros(2)], [(700.0, 12.0)], (640, 480)) == [None]


def test_one_mark_off_the_scene_does_not_refuse_the_others(walls, capsys, monkeypatch):
    monkeypatch.chdir(walls.parent)
    words = ["thermal", str(walls), *SEEN, "--marks", "none.marks.json", "--save"]
    given = ["--spot", "far=9999,1", "mid=60,36", "--circle", "out=90,0,0,1", "--difference",
             "mid,far", "--remark", "far=gone", "--emissivity", "far=0.5"]  # fmt: skip
    assert cli.main([*words, *given, "--json"]) == 0
    out, err = capsys.readouterr()
    assert [m["name"] for m in json.loads(out)["views"][0]["marks"]] == ["mid"]
    assert len(re.findall("Left out: ", err)) == 2 and "far" in err and "out" in err
    (walls.parent / "none.marks.json").unlink()
    assert cli.main([*words, "--spot", "far=9999,1", "also=0,9999"]) == 2  # nothing is left
    assert "far" in capsys.readouterr().err and not Path("none.marks.json").exists()
    assert pictures.LABEL_STEPS[0].tolist() == [0, 0]


def test_what_is_cut_out_keeps_the_emissivity_of_a_mark_on_it():
    """Once: what somebody says of the object afterwards stands."""
    picture = replace(traced(), owner_names=("wall",), owners=np.zeros((72, 96), int))
    tool = Inspecting(EditorState(read_model))
    mark = Mark("Sp1", "spot", np.array([(0.2, 0.0, 0.0)]), emissivity=0.6)
    tool.edit(MarksFile((mark,)), what="emissivity")
    tool.saw(picture)
    assert tool.file.objects == ()
    halves = (picture.points[..., 0] > 0.1).astype(int)
    cut = replace(picture, owner_names=("wall", "part"), owners=halves)
    for objects in ((("part", 0.6),), (("part", 0.8),), ()):
        if objects != (("part", 0.6),):
            tool.shine("part", dict(objects).get("part"), True)
        tool.saw(cut)
        assert tool.file.objects == objects
