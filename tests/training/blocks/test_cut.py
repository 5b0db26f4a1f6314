"""Where scenes are cut: halves at medians, grids of quantiles, turned rectangles, what is far."""

import math

import numpy as np
import pytest

from shapeshift.runtime_models.blocks.read_blocks import turned
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.blocks.block_start import context_of
from shapeshift.training.blocks.cut import (
    Wanted,
    cut_whole,
    far_away,
    folded_degrees,
    grid_boxes,
    halved,
    smallest_rectangle,
)
from shapeshift.training.blocks.starts import expected_anchors

RNG = np.random.default_rng(0)


def in_one_each(boxes, places):
    """Boxes are half-open and fill space: every place lies in exactly one."""
    held = np.stack([box.holds(places) for box in boxes])
    assert (held.sum(axis=0) == 1).all()
    return held.sum(axis=1)


@pytest.mark.parametrize(
    ("text", "count", "grid"),
    [("auto", None, None), (" 4X2 ", None, (4, 2)), ("1", 1, None), ("1023", 1023, None)],
)
def test_what_may_be_asked_for(text, count, grid):
    assert Wanted.of(text) == Wanted(count, grid)


@pytest.mark.parametrize("text", ["0", "1024", "0x4", "-1", "4x", "x4", "32x32", "2.5", "NaN", ""])
def test_what_may_not(text):
    with pytest.raises(ValueError, match="auto, a number from 1 to 1023"):
        Wanted.of(text)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7])
def test_halving_keeps_blocks_alike(count):
    places = RNG.normal(size=(997, 3)) * [10, 1, 4]
    held = in_one_each(halved(places, count, 0), np.concatenate([places, 1e6 * places]))
    counts = in_one_each(halved(places, count, 0), places)
    assert len(held) == count
    assert counts.max() <= 2 * counts.min() + 2  # the fullest is halved: never more than twice


@pytest.mark.parametrize("most", [124, 125, 249, 996, 997, 998])
def test_auto_stops_at_the_bound_exactly(most):
    places = RNG.normal(size=(997, 3))
    counts = in_one_each(halved(places, 1000, most), places)
    assert counts.max() <= most and (len(counts) == 1) == (most >= 997)


def test_places_that_are_one_are_not_cut_and_doubles_stay_together():
    assert len(halved(np.ones((50, 3)), 4, 0)) == 1
    doubled = np.repeat([[0.0, 0, 0], [1.0, 0, 0]], [40, 3], axis=0)
    assert in_one_each(halved(doubled, 2, 0), doubled).tolist() == [40, 3]


def test_a_grid_has_the_longer_side_first_and_equally_many_places():
    places = RNG.uniform(size=(4000, 3)) * [3, 1, 30]
    boxes = grid_boxes(places, (4, 2))
    assert in_one_each(boxes, places).tolist() == [500] * 8
    assert len({box.low[2] for box in boxes}) == 4  # z is the longer one here
    assert all(box.low[1] == -math.inf and box.high[1] == math.inf for box in boxes)


def test_a_grid_of_more_cells_than_places_leaves_some_out():
    places = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0.5]])
    assert in_one_each(grid_boxes(places, (4, 2)), places).sum() == 3


@pytest.mark.parametrize("degrees", [0.0, 17.0, 44.0, -30.0])
def test_the_frame_is_turned_to_the_smallest_rectangle(degrees):
    corners = np.array([[0.0, 0, 0], [8, 1, 0], [8, 2, 3], [0, 3, 3], [4, 0, 1.5]])
    # turned() takes places into a frame; the other way round they lie askew.
    askew = turned(corners, -degrees)
    assert smallest_rectangle(askew) == pytest.approx(degrees, abs=2e-3)


@pytest.mark.parametrize(
    "places", [np.zeros((1, 3)), np.zeros((9, 3)), np.outer(np.arange(5.0), [1, 0, -1])]
)
def test_places_on_a_point_or_a_line_have_a_frame_too(places):
    found = smallest_rectangle(places)
    assert found in (0.0, 45.0)


def test_degrees_fold_to_one_quarter_turn():
    given = [-45, 45, 135, 90, -90, 44.9996, 0]
    assert [folded_degrees(d) for d in given] == [45, 45, 45, 0, 0, 45, 0]


def test_far_is_measured_by_the_largest_side_of_the_cameras_box():
    eyes = np.array([[-1.0, 1.5, 0], [3.0, 1.5, 1.0]])  # largest side 4 m: the cube's half is 6 m
    middle = np.array([1.0, 1.5, 0.5])
    at = middle + np.array([[6.0, 0, 0], [0, np.nextafter(6, 7) + 1e-9, 0], [0, 0, -6.1]])
    assert far_away(at, eyes).tolist() == [False, True, True]
    assert not far_away(at * 1e9, eyes[:1]).any()  # one camera: nothing is far


def test_auto_asks_for_points(tmp_path):
    bare = Capture(tmp_path, (), ())
    with pytest.raises(BadFile, match="--blocks 4x2"):
        expected_anchors(bare)
    grid = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), -1).reshape(-1, 3).astype(np.float32)
    assert len(expected_anchors(Capture(tmp_path, (), (), np.repeat(grid, 3, axis=0)))) == 216


def test_the_number_of_blocks_follows_what_is_expected():
    anchors, expected = RNG.normal(size=(100, 3)), RNG.normal(size=(1000, 3))
    cut = cut_whole(anchors, Wanted(), expected, 300)
    counts = in_one_each(cut.boxes, turned(expected, cut.turn_degrees))
    assert len(cut.boxes) == 4 and counts.max() <= 300
    assert len(cut_whole(anchors, Wanted(), expected, 1000).boxes) == 1


def test_context_is_all_but_the_least_outside():
    weights = np.array([50.0, 0.5, 1.0, 0.6, 0.0, 47.9])
    own = np.array([True, False, False, False, False, False])
    # 2 % of 100 may go: 0, 0.5, 0.6 together are 1.1, with the next 2.1.
    assert context_of(weights, own).tolist() == [False, False, True, False, False, True]
    assert not context_of(np.zeros(3), np.zeros(3, bool)).any()
