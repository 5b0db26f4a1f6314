"""launch.py change and ss.change on a table whose changes are known to the millimetre."""

import csv
import json
import shutil
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.runtime_models.eyes import spread_eyes
from shapeshift.runtime_models.splats.layers.layer_list import LIST
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.write_cameras import write_cameras
from shapeshift.scene.change.similarity import Similarity, rotation_of
from shapeshift.scene.pose import View, look_at, perspective
from tests.support.scene.visited_table import (
    AFTER,
    BEFORE,
    BLUE,
    GREEN,
    MOVED_M,
    RED,
    STOPS,
    TABLE,
    TALL,
    WHITE,
    Block,
    write_visit,
)

SIZE = (192, 144)
NO_GL = ("--context", "none")
CELL = 0.011  # metres: a 64th of the table's radius
# What is planted, and where the middle of its box is.
WANTED = {
    "moved": [AFTER[1].centre],
    "appeared": [WHITE.centre],
    "vanished": [BLUE.centre],
    "hotter": [GREEN.centre, (0.0, 0.0, 0.0)],
    "colder": [TALL.centre],
}


@pytest.fixture(scope="module")
def visits(tmp_path_factory):
    """Folders: before, after, and again, of which the splats alone are scattered otherwise."""
    folder = tmp_path_factory.mktemp("visits")
    write_visit(folder / "before", BEFORE)
    write_visit(folder / "after", AFTER, seed=1)
    write_visit(folder / "again", BEFORE, seed=2)
    return folder


@pytest.fixture(scope="module")
def written(visits, tmp_path_factory):
    """What the command writes, and what it prints as JSON is the same."""
    out = tmp_path_factory.mktemp("out") / "changed"
    code = cli.main(["change", str(visits / "before"), str(visits / "after"), "--out", str(out),
                     "--size", "192x144", *NO_GL])  # fmt: skip
    assert code == 0
    return out


