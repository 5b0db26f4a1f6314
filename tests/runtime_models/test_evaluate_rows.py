"""A control value for each anchor, and colours of some anchors alone: against one value for all."""

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import BATCH, Evaluator, evaluate
from tests.support.models import make_random_model
from tests.support.splat_scenes import random_layers

EYE = np.array([0.3, -2.0, 1.0])


def every_part(model, x) -> list[np.ndarray]:
    """means, scales, wxyz, opacity, color of the plain twin, as rows of splats."""
    splats = evaluate(model, x, EYE)
    return [splats.means, splats.scales, splats.wxyz, splats.opacity, splats.color]


@pytest.mark.parametrize("fold", [True, False])
@pytest.mark.parametrize("hidden", [(), (32,), (7, 64, 9)])
def test_each_anchor_has_its_own_control_value(fold, hidden):
    model = make_random_model(101, k=3, features=5, hidden=hidden)
    values = np.array([0.0, 0.25, 0.9], np.float32)
    which = np.random.default_rng(0).integers(0, 3, 101)
    evaluator = Evaluator(model, fold=fold)
    mixed = [*evaluator.geometry(values[which]), evaluator.color(values[which], EYE)]
    for i, x in enumerate(values):
        mine = np.repeat(which == i, 3)
        for got, want in zip(mixed, every_part(model, float(x)), strict=True):
            np.testing.assert_allclose(got[mine], want[mine], atol=2e-5)


def test_one_value_for_each_is_the_value_for_all():
    model = make_random_model(40, k=2)
    evaluator = Evaluator(model)
    one, many = evaluator.geometry(0.4), evaluator.geometry(np.full(40, 0.4, np.float32))
    for a, b in zip(one, many, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


def test_a_smooth_border_and_batches_join_without_a_seam():
    model = make_random_model(BATCH + 3, k=1, features=2, hidden=(4,))
    x = np.linspace(0, 1, BATCH + 3).astype(np.float32)
    got = Evaluator(model).geometry(x)
    for row in (0, BATCH - 1, BATCH, BATCH + 2):
        want = every_part(model, float(x[row]))
        for a, b in zip(got, want, strict=False):
            np.testing.assert_allclose(a[row], b[row], atol=2e-5)


def test_layers_take_a_value_for_each_splat():
    layers = random_layers(300, layers=3)
    x = np.random.default_rng(0).uniform(0, 1, 300).astype(np.float32)
    got = Evaluator(layers).geometry(x)[3]
    want = [Evaluator(layers).geometry(float(v))[3][i] for i, v in enumerate(x)]
    np.testing.assert_allclose(got, want, atol=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("kind", ["anchors", "layers"])
@pytest.mark.parametrize("per_anchor", [False, True])
def test_what_is_not_seen_keeps_its_colour(kind, share, per_anchor):
    model = make_random_model(77, k=5) if kind == "anchors" else random_layers(77, coefficients=9)
    rng = np.random.default_rng(1)
    seen = rng.uniform(size=77) < share
    x = rng.uniform(size=77).astype(np.float32) if per_anchor else 0.3
    evaluator = Evaluator(model)
    whole = evaluator.color(x, EYE)
    kept = np.full_like(whole, -7)
    got = evaluator.color(x, EYE, seen, kept)
    assert (got is kept) == (share < 1), "all of them are as quick without picking rows"
    splats = np.repeat(seen, len(whole) // 77)
    np.testing.assert_allclose(got[splats], whole[splats], atol=1e-6)
    assert (got[~splats] == -7).all()
    np.testing.assert_array_equal(evaluator.color(x, EYE, seen)[~splats], 0)


def test_quaternions_as_they_come_point_the_same_way():
    evaluator = Evaluator(make_random_model(50, k=4))
    unit, raw = evaluator.geometry(0.6)[2], evaluator.geometry(0.6, unit=False)[2]
    length = np.linalg.norm(raw, axis=1, keepdims=True)
    assert np.ptp(length) > 0.01
    np.testing.assert_allclose(unit, raw / length, atol=1e-6)
