"""launch.py thermal and its kin on stops of values that are no heat: words, digits, palettes."""

import json
import re

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.app.document import Document
from shapeshift.app.drawing import open_renderer
from shapeshift.app.inspection.draw_values import draw_values, measured_scene
from shapeshift.renderer.colors.palette import PALETTES as COLORS
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.layers.layer_list import LIST
from shapeshift.runtime_models.stop import (
    LONGEST_UNIT,
    MOST_DIGITS,
    PALETTES,
    STOP_KINDS,
    VALUE_KINDS,
    digits_of,
)
from tests.support.scene.warm_wall import celsius_at, wall_view, write_wall

MOIST = Stop("Moisture", 1.0, "values", "viridis", (0.0, 1.0), "m³/m³")
NO_GL = ("--context", "none")


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """The wall of heat with its shares as another quantity: 0.5 + 0.5 x at x metres."""
    return write_wall(tmp_path_factory.mktemp("moist") / "wall", (Stop("RGB", 0.0), MOIST))


def test_heat_is_one_of_the_kinds_of_values():
    assert [k for k in STOP_KINDS if Stop("a", 0, k).is_measured] == list(VALUE_KINDS)
    assert Stop("a", 0, "thermal").is_heat and not Stop("a", 0, "values").is_heat
    assert not Stop("a", 0, "values").has_false_colors and MOIST.has_false_colors
    assert tuple(COLORS) == PALETTES  # the names that are checked are those that are drawn


@pytest.mark.parametrize(
    ("ends", "digits"),
    [(None, 1), ((0, 1), 3), ((-1, 1), 3), ((0, 100), 1), ((0, 999.0), 1), ((0, 1000), 0),
     ((0, 65535), 0), ((0, 1e-3), 6), ((0, 5e-324), MOST_DIGITS), ((0, np.inf), 1)],
)  # fmt: skip
def test_digits_tell_a_thousandth_of_the_range_apart(ends, digits):
    assert digits_of(ends) == digits
    assert Stop("a", 0, "thermal", "", ends).digits == 1  # as it has always been


def test_a_mark_reads_another_quantity(wall, capsys, tmp_path):
    place = 0.2
    out = tmp_path / "report.html"
    code = cli.main(
        ["thermal", str(wall), "--spot", f"{place},0,0", "--above", "0.7", "--csv",
         str(tmp_path / "a.csv"), "--report", str(out), "--size", "96x72", *NO_GL]
    )  # fmt: skip
    said = capsys.readouterr().out
    assert code == 0, said
    wanted = celsius_at(place) / 100  # 0.6; a pixel of 20 mm is 0.01
    (read,) = re.findall(r"^lowest: <?([0-9.]+) m³/m³", said, re.M)
    assert 0.19 < float(read) < 0.22  # the wall's left end has 0.2
    assert "highest: " in said and "hottest" not in said
    row = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()[1].split(",")
    assert float(row[5]) == pytest.approx(wanted, abs=0.01)
    assert len(row[5].partition(".")[2]) == 6  # three digits more than people read
    text = out.read_text(encoding="utf-8")
    assert "Moisture inspection" in text and "Values are as the photos gave them" in text
    assert "emperature" not in text and "Thermal" not in text


def test_emissivity_is_of_temperatures_alone(wall, capsys):
    assert cli.main(["thermal", str(wall), "--emissivity", "0.9", *NO_GL]) == 2
    assert "m³/m³" in capsys.readouterr().err


def test_values_of_both_kinds_are_the_same_numbers(wall, tmp_path):
    """A stop's kind changes words; its numbers are those of heat with the same range."""
    heat = write_wall(tmp_path / "w", (Stop("RGB", 0.0), Stop("T", 1.0, "thermal", "gray", (0, 1))))
    seen = []
    for folder in (wall, heat):
        with open_renderer("none", "tiles") as (renderer, _):
            scene = measured_scene(Document.of(read_model(folder)))
            seen.append(draw_values(renderer, scene, wall_view()))
    assert np.array_equal(seen[0].values, seen[1].values, equal_nan=True)
    assert (seen[0].is_heat, seen[1].is_heat) == (False, True)


@pytest.mark.parametrize(
    ("change", "words"),
    [({"palette": "sunset"}, "there is no palette 'sunset'"),
     ({"unit": "x" * (LONGEST_UNIT + 1)}, f"at most {LONGEST_UNIT} printable letters"),
     ({"unit": "a\nb"}, "printable letters"), ({"unit": " %"}, "without space"),
     ({"unit": 5}, "unit"), ({"kind": "heat"}, "kind"), ({"value_range": [1, 1]}, "value_range")],
)  # fmt: skip
def test_what_no_stop_of_values_can_be(wall, tmp_path, change, words):
    """The list of layers is checked as a package is: by the same reader of stops."""
    said = json.loads((wall / LIST).read_text(encoding="utf-8"))
    said["stops"][1] |= change
    for file in wall.glob("*.ply"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / LIST).write_text(json.dumps(said), encoding="utf-8")
    with pytest.raises(BadFile, match=re.escape(words)):
        read_model(tmp_path)


def test_the_longest_unit_and_every_palette_open():
    for palette in PALETTES:
        assert Stop("a", 0, "values", palette, (0, 1), "µ" * LONGEST_UNIT).palette == palette
