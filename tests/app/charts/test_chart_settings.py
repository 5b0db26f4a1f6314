"""The table of named settings: unique, enough of them, nothing that a drawing does not read."""

from dataclasses import fields
from itertools import product

import pytest

from shapeshift.app.charts.chart_settings import (
    EXACT,
    NOT_READ,
    SETTINGS,
    Distances,
    changed_settings,
    named_settings,
    render_settings,
    settings_of,
)
from shapeshift.app.charts.comparison import exact
from shapeshift.app.errors import UsageError
from shapeshift.renderer.settings import RenderSettings

PLACES = Distances(2.0, 4.0)
BLACK = (0.0, 0.0, 0.0)


@pytest.mark.parametrize("drawing", ["tiles", "quads"])
def test_names_are_unique_and_enough(drawing):
    names = [named.name for named in settings_of(drawing)]
    assert len(set(names)) == len(names) >= 24
    assert names[0] == EXACT


@pytest.mark.parametrize("drawing", ["tiles", "quads"])
def test_no_two_rows_draw_the_same(drawing):
    """Each name is another picture or another way to it: equal settings would be one row twice."""
    rows = settings_of(drawing)
    drawn = {(render_settings(n, BLACK, drawing, PLACES), n.eyes) for n in rows}
    assert len(drawn) == len(rows)


def test_the_grid_of_table_3_is_whole():
    """tau_lambda none, 10, 20 by tau_dist none, near, far, for one eye and for two."""
    rows = {(render_settings(n, BLACK, "tiles", PLACES), n.eyes) for n in settings_of("tiles")}
    inf = float("inf")
    for pixels, metres, eyes in product((inf, 10.0, 20.0), (inf, 2.0, 4.0), (1, 2)):
        assert (RenderSettings(max_pixels=pixels, max_distance=metres), eyes) in rows


def test_what_a_drawing_does_not_read_is_left_out():
    for drawing, idle in NOT_READ.items():
        assert not any(field in n.changes for n in settings_of(drawing) for field in idle)
    assert any("min_transmittance" in n.changes for n in settings_of("tiles"))
    targets = {n.changes.get("target") for n in settings_of("quads")}
    assert {"rgba8", "rgba16f", "auto"} <= targets
    known = {field.name for field in fields(RenderSettings)}
    assert all(set(n.changes) <= known for n in SETTINGS)


@pytest.mark.parametrize("drawing", ["tiles", "quads"])
def test_a_quick_chart_is_about_ten_rows_for_one_eye(drawing):
    rows = settings_of(drawing, quick=True)
    assert 9 <= len(rows) <= 15
    assert {n.eyes for n in rows} == {1}
    assert all(n in settings_of(drawing) for n in rows)


def test_exact_is_float_and_shortcuts_blend_as_the_viewer_does():
    by_name = {n.name: n for n in SETTINGS}
    assert render_settings(by_name[EXACT], BLACK, "quads", PLACES) == exact(
        RenderSettings(), "quads"
    )
    assert render_settings(by_name[EXACT], BLACK, "quads", PLACES).target == "rgba32f"
    assert render_settings(by_name["from 2 px"], BLACK, "quads", PLACES).target == "auto"
    assert render_settings(by_name["near"], BLACK, "tiles", PLACES).max_distance == 2.0
    assert render_settings(by_name["far"], (1, 0, 0), "tiles", PLACES).background == (1, 0, 0)


def test_a_name_that_is_not_there_is_one_sentence():
    with pytest.raises(UsageError, match="no setting 'sort every 3'; choose one of: exact;"):
        named_settings("sort every 3", "tiles")
    with pytest.raises(UsageError, match="'rgba8' changes nothing in tiles; choose --drawing q"):
        named_settings("rgba8", "tiles")
    with pytest.raises(UsageError, match="changes nothing in quads; choose --drawing tiles"):
        named_settings("stop at 1/64", "quads")
    assert named_settings("rgba8", "quads").changes == {"target": "rgba8"}


def test_told_changes():
    assert changed_settings(RenderSettings(background=(1, 1, 1))) == ""
    told = changed_settings(RenderSettings(min_alpha=2 / 255, key_bits=16, skip_unseen=True))
    assert told == "min_alpha=0.0078431 key_bits=16 skip_unseen=True"
