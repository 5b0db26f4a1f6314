"""The ticks of the thermal scale: round values, inside the range, written with one precision."""

import pytest
from pytest import approx

from shapeshift.app.editor.panels import scale_bar
from shapeshift.renderer.debug.debug_map import nice_ticks, tick_text


@pytest.mark.parametrize(
    ("low", "high", "want"),
    [
        (18.0, 84.0, ["20", "30", "40", "50", "60", "70", "80"]),
        (0.0, 1.0, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        (-20.0, 30.0, ["−20", "−10", "0", "10", "20", "30"]),
        (0.001, 0.004, ["0.0010", "0.0015", "0.0020", "0.0025", "0.0030", "0.0035", "0.0040"]),
        (5.0, 5.0, ["5"]),
    ],
)
def test_scale_ticks_are_round_and_inside(low, high, want):
    values = nice_ticks(low, high)
    assert tick_text(values) == want
    assert all(low - 1e-9 <= value <= high + 1e-9 for value in values)


def test_a_legend_in_another_unit():
    """Water freezes and boils, and nothing is colder than 0 K."""
    assert scale_bar.in_unit("\u00b0C", 0, 100, "\u00b0F") == ("\u00b0F", *map(approx, (32, 212)))
    assert scale_bar.in_unit("\u00b0F", 32, 212, "K") == ("K", *map(approx, (273.15, 373.15)))
    assert scale_bar.in_unit("K", 0, 273.15, "\u00b0C") == ("\u00b0C", *map(approx, (-273.15, 0)))
    for unit, wanted in (("W/m\u00b2", "K"), ("\u00b0C", ""), ("\u00b0C", "furlong")):
        assert scale_bar.in_unit(unit, 1, 2, wanted) == (unit, 1, 2)
