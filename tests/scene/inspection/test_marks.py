"""Marks in the world: what views read at them, against a plane whose values are a formula."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.marks import (
    Isotherm,
    Mark,
    box_around,
    box_at,
    circle_at,
    line_at,
    read_mark,
    spot_at,
)
from shapeshift.scene.inspection.marks_file import (
    HeldOutError,
    MarksFile,
    marks_path,
    marks_rows,
    moved_marks,
    read_marks_file,
    write_marks_file,
)
from shapeshift.scene.inspection.value_picture import value_text
from tests.support.scene.warm_wall import celsius_at, traced

EYES = [(0, 0, 1.5), (0.5, 0.1, 1.4), (-0.7, 0.3, 1.2), (0.2, -0.5, 1.6), (-0.3, 0.6, 2.0)]


@pytest.mark.parametrize("eye", EYES)
def test_a_place_is_found_again_from_every_view(eye):
    """Pixel to world and back, and the value of the formula there: exact but for rounding, since a
    straight line is what the mean of four pixels keeps; depth is not straight, 1 mm is allowed."""
    picture = traced(eye)
    spot = spot_at("Sp1", traced(), (50.3, 30.7))
    assert spot.points[0, 2] == pytest.approx(0, abs=1e-4)
    reading = read_mark(spot, picture)
    assert reading.samples == 1 and reading.least == reading.mean == reading.most
    assert reading.mean == pytest.approx(celsius_at(spot.points[0, 0]), abs=0.1)
    column, row = picture.pixel_of(spot.points)[0][0]
    np.testing.assert_allclose(picture.pick((column, row)), spot.points[0], atol=1e-3)


@pytest.mark.parametrize("eye", EYES)
def test_areas_hold_what_lies_in_them_from_every_view(eye):
    """A ball on a plane is a disc: its ends are those of its rim, its mean that of its middle but
    for the nearer half, which has more pixels (0.3 °C of the 17 across, seen from the side)."""
    front, picture = traced(), traced(eye, (192, 144))
    circle = circle_at("Ci1", front, (40.0, 36.0), 9.0)
    reading = read_mark(circle, picture)
    x, r = circle.points[0, 0], circle.radius_m
    assert reading.samples > 200
    assert reading.mean == pytest.approx(celsius_at(x), abs=0.5)
    assert reading.least == pytest.approx(celsius_at(x - r), abs=0.7)  # half a pixel at the rim
    assert reading.most == pytest.approx(celsius_at(x + r), abs=0.7)
    box = box_at("Ar1", front, (30, 20), (60, 50))
    low, high = front.pick((30, 36))[0], front.pick((60, 36))[0]
    reading = read_mark(box, picture)
    assert reading.least == pytest.approx(celsius_at(low), abs=0.8)
    assert reading.most == pytest.approx(celsius_at(high), abs=0.8)


def test_a_rectangle_holds_exactly_its_pixels_where_it_was_laid():
    picture = traced()
    reading = read_mark(box_at("Ar1", picture, (60, 50), (30, 20)), picture)  # corners either way
    inside = picture.values[20:50, 30:60]
    assert reading.samples == inside.size
    assert (reading.least, reading.most) == (inside.min(), inside.max())
    assert reading.hottest == (59.5, reading.hottest[1])


def test_a_line_has_the_profile_of_the_formula():
    picture = traced()
    line = line_at("Li1", picture, np.array([(20.0, 36.0), (76.0, 36.0)]))
    for eye in EYES:
        reading = read_mark(line, traced(eye, (384, 288)))
        way, value = reading.profile.T
        assert way[0] == 0 and (np.diff(way) > 0).all()
        slope = np.polyfit(way, value, 1)[0]
        assert slope == pytest.approx(50, rel=0.01)  # °C a metre
        assert way[-1] == pytest.approx(line.points[-1, 0] - line.points[0, 0], rel=1e-3)


def test_what_is_hidden_or_outside_is_not_known():
    picture = traced()
    for point in ((0, 0, -0.5), (0, 0, 0.5), (5, 0, 0), (0, 0, 9)):  # behind, before, beside, back
        reading = read_mark(Mark("Sp1", "spot", np.array([point])), picture)
        assert math.isnan(reading.mean) and reading.samples == 0
    assert read_mark(box_around("b", (0, 0, -1), (0.1, 0.1, 0.1)), picture).samples == 0
    assert read_mark(box_around("b", (0, 0, 0), (0.1, 0.1, 0.1)), picture).samples > 50
    for make in (
        lambda: spot_at("Sp1", picture, (96.0, 10.0)),
        lambda: spot_at("Sp1", picture, (0.5, 0.5)),
        lambda: circle_at("Ci1", picture, (-1.0, 10.0), 3.0),
        lambda: circle_at("Ci1", picture, (48.0, 36.0), 0.0),
        lambda: line_at("Li1", picture, np.array([(0.0, 0.0), (9.0, 0.0)])),
        lambda: box_at("Ar1", picture, (0, 0), (3, 3)),
    ):
        with pytest.raises(ValueError, match=r"^[^\n]+\.$"):
            make()


def test_only_the_pixels_that_may_lie_in_an_area_are_looked_at():
    """The same as looking at all, for areas anywhere: aside, behind and around the eye too."""
    rng, found = np.random.default_rng(3), 0
    for eye in ((0.0, 0.0, 1.5), (0.7, 0.3, 0.6)):
        picture = traced(eye)
        for _ in range(100):
            centre = rng.normal(0, (0.6, 0.4, 0.5))
            half = rng.uniform(0.01, 0.8, 3)
            for mark in (
                box_around("Ar1", centre, half), Mark("Ci1", "circle", centre[None], half[0]),
            ):  # fmt: skip
                inside = mark.holds(picture.points) & picture.known
                reading = read_mark(mark, picture)
                assert reading.samples == inside.sum()
                if inside.any():
                    found += 1
                    values = np.where(inside, picture.values, -np.inf)
                    row, column = np.unravel_index(int(np.argmax(values)), values.shape)
                    assert reading.hottest == (column + 0.5, row + 0.5)
                    assert reading.mean == picture.values[inside].mean()
    assert found > 100


def test_isotherms_hold_their_bounds_as_they_say():
    values = np.array([np.nan, 10.0, np.nextafter(10.0, 11), 20.0, np.nextafter(20.0, 21)])
    assert Isotherm("above", low=10).holds(values).tolist() == [False, False, True, True, True]
    assert Isotherm("below", high=20).holds(values).tolist() == [False, True, True, False, False]
    between = Isotherm("between", 10, 20).holds(values)
    assert between.tolist() == [False, True, True, True, False]
    for low, high in ((5, 5), (6, 5), (np.nan, 5)):
        with pytest.raises(ValueError, match="lower value first"):
            Isotherm("between", low, high)


def test_values_for_people():
    assert value_text(math.nan, "°C") == "--"
    assert value_text(21.26, "°C", (15, 95)) == "21.3 °C"
    assert value_text(95.0, "°C", (15, 95)) == ">95.0 °C"
    assert value_text(15.1, "°C", (15, 95)) == "<15.1 °C"
    assert value_text(0.5, "") == "0.5"


FILE = MarksFile(
    (
        Mark("Sp1", "spot", np.array([(0.1, 0.2, 0.3)])),
        Mark("rim", "circle", np.array([(0.0, 0.0, 0.0)]), 0.05, "a note"),
        Mark("Li1", "line", np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)])),
        box_around("Ar1", np.zeros(3), np.array([1.0, 2.0, 3.0])),
    ),
    (("Sp1", "rim"),),
    (Isotherm("above", low=60.0), Isotherm("below", high=5.0), Isotherm("between", 10.0, 20.0)),
    2.5,
    HeldOutError(0.5, 2.0, 8),
)


def test_the_file_of_marks_comes_back_as_it_was(tmp_path):
    path = marks_path(tmp_path / "hall.shift")
    assert path.name == "hall.marks.json"
    assert marks_path(tmp_path / "room.scene.json").name == "room.marks.json"
    write_marks_file(FILE, path)
    found = read_marks_file(path)
    assert marks_rows(found) == marks_rows(FILE)
    assert (found.differences, found.isotherms, found.held_out) == (
        FILE.differences, FILE.isotherms, FILE.held_out,
    )  # fmt: skip
    back = moved_marks(moved_marks(found, np.ones(3)), -np.ones(3))
    np.testing.assert_allclose(back.marks[0].points, FILE.marks[0].points)


def broken(change) -> dict:
    rows = json.loads(json.dumps(marks_rows(FILE)))
    change(rows)
    return rows


@pytest.mark.parametrize(
    "change",
    [
        lambda r: r.pop("shapeshift_marks"),
        lambda r: r.update(shapeshift_marks=2),
        lambda r: r.update(marks=[{}]),
        lambda r: r.update(more=1),
        lambda r: r["marks"][0].update(kind="star"),
        lambda r: r["marks"][0].update(points=[[0, 0]]),
        lambda r: r["marks"][0].update(points=[[0, 0, 1e300]]),
        lambda r: r["marks"][0].update(points=[[0, 0, None]]),
        lambda r: r["marks"][0].update(points=[[0, 0, 0]] * 2000),
        lambda r: r["marks"][0].update(radius=1),
        lambda r: r["marks"][0].update(name="\x1b[2J"),
        lambda r: r["marks"][0].update(name="x" * 200),
        lambda r: r["marks"][1].update(name="Sp1"),
        lambda r: r["marks"][1].update(radius=0),
        lambda r: r["marks"][3].update(points=[[0, 0, 0]] * 8),
        lambda r: r["marks"][3]["points"].reverse() or r["marks"][3]["points"].sort(),
        lambda r: r.update(marks=[r["marks"][0] | {"name": str(i)} for i in range(1001)]),
        lambda r: r["differences"][0].update(less="none"),
        lambda r: r["isotherms"][2].update(high=1),
        lambda r: r["isotherms"][0].update(high=1),
        lambda r: r.update(metres_per_unit=0),
        lambda r: r["held_out"].update(mean=-1),
    ],
)
def test_a_wrong_file_of_marks_is_one_sentence(tmp_path, change):
    path = tmp_path / "a.marks.json"
    path.write_text(json.dumps(broken(change)))
    with pytest.raises(BadFile, match=r"^[^\n]+\.$"):
        read_marks_file(path)


TWICE = b'{"shapeshift_marks": 1, "shapeshift_marks": 1}'


@pytest.mark.parametrize(
    "data",
    [b"", b"[]", b"{" * 100_000, b'{"shapeshift_marks": NaN}', TWICE, b"\xff\xfe"],
    ids=["empty", "list", "deep", "nan", "twice", "bytes"],
)
def test_a_file_that_is_no_file_of_marks_is_one_sentence(tmp_path, data):
    path = tmp_path / "a.marks.json"
    path.write_bytes(data)
    with pytest.raises(BadFile, match=r"^[^\n]+$"):
        read_marks_file(path)


def test_marks_that_are_none_are_refused():
    good = FILE.marks[3]
    inside_out = replace(good, points=good.points)  # the same is good
    assert inside_out.holds(np.zeros((1, 3))).all()
    for points in (np.full((1, 3), np.nan), np.full((1, 3), np.inf), np.zeros((2, 3)), np.zeros(3)):
        with pytest.raises(ValueError, match="Sp1"):
            Mark("Sp1", "spot", points)
