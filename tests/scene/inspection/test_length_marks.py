"""Measured lengths that stay: to a file and back, in other units, refused where they are none."""

import json

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.length_marks import LengthMark, free_length_name, length_of
from shapeshift.scene.inspection.lengths import Measurement, Point, Scale
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    kept_scale,
    moved_marks,
    read_marks_file,
    write_marks_file,
)

SQUARE = [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.5, 0.5, 0.0), (0.0, 0.5, 0.0)]
SPREAD = np.array([[4e-6, 1e-6, 0], [1e-6, 9e-6, -2e-6], [0, -2e-6, 1e-6]])
CASES = {"distance": 2, "polyline": 4, "angle": 3, "area": 4}


def length(kind: str, name: str = "L1", note: str = "") -> LengthMark:
    points = [Point(np.array(place), SPREAD) for place in SQUARE[: CASES[kind]]]
    made = length_of(name, kind, points)
    return LengthMark(made.name, made.kind, made.points, made.covariances, note)


def test_all_kinds_come_back_from_a_file_with_their_uncertainty(tmp_path):
    lengths = tuple(length(kind, kind, f"of {kind}") for kind in CASES)
    file = MarksFile(lengths=lengths, metres_per_unit=2.0, scale_error=0.01)
    path = tmp_path / "room.marks.json"
    write_marks_file(moved_marks(file, np.array([1.0, -2.0, 3.0])), path)
    back = moved_marks(read_marks_file(path), np.array([-1.0, 2.0, -3.0]))
    assert back.scale == Scale(2.0, 0.01) == kept_scale(tmp_path / "room.ply")
    for before, after in zip(lengths, back.lengths, strict=True):
        assert (after.name, after.kind, after.note) == (before.name, before.kind, before.note)
        np.testing.assert_array_equal(after.covariances, before.covariances)
        one, two = before.measured(file.scale), after.measured(back.scale)
        assert two.value == pytest.approx(one.value, abs=4e-5)  # places have five decimals
        assert two.uncertainty == pytest.approx(one.uncertainty, rel=1e-3)
    by_kind = {each.kind: each.measured(Scale(2.0)).value for each in back.lengths}
    assert by_kind == pytest.approx({"distance": 1, "polyline": 3, "angle": 90, "area": 1})


def test_a_length_without_uncertainty_is_exact(tmp_path):
    exact = LengthMark("L1", "distance", np.array(SQUARE[:2]))
    path = tmp_path / "a.marks.json"
    write_marks_file(MarksFile(lengths=(exact,)), path)
    assert "covariances" not in path.read_text() and "scale_error" not in path.read_text()
    (back,) = read_marks_file(path).lengths
    assert back.measured(Scale()).uncertainty == 0


@pytest.mark.parametrize(
    "change, said",
    [
        ({"kind": "volume"}, "one of distance"),
        ({"points": [[0, 0, 0]]}, "wants 2 points"),
        ({"points": [[0, 0, 0], [0, 0, 1e8]]}, "no place"),
        ({"points": [[0, 0], [0, 0, 1]]}, "3 numbers each"),
        ({"points": "here"}, "3 numbers each"),
        ({"covariances": [[1, 0, 0, 1, 0, 1]]}, "six numbers for each point"),
        ({"covariances": [[1, 0, 0, -1, 0, 1]] * 2}, "an uncertainty that is none"),
        ({"name": "two\nlines"}, "one line"),
        ({"colour": "red"}, "no key here"),
    ],
)
def test_what_is_no_length_is_one_sentence(tmp_path, change, said):
    row = {"name": "L1", "kind": "distance", "points": [[0, 0, 0], [0, 0, 1]]} | change
    path = tmp_path / "a.marks.json"
    path.write_text(json.dumps({"shapeshift_marks": 1, "lengths": [row]}))
    with pytest.raises(BadFile, match=said) as refused:
        read_marks_file(path)
    assert "\n" not in str(refused.value)


def test_two_lengths_of_one_name_are_refused(tmp_path):
    path = tmp_path / "a.marks.json"
    write_marks_file(MarksFile(lengths=(length("distance"), length("area"))), path)
    with pytest.raises(BadFile, match="two lengths are called 'L1'"):
        read_marks_file(path)
    assert free_length_name("distance", ["L1", "L3"]) == "L2"


@pytest.mark.parametrize(
    "found, unit, words",
    [
        (Measurement("distance", 0.59594, 0.0036, "m"), "m", "0.5959 ± 0.0036 m"),
        (Measurement("distance", 0.59594, 0.0036, "m"), "cm", "59.59 ± 0.36 cm"),
        (Measurement("distance", 0.59594, 0.0036, "m"), "mm", "595.9 ± 3.6 mm"),
        (Measurement("distance", 0.3048, 0.03048, "m"), "ft", "1.00 ± 0.10 ft"),
        (Measurement("area", 0.04, 0.0005, "m²"), "cm", "400.0 ± 5.0 cm²"),
        (Measurement("area", 0.00064516, 0.0, "m²"), "in", "1.0000 in²"),
        (Measurement("angle", 89.961, 0.52, "degrees"), "mm", "89.96 ± 0.52°"),
        (Measurement("distance", 0.0, 0.0, "m"), "m", "0.0 m"),
        (Measurement("distance", 1500.0, 120.0, "m"), "m", "1500 ± 120 m"),
    ],
)
def test_words_have_the_digits_that_are_uncertain(found, unit, words):
    assert found.words(unit) == words