def refused(capsys, *words) -> str:
    """The sentence with which the command refuses."""
    assert cli.main(["change", *map(str, words), "--size", "96x72", *NO_GL]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    said = [line for line in said if not line.startswith("change: ")]  # progress, after a minute
    assert len(said) == 1, said
    return said[0]


def check_places(places, world=lambda p: np.asarray(p)) -> None:
    """All that is planted, each within three cells (the lowest two of a thing cannot be told from
    the table, which lifts its middle by one), and nothing else."""
    assert sorted(p["kind"] for p in places) == sorted(k for k, v in WANTED.items() for _ in v)
    for kind, centres in WANTED.items():
        found = [np.array([p["x"], p["y"], p["z"]]) for p in places if p["kind"] == kind]
        for centre in centres:
            assert min(np.linalg.norm(f - world(centre)) for f in found) < 3 * CELL, kind
    amount = {kind: sorted(p["amount"] for p in places if p["kind"] == kind) for kind in WANTED}
    assert amount["moved"][0] == pytest.approx(MOVED_M, abs=CELL)
    # degrees are exact inside a face: 15 and 12; the round spot has an edge, of 30
    assert amount["hotter"][0] == pytest.approx(15, abs=0.1) and 24 < amount["hotter"][1] < 30.5
    assert amount["colder"][0] == pytest.approx(-12, abs=0.1)


def test_all_that_was_planted_is_found_and_nothing_else(written):
    made = json.loads((written / "places.json").read_text())
    check_places(made["places"])
    assert made["registration"]["how"] == "common" and made["registration"]["residual_cm"] < 0.1
    np.testing.assert_array_equal(made["registration"]["a_from_b"], np.eye(4))
    assert made["overall"] == pytest.approx(0, abs=0.1)
    areas = [place["area_cm2"] for place in made["places"]]
    assert areas == sorted(areas, reverse=True)
    assert [place["number"] for place in made["places"]] == [1, 2, 3, 4, 5, 6]


def test_areas_are_those_of_the_faces_that_are_seen(written):
    """The tall block: four sides and a top, less what its foot hides of the cells: to a fifth."""
    made = json.loads((written / "places.json").read_text())
    (tall,) = (p for p in made["places"] if p["kind"] == "colder")
    x, y, z = (2 * half for half in TALL.half)
    assert tall["area_cm2"] == pytest.approx(1e4 * (2 * y * (x + z) + x * z), rel=0.2)
    assert tall["now"] == pytest.approx(28, abs=0.1)


def test_the_list_is_also_csv(written):
    made = json.loads((written / "places.json").read_text())["places"]
    with (written / "places.csv").open() as file:
        rows = list(csv.DictReader(file))
    for row, place in zip(rows, made, strict=True):
        assert {k: (v or "") for k, v in row.items()} == {
            k: "" if v is None else str(v) for k, v in place.items()
        }


def test_each_place_has_a_picture_that_marks_it(written):
    """The third third has the kind's colour where a place is: green of what appeared."""
    pictures = sorted(written.glob("place_*.png"))
    assert len(pictures) == 6
    (new,) = (path for path in pictures if path.stem.endswith("appeared"))
    with Image.open(new) as image:
        pixels = np.asarray(image, float)
    before, after, marked = np.split(pixels, 3, axis=1)
    green = (marked[..., 1] > 1.5 * marked[..., 0]) & (marked[..., 1] > 1.3 * marked[..., 2])
    assert green.sum() > 300
    there = np.abs(before - after).mean(axis=2)[green]
    assert np.mean(there > 10) > 0.8  # what is marked is what is different


def test_the_layers_open_as_a_scene_that_measures_change(written):
    scene = ss.load(written / "layers")
    names = [stop.name for stop in scene.stops]
    assert names == ["Before", "After", "Change of shape", "Change of heat", "Change of colour"]
    units = [(stop.kind, stop.unit) for stop in scene.stops[2:]]
    assert units == [("thermal", "mm"), ("thermal", "°C"), ("thermal", "Lab")]

    def at(place, stop) -> float:
        return scene.temperature(place, stop=stop)

    top = np.add(GREEN.centre, (0, GREEN.half[1], 0))
    assert at(top, "Change of heat") == pytest.approx(15, abs=0.5)
    assert at(np.add(TALL.centre, (0, TALL.half[1], 0)), "Change of heat") == pytest.approx(
        -12, abs=0.5
    )
    still = (-0.5, 0.0, 0.4)
    assert at(still, "Change of heat") == pytest.approx(0, abs=0.5)
    # the top of what vanished, which B has not: 12 cm above the table
    gone = np.add(BLUE.centre, (0, BLUE.half[1], 0))
    assert at(gone, "Change of shape") == pytest.approx(120, abs=25)
    assert at(still, "Change of shape") < 5


def test_marks_lie_beside_the_layers(written):
    from shapeshift.scene.inspection.marks_file import read_marks_file

    marks = read_marks_file(written / "layers.marks.json").marks
    assert len(marks) == 6
    (moved,) = (mark for mark in marks if mark.name.endswith("moved"))
    assert moved.holds(np.array(AFTER[1].centre)) and "by 58" in moved.note


def test_nothing_planted_is_nothing_found(visits):
    changed = ss.change(visits / "before", visits / "again", size=SIZE, context="none")
    assert changed.places == () and changed.registration.how == "common"
    assert changed.registration.shared > 0.99 and changed.compared == ("shape", "colour", "heat")


def test_another_world_is_found_and_its_places_are_the_same(visits, tmp_path):
    """Turned by 46 degrees, 1.6 times as large, far away: features, then closest points."""
    world = Similarity(rotation_of(np.array([0.04, 0.8, -0.03])), np.array([2.0, 0.5, -1.0]), 1.6)
    write_visit(tmp_path / "moved", AFTER, 1, world)
    changed = ss.change(visits / "before", tmp_path / "moved", size=SIZE, context="none")
    found = changed.registration
    assert found.how == "features" and found.residual_m < 0.001
    corners = np.array([(x, 0, z) for x in (-0.6, 0.6) for z in (-0.5, 0.5)])
    assert (
        np.linalg.norm(found.a_from_b.apply(world.apply(corners)) - corners, axis=1).max() < 0.003
    )
    rows = [{"kind": p.kind, "amount": p.amount, **dict(zip("xyz", p.centre, strict=True))}
            for p in changed.places]  # fmt: skip
    check_places(rows)


def test_a_world_that_is_nearly_the_same_is_moved_by_closest_points(visits, tmp_path):
    """Turned by 1.1 degrees, corners 8 to 25 mm off: closest points alone find it."""
    turn = rotation_of(np.array([0.003, 0.019, 0.002]))
    world = Similarity(turn, np.array([0.008, 0.004, 0.007]))
    write_visit(tmp_path / "near", AFTER, 1, world)
    changed = ss.change(visits / "before", tmp_path / "near", size=SIZE, context="none")
    found = changed.registration
    assert found.how == "icp" and found.residual_m < 0.001 and found.a_from_b.scale == 1
    corners = np.array([(x, 0, z) for x in (-0.6, 0.6) for z in (-0.5, 0.5)])
    was = np.linalg.norm(world.apply(corners) - corners, axis=1)
    left = np.linalg.norm(found.a_from_b.apply(world.apply(corners)) - corners, axis=1)
    assert left.max() < 0.001 and was.min() > 0.008  # 0.24 mm were measured
    rows = [{"kind": p.kind, "amount": p.amount, **dict(zip("xyz", p.centre, strict=True))}
            for p in changed.places]  # fmt: skip
    check_places(rows)


def test_a_table_alone_that_could_slide_stays_where_it_is(tmp_path):
    """Closest points of a bare plane may lie anywhere along it, so they move no world."""
    write_visit(tmp_path / "one", (TABLE,))
    write_visit(tmp_path / "two", (TABLE,), seed=1)
    found = ss.change(tmp_path / "one", tmp_path / "two", size=SIZE, context="none").registration
    assert found.how == "common" and np.array_equal(found.a_from_b.rotation, np.eye(3))


def test_cameras_of_a_file_see_what_they_see(visits, tmp_path, capsys):
    """All in front of the table's right half: changes there are found, the others are not."""
    views, size = [], SIZE
    for turn in np.linspace(-0.5, 0.5, 8):
        for height in (0.35, 0.7):
            eye = np.array([0.3 + 0.9 * np.sin(turn), height, 0.9 * np.cos(turn)])
            pose = look_at(eye, np.array([0.3, 0.05, 0.0]))
            views.append(View(pose, perspective(0.35, size), 0.05, 50.0, size))
    file = tmp_path / "walk.json"
    names = tuple(f"{i:02}.png" for i in range(len(views)))
    write_cameras(CameraList(tuple(views), names, "ours"), file, "ours")
    words = ["change", str(visits / "before"), str(visits / "after"), "--camera", str(file),
             "--json", "--size", "192x144", *NO_GL]  # fmt: skip
    assert cli.main(words) == 0
    places = json.loads(capsys.readouterr().out)["places"]
    seen = {place["kind"]: np.array([place["x"], place["y"], place["z"]]) for place in places}
    assert np.linalg.norm(seen["vanished"] - BLUE.centre) < 3 * CELL
    assert "colder" not in seen  # the tall one stands outside of all pictures
    assert all(place["x"] > -0.2 for place in places)
    (tmp_path / "none.json").write_text("{}")
    words[4] = str(tmp_path / "none.json")
    assert cli.main(words) == 2
    assert "none.json" in capsys.readouterr().err


def test_scenes_that_share_nothing_are_refused(visits, tmp_path, capsys):
    hall = (Block((0, 0.5, 0), (0.05, 0.5, 0.6), (0.3, 0.7, 0.3)),
            Block((0.8, 0.3, 0), (0.4, 0.05, 0.05), (0.7, 0.3, 0.7)))  # fmt: skip
    write_visit(tmp_path / "other", hall)
    said = refused(capsys, visits / "before", tmp_path / "other")
    assert "share too little" in said or "does not fit" in said


def test_without_heat_in_both_shapes_and_colours_are_compared(visits, tmp_path, capsys):
    painted = (*BEFORE[:2], replace(GREEN, color=(0.7, 0.2, 0.6)), *BEFORE[3:])
    write_visit(tmp_path / "seen", painted, stops=STOPS[:1])
    code = cli.main(["change", str(visits / "before"), str(tmp_path / "seen"), "--json", *NO_GL,
                     "--size", "192x144"])  # fmt: skip
    said = capsys.readouterr()
    assert code == 0 and "seen has no thermal stop: shapes and colours alone" in said.err
    made = json.loads(said.out)
    assert made["compared"] == ["shape", "colour"] and made["overall"] is None
    assert [place["kind"] for place in made["places"]] == ["recoloured"]


def test_what_cannot_be_compared_is_refused_in_a_sentence(visits, tmp_path, capsys):
    a, b = visits / "before", visits / "after"
    unknown = (STOPS[0], replace(STOPS[1], value_range=None))
    write_visit(tmp_path / "unknown", (TABLE,), stops=unknown)
    assert "--range LOW HIGH" in refused(capsys, a, tmp_path / "unknown")
    kelvin = (STOPS[0], replace(STOPS[1], unit="K"))
    write_visit(tmp_path / "kelvin", (TABLE,), stops=kelvin)
    assert "one unit is wanted" in refused(capsys, a, tmp_path / "kelvin")
    assert "no stop 'Opened'" in refused(capsys, a, b, "--stop", "Opened")
    assert "more than 0 is wanted" in refused(capsys, a, b, "--degrees", "nan")
    assert "0 (by the scene) or more" in refused(capsys, a, b, "--millimetres", "-1")
    assert "leave the ending .shift out" in refused(capsys, a, b, "--out", tmp_path / "c.shift")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("kept")
    assert "has other files in it" in refused(capsys, a, b, "--out", tmp_path / "full")
    assert (tmp_path / "full" / "mine.txt").read_text() == "kept"


def test_what_was_written_is_replaced_only_where_that_is_asked(visits, written, capsys):
    assert "--overwrite" in refused(capsys, visits / "before", visits / "after", "--out", written)


def test_other_values_than_heat_are_higher_and_lower(visits, tmp_path):
    """The same numbers as shares of one: a twentieth of the range counts, as 5 degrees of 100."""
    for name in ("before", "after"):
        shutil.copytree(visits / name, tmp_path / name)
        said = json.loads((tmp_path / name / LIST).read_text(encoding="utf-8"))
        said["stops"][1] |= {"name": "Moisture", "kind": "values", "value_range": [0, 1]}
        said["stops"][1]["unit"] = "m³/m³"
        (tmp_path / name / LIST).write_text(json.dumps(said), encoding="utf-8")
    out = tmp_path / "out"
    found = ss.change(tmp_path / "before", tmp_path / "after", size=SIZE, out=out, context="none")
    kinds = Counter(place.kind for place in found.places)
    assert kinds["higher"] == 2 and kinds["lower"] == 1 and not {"hotter", "colder"} & set(kinds)
    assert found.compared == ("shape", "colour", "values")
    assert found.settings.least_value == pytest.approx(0.05)
    green = next(p for p in found.places if p.kind == "higher" and abs(p.centre[0] - 0.3) < 0.1)
    assert green.amount == pytest.approx(0.15, abs=0.005) and green.unit == "m³/m³"
    change = next(s for s in ss.load(out / "layers").stops if s.name == "Change of values")
    assert (change.kind, change.unit) == ("values", "m³/m³")
    with pytest.raises(ss.UsageError, match="no stop 'Heat' of values"):
        ss.change(tmp_path / "before", tmp_path / "after", values="Heat", context="none")


def photographed(folder, views: list[View]):
    """A visit that says from where its photos were taken."""
    scene = ss.load(folder)
    places = np.array([view.world_from_eye.position for view in views])
    looks = np.array([(*view.world_from_eye.wxyz, *view.tangents) for view in views])
    return scene.with_model(replace(scene.model, provenance=spread_eyes(places, looks)))


def test_halves_of_a_capture_are_one_place_and_what_was_taken_away_is_said(visits, tmp_path):
    """Six photos each, none from the same place; B has fog before A's cameras, as scenes have that
    nobody saw from there, which drawn from A's cameras would hide and replace the table.
    """
    ring = []
    for turn in 2 * np.pi * np.arange(12) / 12:
        eye = 1.5 * np.array([0.5 * np.sin(turn), 0.87, 0.5 * np.cos(turn)])
        ring.append(View(look_at(eye, np.zeros(3)), perspective(0.7, SIZE), 0.05, 50.0, SIZE))
    a, b = ring[::2], ring[1::2]
    fog = [
        Block(tuple(0.8 * v.world_from_eye.position), (0.03, 0.03, 0.03), (0.9, 0.9, 0.9))
        for v in a
    ]
    write_visit(tmp_path / "foggy", (*BEFORE, *fog), seed=1)
    write_visit(tmp_path / "less", (TABLE, RED, GREEN, TALL, *fog), seed=1)
    first, usual = photographed(visits / "before", a), {"size": SIZE, "context": "none"}
    same = ss.change(first, photographed(tmp_path / "foggy", b), **usual)
    assert same.places == () and same.registration.how == "common" and min(same.judged) > 0.5
    less = ss.change(first, photographed(tmp_path / "less", b), **usual)
    assert less.places and {place.kind for place in less.places} == {"vanished"}
    for place in less.places:  # a side that few photos show may be a place of its own
        assert (np.abs(place.points - BLUE.centre) < np.add(BLUE.half, 2 * CELL)).all()
    with pytest.raises(ss.BadFile, match="photographed from 2 of the 3 places"):
        ss.change(first, photographed(tmp_path / "less", b[:2]), **usual)
