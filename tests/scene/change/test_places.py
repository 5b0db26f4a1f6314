"""Pixels to cells to places: each step against what was made up for it."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.change import seen
from shapeshift.scene.change.places import (
    LEAST_VIEWS,
    ChangeSettings,
    SurfaceCells,
    cells_of,
    color_distance,
    exposure_of,
    find_places,
    inside_any,
    lab_of,
    least_change,
    linear_of,
    own_surface,
    shape_misfit,
)
from shapeshift.scene.change.seen import (
    SeenSide,
    SeenVisit,
    edge_pixels,
    evidence_at,
    median_of_views,
)
from shapeshift.scene.change.similarity import Similarity, rotation_of
from tests.support.scene.warm_wall import wall_view

CELL = 0.02
NOWHERE = Similarity.identity()
SETTINGS = ChangeSettings(CELL, 0.03, 5.0, 14.0, 12)


def side(depth_m, coverage=1.0, value=None) -> SeenSide:
    """A wall of one colour at one depth, (72, 96) pixels."""
    shape = (72, 96)
    depth = np.broadcast_to(np.asarray(depth_m, float), shape).copy()
    values = None if value is None else np.full(shape, float(value))
    return SeenSide(np.full((*shape, 3), 0.5), np.full(shape, coverage), depth, values)


def visit(views: int, *sides: SeenSide) -> SeenVisit:
    """Sides seen from places that are 2 cm apart."""
    eyes = [wall_view((0.02 * i, 0, 1.5)) for i in range(views)]
    return SeenVisit(eyes, [sides[i % len(sides)] for i in range(views)], NOWHERE, True)


@pytest.mark.parametrize(
    "shown, coverage, told",
    [
        (1.5, 1.0, (1, 0, 0)), (1.53, 1.0, (1, 0, 0)), (1.5301, 1.0, (0, 1, 0)),
        (1.47, 1.0, (1, 0, 0)), (1.4699, 1.0, (0, 0, 1)), (np.nan, 0.2499, (0, 1, 0)),
        (np.nan, 0.25, (0, 0, 0)),
    ],
)  # fmt: skip
def test_what_a_visit_says_of_points(shown, coverage, told):
    """A wall 3 cm behind is seen through, or nothing; nearer hides; between it is the same."""
    points = np.array([[0.0, 0, 0], [0.1, 0.1, 0], [0, 0, 9], [50, 0, 0]])  # behind, beside
    found = evidence_at(points, visit(1, side(shown, coverage)), 0.03 + 1e-12)
    counts = np.stack([found.same, found.through, found.hidden], axis=1)
    np.testing.assert_array_equal(counts, [told, told, (0, 0, 0), (0, 0, 0)])
    assert np.isfinite(found.color[:, 0]).tolist() == [bool(told[0])] * 2 + [False] * 2
    assert not np.isfinite(found.color[2:]).any() and not np.isfinite(found.value).any()


def test_no_points_and_more_than_a_chunk_are_asked(monkeypatch):
    asked = visit(2, side(1.5, value=20.0))
    assert len(evidence_at(np.zeros((0, 3)), asked, 0.03).same) == 0
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (33, 3)) * (1, 1, 0.1)
    whole = evidence_at(points, asked, 0.03)
    monkeypatch.setattr(seen, "CHUNK", 16)
    for name, values in vars(evidence_at(points, asked, 0.03)).items():
        np.testing.assert_array_equal(values, getattr(whole, name))
    assert (whole.value[whole.same > 0] == 20).all() and (whole.same == 2).any()


def test_pixels_at_a_step_of_the_depth_do_not_count():
    depth = np.full((5, 6), 2.0)
    depth[:, 3:] = 2.1
    edges = edge_pixels(depth)
    assert edges[:, 2:4].all() and not edges[:, [0, 1, 4, 5]].any()
    depth[:, 3:] = 2.05
    assert not edge_pixels(depth).any()
    depth[2, 0] = np.nan
    assert edge_pixels(depth)[[1, 2, 3, 2], [0, 0, 0, 1]].all()


def test_medians_of_views():
    rng = np.random.default_rng(0)
    stack = rng.normal(size=(7, 40, 3))
    stack[rng.random(stack.shape) < 0.5] = np.nan
    stack[:, :2] = np.nan
    wanted = [[np.median(c) if len(c := row[np.isfinite(row)]) else np.nan for row in point]
              for point in stack.transpose(1, 2, 0)]  # fmt: skip
    np.testing.assert_allclose(median_of_views(stack), wanted)
    assert np.isnan(median_of_views(stack[:0])).all()


@pytest.mark.parametrize("views", [LEAST_VIEWS - 1, LEAST_VIEWS])
def test_three_views_of_either_visit_are_evidence(views):
    many, few = visit(6, side(1.5)), visit(views, side(1.5))
    own = own_surface(few, SETTINGS)
    assert (len(own.points) > 0) == (views == LEAST_VIEWS)
    known, gone = own_surface(many, SETTINGS), visit(views, side(np.nan, 0.0))
    cells = cells_of(known, own_surface(gone, SETTINGS), gone, SETTINGS)
    assert np.isfinite(cells.through).any() == (views == LEAST_VIEWS)
    assert (cells.through[np.isfinite(cells.through)] == 1).all()
    assert (cells.contrast == np.inf).all()  # nothing lies behind


def test_what_own_views_see_through_is_fog():
    """Three of six views show something 50 cm before the wall that the others look through."""
    fog = visit(6, side(1.0), side(1.5))
    own = own_surface(fog, SETTINGS)
    assert len(own.points) and (np.abs(own.points[:, 2]) < 0.1).all()  # the wall alone
    assert (own.all_points[:, 2] > 0.3).any()  # both were seen


def test_another_exposure_is_no_other_colour():
    """Light of 1.5, 1.4 and 1.6 times: all cells alike, but for a third that is painted."""
    rng = np.random.default_rng(0)
    own = rng.uniform(0.2, 0.5, (300, 3))
    factor = np.array([1.5, 1.4, 1.6])
    other = (linear_of(own) * factor).clip(0, 1)
    other = np.where(other <= 0.0031308, 12.92 * other, 1.055 * other ** (1 / 2.4) - 0.055)
    other[:100] = rng.uniform(0.3, 0.6, (100, 3))
    found = exposure_of(own, other)
    np.testing.assert_allclose(found, factor, rtol=0.02)
    np.testing.assert_allclose(lab_of(other[100:], factor), lab_of(own[100:]), atol=1e-6)
    np.testing.assert_array_equal(exposure_of(own[:99], other[:99]), 1)  # too few to tell
    np.testing.assert_array_equal(exposure_of(own, np.full((300, 3), np.nan)), 1)


@pytest.mark.parametrize("contrast, found", [(6.0, True), (5.99, False), (np.inf, True)])
def test_a_surface_before_its_own_colour_is_not_said_to_be_gone(contrast, found):
    new = patch((0.0, 0.0, 0.0), through=1.0, away_m=0.1, contrast=contrast)
    assert [p.kind for p in find_places(FLOOR, both(FLOOR, new), SETTINGS)] == ["appeared"] * found


def test_a_colour_a_cell_beside_is_the_same_colour():
    """A stripe that lies a cell beside is no change; a painted area is one."""
    points = np.stack([np.arange(30) * CELL, np.zeros(30), np.zeros(30)], axis=1)
    lab, other = np.zeros((2, 30, 3))
    lab[10, 1], other[11, 1], other[20:, 2] = 40, 40, 30
    found = color_distance(least_change(other - lab, lab, other, points, points))
    assert (found[:16] == 0).all() and (found[24:] == 30).all()


def test_a_value_a_cell_beside_is_the_same_value():
    """An edge of 40 degrees that the other capture shows a cell beside is no change; a wall that
    is 9 degrees warmer is one, everywhere, edge or not.
    """

    def warm(edge: int, more: float = 0.0) -> SeenVisit:
        value = np.where(np.arange(96) < edge, 20.0, 60.0) + more
        seen = side(1.5)
        return visit(3, replace(seen, value=np.broadcast_to(value, (72, 96)).copy()))

    before = warm(30)
    for other, least, most in ((before, 0, 0), (warm(31), 0, 0), (warm(30, 9.0), 9, 9)):
        surfaces = own_surface(before, SETTINGS), own_surface(other, SETTINGS)
        change = cells_of(*surfaces, other, SETTINGS).value_change
        assert np.isfinite(change).mean() > 0.9
        known = change[np.isfinite(change)]
        assert least <= known.min() and known.max() <= most + 1e-9


def test_lab_of_known_colours():
    """CIE values of sRGB's red, of white, black and middle grey (Lindbloom)."""
    found = lab_of(np.array([[1.0, 0, 0], [1, 1, 1], [0, 0, 0], [0.5, 0.5, 0.5]]))
    wanted = [[53.24, 80.09, 67.20], [100, 0, 0], [0, 0, 0], [53.39, 0, 0]]
    np.testing.assert_allclose(found, wanted, atol=0.02)
    assert color_distance(np.array([20.0, 3, 4])) == pytest.approx(np.hypot(7, 5))


