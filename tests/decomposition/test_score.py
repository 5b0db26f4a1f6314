"""Scores of label maps: squares whose figures are known by counting."""

import numpy as np
import pytest

from shapeshift.decomposition.score import (
    SILENT,
    band_inside,
    boundary_iou,
    iou,
    mean_score,
    score_maps,
)
from shapeshift.runtime_models.model import ObjectLabel

A, B, C = ObjectLabel(1, "a"), ObjectLabel(2, "b"), ObjectLabel(3, "absent")


def square(left: int, side: int, label: int = 1, size: int = 100) -> np.ndarray:
    out = np.zeros((size, size), np.uint8)
    out[10 : 10 + side, left : left + side] = label
    return out


def test_a_map_against_itself_is_perfect_and_against_nothing_is_nothing():
    true = np.maximum(square(10, 20), square(60, 30, 2))
    scores = score_maps([(true, true)], (A, B, C))
    assert [(s.iou, s.boundary_iou, s.accuracy, s.views) for s in scores[:2]] == [(1, 1, 1, 1)] * 2
    assert scores[2].views == 0 and np.isnan(scores[2].iou)
    assert mean_score(scores) == 1  # what no view shows has no say
    nothing = score_maps([(np.zeros_like(true), true)], (A, B))
    assert [(s.iou, s.accuracy) for s in nothing] == [(0, 0)] * 2


def test_figures_by_counting():
    true, found = square(10, 20), square(15, 20)
    (score,) = score_maps([(found, true)], (A,))
    assert score.iou == pytest.approx(15 * 20 / (25 * 20))
    assert score.accuracy == pytest.approx(15 / 20)
    # Bands of 3 pixels: of each 20 x 20 - 14 x 14; by hand, they share what both have.
    one, other = band_inside(true == 1, 3), band_inside(found == 1, 3)
    assert one.sum() == other.sum() == 20 * 20 - 14 * 14
    assert score.boundary_iou == pytest.approx((one & other).sum() / (one | other).sum())
    assert score.boundary_iou < score.iou


def test_views_count_alike_then_objects():
    first = (square(10, 20), square(10, 20))
    second = (square(10, 20) * 0, square(10, 10))
    scores = score_maps([first, second, (square(5, 5) * 0,) * 2], (A, B))
    assert scores[0].iou == 0.5 and scores[0].views == 2
    wrong = score_maps([(square(10, 20, 2), square(10, 20))], (A, B))
    assert mean_score(wrong) == 0 and wrong[1].views == 1 and np.isnan(wrong[1].accuracy)


def test_what_is_silent_counts_neither_way():
    true, found = square(10, 20), square(10, 40)
    true[(found == 1) & (true == 0)] = SILENT
    assert score_maps([(found, true)], (A,))[0].iou == 1


def test_the_border_of_a_picture_is_an_edge():
    whole = np.ones((50, 50), bool)
    band = band_inside(whole, 2)
    assert band.sum() == 50 * 50 - 46 * 46
    assert boundary_iou(whole, whole) == 1 and np.isnan(boundary_iou(~whole, ~whole))
    assert iou(whole, ~whole) == 0


def test_maps_of_other_sizes_are_refused():
    with pytest.raises(ValueError, match="is compared with"):
        score_maps([(square(0, 5), square(0, 5, size=50))], (A,))
