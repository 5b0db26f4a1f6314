"""Pixels to cells to places: each step against what was made up for it."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.change.places import (
    LEAST_VIEWS,
    ChangeSettings,
    SurfaceCells,
    cells_of,
    color_distance,
    find_places,
    inside_any,
    lab_of,
    means,
    medians,
    shape_misfit,
)
from shapeshift.scene.change.seen_pair import SeenPair, SeenSide, edge_pixels, samples_of
from shapeshift.scene.change.similarity import rotation_of
from tests.support.scene.warm_wall import wall_view

CELL = 0.02
SETTINGS = ChangeSettings(CELL, 0.03, 5.0, 14.0, 12)


def side(depth_m, coverage=1.0, value=None) -> SeenSide:
    """A wall of one colour at one depth, (72, 96) pixels."""
    shape = (72, 96)
    depth = np.broadcast_to(np.asarray(depth_m, float), shape).copy()
    values = None if value is None else np.full(shape, float(value))
    return SeenSide(np.full((*shape, 3), 0.5), np.full(shape, coverage), depth, values)


@pytest.mark.parametrize(
    "other, coverage, through",
    [
        (1.5, 1.0, 0.0), (1.53, 1.0, 0.0), (1.5301, 1.0, 1.0), (1.47, 1.0, 0.0),
        (1.4699, 1.0, np.nan), (np.nan, 0.2499, 1.0), (np.nan, 0.25, np.nan),
    ],
)  # fmt: skip
def test_what_the_other_visit_sees_through(other, coverage, through):
    """Behind by more than 3 cm, or open: gone; nearer by more: hidden; between: the same."""
    pair = SeenPair(wall_view(), side(1.5), side(other, coverage))
    samples = samples_of([pair], after=False, least_m=0.03 + 1e-12)
    assert len(samples.points) == 70 * 94 or len(samples.points) == 72 * 96
    np.testing.assert_array_equal(samples.through, through)
    own = samples_of([SeenPair(wall_view(), side(other, coverage), side(1.5))], True, 0.03 + 1e-12)
    np.testing.assert_array_equal(own.through, through)  # the same the other way round


def test_pixels_at_a_step_of_the_depth_do_not_count():
    depth = np.full((5, 6), 2.0)
    depth[:, 3:] = 2.1
    edges = edge_pixels(depth)
    assert edges[:, 2:4].all() and not edges[:, [0, 1, 4, 5]].any()
    depth[:, 3:] = 2.05
    assert not edge_pixels(depth).any()
    depth[2, 0] = np.nan
    assert edge_pixels(depth)[[1, 2, 3, 2], [0, 0, 0, 1]].all()


def test_medians_and_means_of_rows():
    rng = np.random.default_rng(0)
    row, values = rng.integers(0, 7, 200), rng.normal(size=200)
    values[rng.random(200) < 0.3] = np.nan
    values[row == 4] = np.nan
    found = medians(row, values, 8)
    wanted = [np.nanmedian(values[row == i]) if np.isfinite(values[row == i]).any() else np.nan
              for i in range(8)]  # fmt: skip
    np.testing.assert_allclose(found, wanted)
    np.testing.assert_allclose(means(row, row * 2.0, 8), [0, 2, 4, 6, 8, 10, 12, 0])


def test_a_cell_wants_three_views():
    for views in (LEAST_VIEWS - 1, LEAST_VIEWS):
        pairs = [
            SeenPair(wall_view((0.02 * i, 0, 1.5)), side(1.5), side(1.5)) for i in range(views)
        ]
        samples = samples_of(pairs, False, 0.03)
        cells = cells_of(samples, samples, 0.05)
        assert (len(cells) > 0) == (views == LEAST_VIEWS)
    assert (cells.views == LEAST_VIEWS).all() and (cells.through == 0).all()


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
        "value": 20 * one, "value_change": 0 * one,
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
