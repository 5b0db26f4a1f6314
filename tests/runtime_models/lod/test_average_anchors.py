"""Averaged anchors: alone they stay as they are, labels stay apart, what shows nothing counts for
nothing, and what they show has its place and size.
"""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.lod.average_anchors import (
    anchor_looks,
    average_anchors,
    cell_for,
    cells_of,
)
from shapeshift.runtime_models.model import AnchorFrames, ObjectLabel
from shapeshift.runtime_models.rotation import normalize
from tests.support.models import make_random_model


def with_frames(model, seed=3):
    rng = np.random.default_rng(seed)
    count = len(model.anchors)
    frames = AnchorFrames(
        rng.uniform(0.5, 2, (count, 3)).astype(np.float32),
        normalize(rng.normal(size=(count, 4)).astype(np.float32)),
    )
    return replace(model, frames=frames)


@pytest.mark.parametrize("framed", [False, True])
def test_anchors_that_are_alone_in_their_cells_stay(framed):
    model = make_random_model(60)
    model = with_frames(model) if framed else model
    coarse = average_anchors(model, 1e-4)
    assert len(coarse.anchors) == 60 and coarse.networks is model.networks
    for x in (0.0, 0.37, 1.0):
        # float32 of places about 1 m and of what networks make of features about 1
        ours, theirs = Evaluator(coarse).geometry(x), Evaluator(model).geometry(x)
        for one, other in zip(ours[:2], theirs[:2], strict=True):
            np.testing.assert_allclose(one, other, atol=3e-6)
        np.testing.assert_allclose(ours[3], theirs[3], atol=1e-5)


def test_one_cell_holds_all_and_its_anchor_is_the_mean_by_what_each_shows():
    model = make_random_model(40)
    model = replace(model, anchors=model.anchors + 5)
    coarse = average_anchors(model, 1000.0)
    shown = np.zeros(40)
    for stop in model.stops:  # written out another way than the code has it
        _, scales, _, opacity = Evaluator(model).geometry(stop.x)
        broad = scales.prod(axis=1) / scales.min(axis=1)
        shown += (np.maximum(opacity, 0) * broad).reshape(40, -1).sum(axis=1)
    wanted = (shown[:, None] * model.anchors).sum(axis=0) / shown.sum()
    # anchors that show nothing have 1e-6 of the mean all the same
    np.testing.assert_allclose(coarse.anchors, wanted[None], atol=1e-5)
    assert len(coarse.features) == 1
    # It reaches about as far as they lay apart: the mean square about the mean is kept.
    together = (shown * ((model.anchors - wanted) ** 2).sum(axis=1)).sum() / shown.sum()
    _, own = anchor_looks(model)
    growth = np.sqrt(1 + together / np.average(own, weights=shown))
    np.testing.assert_allclose(coarse.frames.scales, min(growth, 8.0), rtol=1e-3)


def test_labels_stay_apart():
    model = make_random_model(50)
    labels = (np.arange(50) % 2).astype(np.uint8)
    model = replace(model, labels=labels, objects=(ObjectLabel(1, "one"),))
    coarse = average_anchors(model, 1000.0)
    np.testing.assert_array_equal(coarse.labels, [0, 1])
    group, count = cells_of(model, 1000.0)
    assert count == 2 and (group == labels).all()


def test_quaternions_of_either_sign_do_not_cancel():
    model = with_frames(make_random_model(2, seed=5))
    wxyz = np.array([[0.6, 0.8, 0, 0], [-0.6, -0.8, 0, 0]], np.float32)
    model = replace(model, frames=AnchorFrames(model.frames.scales, wxyz))
    (turn,) = average_anchors(model, 1000.0).frames.wxyz
    assert abs(abs(turn @ wxyz[0]) - 1) < 1e-6


@pytest.mark.parametrize("share", [0.5, 0.25, 0.08])
def test_cells_leave_about_the_share_that_is_asked_for(share):
    model = make_random_model(3000)
    found = len(average_anchors(model, cell_for(model, share)).anchors)
    assert abs(found / (share * 3000) - 1) < 0.05  # cells come in steps, of a few anchors each


def test_few_anchors_and_no_edges():
    alone = make_random_model(1)
    assert len(average_anchors(alone, cell_for(alone, 0.5)).anchors) == 1
    alike = replace(make_random_model(7), anchors=np.ones((7, 3), np.float32))
    assert len(average_anchors(alike, cell_for(alike, 0.1)).anchors) == 1
    for edge in (0.0, -1.0, np.nan, 1e-30):
        with pytest.raises(ValueError, match="a longer edge"):
            cells_of(make_random_model(9), edge)