def test_inside_a_group_and_around_it():
    group = np.random.default_rng(0).random((200, 3)) * (0.2, 0.3, 0.0)  # flat
    reach = 4 * CELL
    points = np.array(
        [[0.1, 0.15, 0.9 * reach], [0.1, 0.15, 1.1 * reach], [0.1, 0.5, 0], [0.1, 0.1, 0]]
    )
    assert inside_any(points, [group], SETTINGS).tolist() == [True, False, False, True]
    assert not inside_any(points, [], SETTINGS).any()


def patch(centre, size=(8, 8), **fields) -> SurfaceCells:
    """A level square of cells, all alike."""
    x, z = (g.ravel() for g in np.meshgrid(*(np.arange(n) * CELL for n in size)))
    points = np.stack([x, np.zeros_like(x), z], axis=1) + centre
    one = np.ones(len(points))
    usual = {
        "views": 9 * one, "through": 0 * one, "away_m": 0.001 * one,
        "color": one[:, None] * (0.5, 0.5, 0.5), "color_change": np.zeros((len(points), 3)),
        "value": 20 * one, "value_change": 0 * one, "contrast": 40 * one,
    }  # fmt: skip
    made = {k: np.broadcast_to(fields[k], usual[k].shape) if k in fields else v
            for k, v in usual.items()}  # fmt: skip
    return SurfaceCells(points, **made)


