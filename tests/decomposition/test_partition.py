"""Partition: the rule by hand, balls whose labels are known, and the demo against its tracer."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.paths import DEMO
from shapeshift.decomposition.label_pictures import LabelPictures
from shapeshift.decomposition.partition import (
    LabelledView,
    ViewEvidence,
    fill_unseen,
    gather_evidence,
    label_rows,
    partition,
)
from shapeshift.decomposition.score import mean_score, score_maps
from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import BadFile, ObjectLabel, SplatLayers, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.synthetic.workshop import dome
from tests.support.models import make_random_model
from tools.synthetic.labels import OBJECTS, label_map, labels_of_places

NAMES = tuple(ObjectLabel(label, name) for label, name in enumerate(OBJECTS, 1))
SIZE = (192, 144)


@pytest.fixture(scope="module")
def device():
    return open_device()


def test_the_rule_at_its_thresholds():
    e = 1e-9
    sums = np.array(
        [
            [6, 4, 0],  # exactly the share: not above it
            [6, 4 + 1e-6, 0],
            [0, 5, 5],  # of equal ones the smaller label
            [1, 0, 9],
            [0, 1e-3, 0],  # exactly the least evidence: unseen
            [0, 1e-3 + e, 0],
            [0, 0, 0],
            [np.nan, 1, 0],
            [0, 0, np.inf],
        ]
    )
    assert label_rows(sums).tolist() == [0, 1, 1, 2, 0, 1, 0, 0, 0]
    assert label_rows(sums[:3], least_share=0.6).tolist() == [0, 0, 0]
    assert label_rows(np.ones((4, 1))).tolist() == [0] * 4


def test_unseen_rows_ask_their_nearest():
    rng = np.random.default_rng(0)
    places = np.concatenate([rng.normal(0, 0.1, (50, 3)), rng.normal(5, 0.1, (50, 3))])
    labels = np.repeat([0, 300], 50).astype(np.int32)
    seen = rng.random(100) < 0.5
    told = np.where(seen, labels, 7)
    assert np.array_equal(fill_unseen(places, told, seen), labels)
    assert np.array_equal(fill_unseen(places, told, np.zeros(100, bool)), told)  # nobody to ask
    assert np.array_equal(fill_unseen(places, labels, np.ones(100, bool)), labels)
    # Fewer seen than asked, and a tie: the smaller label.
    few = np.zeros(100, bool)
    few[[0, 99]] = True
    assert not fill_unseen(places, np.where(few, labels, 7), few)[~few].any()


def balls(count: int = 600) -> tuple[SplatLayers, np.ndarray]:
    """Three balls beside each other, labels 0, 1, 2."""
    rng = np.random.default_rng(1)
    of = np.resize([0, 1, 2], count)
    n = rng.normal(size=(count, 3))
    means = 0.3 * n / np.linalg.norm(n, axis=1)[:, None] + np.outer(of - 1, [0.8, 0, 0])
    f = np.float32
    model = SplatLayers(
        means.astype(f), np.full((count, 3), 0.04, f), np.tile(f([1, 0, 0, 0]), (count, 1)),
        np.full(count, 0.9, f), np.zeros((count, 1, 3), f), np.zeros(count, np.int32),
        (Stop("a", 0.0),),
    )  # fmt: skip
    return model, of.astype(np.int32)


def around(count: int, size=SIZE) -> list[View]:
    eyes = [(3 * np.sin(t), 0.8, 3 * np.cos(t)) for t in 2 * np.pi * np.arange(count) / count]
    return [
        View(look_at(eye, (0, 0, 0)), perspective(0.8, size), 0.05, 100.0, size) for eye in eyes
    ]


@pytest.mark.parametrize("antialiased", [False, True])
def test_balls_get_their_labels_back_splat_by_splat(device, antialiased):
    model, true = balls()
    model = replace(model, antialiased=antialiased)
    pictures = LabelPictures(device, model, true)
    views = [LabelledView(view, 0.0, pictures.label_map(view, 0.0)) for view in around(6)]
    told = []
    sums = gather_evidence(device, model, views, 3, lambda *done: told.append(done))
    assert told == [(i, 6) for i in range(7)]
    found = partition(model, sums, ())
    assert (found.labels == true).mean() > 0.99 and found.labels.dtype == np.int32
    # Half of the pictures silent about a ball is not half of them against it.
    silent = [
        replace(v, labels=np.where((v.labels == 1) & (i % 2 == 0), np.uint8(255), v.labels))
        for i, v in enumerate(views)
    ]
    again = partition(model, gather_evidence(device, model, silent, 3), ())
    assert (again.labels == true).mean() > 0.99


def test_shares_of_labels_add_up_to_what_is_covered(device):
    model, true = balls()
    view = around(1)[0]
    apart = LabelPictures(device, model, true).shares(view, 0.0, range(3))
    whole = LabelPictures(device, model, np.zeros_like(true)).shares(view, 0.0, [0])[0]
    assert np.abs(apart.sum(0) - whole).max() < 1e-5 and whole.max() > 0.9
    merged = LabelPictures(device, model, np.minimum(true, 1)).shares(view, 0.0, range(5))
    assert np.abs(merged[1] - apart[1:].sum(0)).max() < 1e-5 and not merged[2:].any()


def test_labels_beyond_a_map_are_refused(device):
    model, true = balls()
    for labels in (true + 253, true - 1):
        with pytest.raises(ValueError, match="the largest is 254"):
            LabelPictures(device, model, labels)


def test_evidence_is_gathered_at_each_pictures_own_x(device):
    model = make_random_model(anchors=60)
    view = around(1)[0]
    labels = np.ones(SIZE[::-1], np.uint8)
    at = {x: gather_evidence(device, model, [LabelledView(view, x, labels)], 2) for x in (0.0, 1.0)}
    assert np.abs(at[0.0] - at[1.0]).max() > 1
    mixed = ViewEvidence(device, model, 2)
    for x in (0.0, 1.0, 0.0):
        mixed.add(LabelledView(view, x, labels))
    assert np.array_equal(mixed.sums(), 2 * at[0.0] + at[1.0])


def test_a_model_that_follows_the_eye_is_refused(device):
    from shapeshift.runtime_models.model import ScaffoldModel

    rows = np.zeros((2, 3), np.float32)
    model = ScaffoldModel(rows, rows, np.zeros((2, 1, 3), np.float32), rows + 1, {})
    with pytest.raises(BadFile, match="a Scaffold-GS model's splats depend on the eye"):
        ViewEvidence(device, model, 2)


def test_the_demo_cut_by_six_views_agrees_with_its_tracer(device):
    """The large run is tools/decomposition/workshop.py; here thin things are a few pixels wide,
    so the measure is what labels by the places of anchors give.
    """
    model = read_model(DEMO)
    views = [LabelledView(view, 0.0, label_map(view)) for view in dome(6, 0.0, SIZE)]
    found = partition(model, gather_evidence(device, model, views, 11), NAMES)
    assert found.labels.dtype == np.uint8 and found.objects == NAMES
    assert found.networks is model.networks and found.anchors is model.anchors
    of_places = labels_of_places(model.anchors.astype(np.float64))[0]
    by_place = replace(model, labels=of_places, objects=NAMES)
    tests, score = dome(3, 0.17, SIZE), {}
    for x in (0.0, 1.0):
        for cut in (found, by_place):
            pictures = LabelPictures(device, cut)
            pairs = [(pictures.label_map(v, x), label_map(v, x)) for v in tests]
            score[cut is found, x] = mean_score(score_maps(pairs, NAMES))
        assert score[True, x] > max(0.97 * score[False, x], 0.75)
