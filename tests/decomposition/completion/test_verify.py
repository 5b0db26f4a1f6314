"""Render and verify: each reason to refuse, at its threshold, and a thing of the demo."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.decomposition.completion.verify import (
    LEAST_ALIKE_DB,
    LEAST_FEWER,
    MOST_LOST_DB,
    MOST_STRANGE,
    Tally,
    judge,
    strangeness,
)

GOOD = Tally(
    views=3, before=1000, after=100, meant=100, met=100, alike_db=45.0,
    error_before=1.0, error_after=1.0, beside=1000, strange=0.0, filled=100,
)  # fmt: skip


def test_a_good_step_is_accepted():
    verdict = judge(GOOD)
    assert verdict.is_accepted
    assert verdict.sentence() == "holes 1,000 -> 100 pixels in 3 views"


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"views": 0}, "no view shows the thing"),
        ({"meant": 0, "met": 0}, "there was no hole"),
        ({"met": int(100 * LEAST_FEWER) - 1}, "it closes 74 % of the holes"),
        ({"alike_db": LEAST_ALIKE_DB - 1e-6}, "it changes what is not behind the thing"),
        ({"alike_db": float("nan")}, "it changes what is not behind the thing"),
        ({"error_after": 1.001 * 10 ** (MOST_LOST_DB / 10)}, "it is less like the photos"),
        ({"error_after": float("nan")}, "it is less like the photos"),
        ({"strange": 100 * MOST_STRANGE + 1e-6}, "its colours are not those around"),
        ({"strange": float("nan")}, "its colours are not those around"),
    ],
)
def test_each_reason_to_refuse(change, word):
    verdict = judge(replace(GOOD, **change))
    assert not verdict.is_accepted
    assert word in verdict.sentence()
    assert verdict.sentence().startswith("refused: ")


@pytest.mark.parametrize(
    "change",
    [
        {"met": int(100 * LEAST_FEWER)},
        {"alike_db": LEAST_ALIKE_DB},
        {"strange": 100 * MOST_STRANGE},
    ],
)
def test_the_thresholds_themselves_pass(change):
    assert judge(replace(GOOD, **change)).is_accepted


def test_strangeness_is_the_distance_to_the_nearest_colour():
    known = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    told = strangeness(np.array([[0.0, 0.0, 0.1], [1.0, 0.8, 1.0]]), known)
    assert np.allclose(told, [0.1, 0.2])