def both(*groups: SurfaceCells) -> SurfaceCells:
    names = SurfaceCells.__dataclass_fields__
    return SurfaceCells(**{n: np.concatenate([getattr(g, n) for g in groups]) for n in names})


FLOOR = patch((2.0, 0.0, 2.0))


def test_nothing_is_found_where_nothing_changed():
    assert find_places(FLOOR, FLOOR, SETTINGS) == []


@pytest.mark.parametrize("change, kind", [(-5.0, "hotter"), (-4.999, None), (5.0, "colder"),
                                          (np.nan, None)])  # fmt: skip
def test_heat_counts_from_the_least_value_on(change, kind):
    warm = patch((0.0, 0.0, 0.0), value_change=change, value=48.0)
    places = find_places(FLOOR, both(FLOOR, warm), SETTINGS, "°C")
    assert [place.kind for place in places] == ([] if kind is None else [kind])
    if kind is not None:
        assert (places[0].amount, places[0].level, places[0].unit) == (-change, 48.0, "°C")
        np.testing.assert_allclose(places[0].centre, (3.5 * CELL, 0, 3.5 * CELL))


@pytest.mark.parametrize("through, away, found", [(0.5, 0.03, True), (0.499, 0.03, False),
                                                  (1.0, 0.0299, False)])  # fmt: skip
def test_shapes_want_both_a_view_through_and_a_distance(through, away, found):
    new = patch((0.0, 0.0, 0.0), through=through, away_m=away)
    kinds = [p.kind for p in find_places(FLOOR, both(FLOOR, new), SETTINGS)]
    assert kinds == ["appeared"] * found
    kinds = [p.kind for p in find_places(both(FLOOR, new), FLOOR, SETTINGS)]
    assert kinds == ["vanished"] * found


def test_places_are_of_twelve_cells_that_hang_together():
    for size, count in (((3, 4), 1), ((1, 11), 0)):
        new = patch((0.0, 0.0, 0.0), size, through=1.0, away_m=0.1)
        assert len(find_places(FLOOR, both(FLOOR, new), SETTINGS)) == count
    gap = patch((0.0, 0.0, 9 * CELL), through=1.0, away_m=0.1)  # two cells away from the first
    near = patch((0.0, 0.0, 0.0), through=1.0, away_m=0.1)
    assert len(find_places(FLOOR, both(FLOOR, near, gap), SETTINGS)) == 2


def test_what_is_alike_and_elsewhere_has_moved():
    gone = patch((0.0, 0.0, 0.0), (6, 9), through=1.0, away_m=0.1)
    there = patch((0.6, 0.0, 0.2), (9, 6), through=1.0, away_m=0.1)  # a quarter of a turn
    place = find_places(both(FLOOR, gone), both(FLOOR, there), SETTINGS)[0]
    assert place.kind == "moved"
    wanted = np.add((0.6, 0, 0.2), (1.5 * CELL, 0, -1.5 * CELL))
    np.testing.assert_allclose(place.shift, wanted, atol=1e-12)
    assert place.amount == pytest.approx(np.linalg.norm(wanted))
    red = replace(there, color=np.broadcast_to((0.9, 0.1, 0.1), there.color.shape))
    kinds = {p.kind for p in find_places(both(FLOOR, gone), both(FLOOR, red), SETTINGS)}
    assert kinds == {"appeared", "vanished"}


def test_a_shadow_belongs_to_what_throws_it():
    """Colours that touch a new thing are left out; the same far away are a place."""
    new = patch((0.0, 0.1, 0.0), through=1.0, away_m=0.1)
    for x, kinds in ((0.0, ["appeared"]), (1.0, ["appeared", "recoloured"])):
        shade = patch((x, 0.03, 0.0), color_change=(0.0, 20.0, 0.0))
        found = find_places(FLOOR, both(FLOOR, new, shade), SETTINGS)
        assert sorted(p.kind for p in found) == kinds


def test_a_thing_fits_itself_turned_and_nothing_else():
    rng = np.random.default_rng(0)
    thing = rng.random((300, 3)) * (0.3, 0.1, 0.12)
    turned = thing @ rotation_of(np.array([0.0, 1.0, 0.0])).T + (2, 0, 1)
    ball = rng.normal(size=(300, 3))
    ball *= 0.1 / np.linalg.norm(ball, axis=1, keepdims=True)
    assert shape_misfit(thing, turned) < 0.001
    assert shape_misfit(thing, ball) > 0.015
