"""Render and verify: each reason to refuse, at its threshold, and a thing of the demo."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.decomposition.completion.verify import (
    LEAST_ALIKE_DB,
    LEAST_FEWER,
    MOST_AWAY,
    MOST_LOST_DB,
    MOST_STRANGE,
    Cells,
    PhotoView,
    Tally,
    judge,
    strangeness,
    verify,
)
from shapeshift.decomposition.partition import LabelledView
from shapeshift.runtime_models.model import AnchorFrames
from shapeshift.scene.pose import View, look_at, perspective
from tests.support.models import make_random_model

GOOD = Tally(
    views=3, before=1000, after=100, meant=100, met=100, alike_db=45.0,
    error_before=1.0, error_after=1.0, beside=1000, strange=0.0, filled=100,
    away=0.0, placed=100,
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
        ({"away": 100 * MOST_AWAY + 1e-6}, "sides of a cell off the plane"),
        ({"away": float("nan")}, "sides of a cell off the plane"),
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
        {"away": 100 * MOST_AWAY},
    ],
)
def test_the_thresholds_themselves_pass(change):
    assert judge(replace(GOOD, **change)).is_accepted


def test_strangeness_is_the_distance_to_the_nearest_colour():
    known = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    told = strangeness(np.array([[0.0, 0.0, 0.1], [1.0, 0.8, 1.0]]), known)
    assert np.allclose(told, [0.1, 0.2])


@pytest.mark.parametrize("lift", [0.0, 0.4, -0.7, 3.0])
def test_fills_are_measured_from_their_plane(device, lift):
    """A flat model, lifted by so many sides of a cell, seen through a hole all over the mask."""
    side = 0.02
    model = make_random_model(400)
    count = len(model.anchors)
    # 1e-4 of their size along the normal: means lie within 1e-4 of an offset of the plane.
    frames = AnchorFrames(
        np.tile(np.array([1, 1e-4, 1], np.float32), (count, 1)),
        np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
    )
    places = np.random.default_rng(0).uniform(-0.1, 0.1, (count, 3)) * (1, 0, 1)
    places[:, 1] = 0.5 + lift * side
    after = replace(model, anchors=places.astype(np.float32), frames=frames)
    before = after.with_anchors(np.zeros(count, bool))
    pose = look_at(np.array([0.02, 1.1, 0.05]), np.array([0, 0.5, 0.0]))
    view = View(pose, perspective(0.5, (64, 48)), 0.01, 10.0, (64, 48))
    labels = np.zeros((48, 64), np.uint8)
    labels[12:36, 16:48] = 1
    x, z = (g.ravel() for g in np.mgrid[-5:6, -5:6] * side)
    cells = Cells(np.stack([x, 0 * x + 0.5, z], 1), side, np.array([0.0, 1.0, 0.0]))
    told = verify(device, before, after, 1, [PhotoView(LabelledView(view, 0.0, labels))],
                  cells=cells)  # fmt: skip
    assert told.holes_before == 24 * 32
    assert told.holes_after < told.holes_before  # or nothing was measured
    assert told.away == pytest.approx(abs(lift), abs=0.05)
    assert verify(device, before, after, 1, [PhotoView(LabelledView(view, 0.0, labels))]).away == 0
