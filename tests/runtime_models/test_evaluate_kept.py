"""Evaluator: memory that is used again, and what of the features it keeps, change no number."""

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import (
    Evaluator,
    directions,
    evaluate,
    shape_follows_control,
)
from shapeshift.runtime_models.model import HEADS, ControlEncoding
from shapeshift.runtime_models.session import FoldedNetwork, WholeNetwork
from shapeshift.runtime_models.stop_weights import encode_rows
from tests.support.models import make_random_model, with_frames, without_control

EYE = np.array([0.3, -0.2, 2.0])


@pytest.mark.parametrize("own", [False, True])
def test_kept_memory_holds_what_fresh_memory_would(own):
    model = make_random_model(70, k=3)
    fresh, kept = Evaluator(model), Evaluator(model, keep=True)
    out = np.empty((model.splat_count, 3), np.float32)
    for step in range(3):
        x = np.random.default_rng(step).uniform(0, 1, 70).astype(np.float32) if own else step / 3
        places = []
        for a, b in zip(fresh.geometry(x), kept.geometry(x), strict=True):
            np.testing.assert_array_equal(a, b)
            places.append(b.ctypes.data)
        again = kept.geometry(x)
        assert [again[i].ctypes.data for i in (0, 1, 3)] == [places[i] for i in (0, 1, 3)]
        assert np.shares_memory(kept.color(x, EYE, out=out), out)
        np.testing.assert_array_equal(out, fresh.color(x, EYE))


GEOMETRY = ("offset", "scale", "rotation", "opacity")


@pytest.mark.parametrize("fixed", [("offset",), ("scale", "rotation"), HEADS])
def test_a_network_that_does_not_see_x_runs_once(fixed, monkeypatch):
    model = without_control(make_random_model(70, k=3), *fixed)
    fresh, kept, ran = Evaluator(model), Evaluator(model, keep=True), []
    run = Evaluator._run  # what runs is spared; results are the same
    monkeypatch.setattr(Evaluator, "_run", lambda *a: ran.append(a[1]) or run(*a))
    for x in (0.0, 0.4, 0.4, 1.0):
        ours = [array.copy() for array in kept.geometry(x)]
        assert ran == [n for n in GEOMETRY if x == 0.0 or n not in fixed]
        for a, b in zip(ours, fresh.geometry(x), strict=True):
            np.testing.assert_array_equal(a, b)
        ran.clear()
    assert shape_follows_control(model) == (fixed != HEADS)


def test_two_objects_of_one_model_keep_their_own_colours():
    model = make_random_model(40, k=2)
    evaluator = Evaluator(model, keep=True)
    first = evaluator.color(0.2, EYE)
    before = first.copy()
    evaluator.color(0.9, -EYE)
    np.testing.assert_array_equal(first, before)


def test_what_the_features_give_is_added_once_and_stays_the_same():
    model = make_random_model(300, k=4)
    evaluator = Evaluator(model)
    for x, eye in ((0.1, EYE), (0.7, EYE), (0.7, -EYE), (0.1, EYE)):
        np.testing.assert_allclose(
            evaluator.color(x, eye), evaluate(model, x, eye).color, atol=3e-6
        )


def test_quaternions_of_any_length_turn_the_same():
    model = make_random_model(50)
    unit, any_length = (Evaluator(model).geometry(0.4, unit)[2] for unit in (True, False))
    np.testing.assert_allclose(np.linalg.norm(unit, axis=1), 1, atol=1e-6)
    length = np.linalg.norm(any_length, axis=1, keepdims=True)
    np.testing.assert_allclose(any_length / length, unit, atol=1e-6)


@pytest.mark.parametrize("encoding", [ControlEncoding(), ControlEncoding(3, 0.5, 0.3)])
def test_psi_of_many_values_is_that_of_each(encoding):
    x = np.random.default_rng(0).uniform(0, 1, 500).astype(np.float32)
    x[:4] = [0, 1, encoding.spacing, 0.5]
    wanted = encoding.encode(x[:, None].astype(np.float64))
    np.testing.assert_allclose(encode_rows(encoding, x), wanted, atol=2e-6)


def test_directions_are_unit_or_nothing():
    anchors = np.random.default_rng(1).normal(size=(100, 3)).astype(np.float32)
    towards = directions(anchors, EYE)
    np.testing.assert_allclose(np.linalg.norm(towards, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(
        towards, (anchors - EYE) / np.linalg.norm(anchors - EYE, axis=1, keepdims=True), atol=1e-6
    )
    anchors[3], anchors[5] = EYE, np.nan
    some = directions(anchors, np.float32(EYE))
    assert not some[[3, 5]].any()
    rest = np.setdiff1d(np.arange(100), [3, 5])
    np.testing.assert_allclose(some[rest], towards[rest], atol=1e-6)


@pytest.mark.parametrize("frames", [False, True])
@pytest.mark.parametrize("sides", [True, False], ids=["two controls", "all between"])
def test_a_border_that_moves_runs_what_it_has_met_alone(frames, sides, monkeypatch):
    """From none to half of the anchors, one more than half, one value for all, and back."""
    count = 64
    model = make_random_model(count, k=3)
    model = with_frames(model) if frames else model
    fresh, kept, rows = Evaluator(model), Evaluator(model, keep=True), []
    for kind in (FoldedNetwork, WholeNetwork):

        def counted(self, parts, base, run=kind.run):
            rows.append(len(parts["feature"]))
            return run(self, parts, base)

        monkeypatch.setattr(kind, "run", counted)
    place = np.random.default_rng(0).permutation(count)
    between = np.random.default_rng(1).uniform(0.2, 0.8, count).astype(np.float32)

    def x_at(border: int) -> np.ndarray:
        here = np.float32(0.25) if sides else between
        return np.where(place < border, here, np.float32(0.75)).astype(np.float32)

    steps = [(x_at(10), 64), (x_at(10), 0), (x_at(11), 1), (x_at(42), 31), (x_at(10), 32)]
    steps += [(x_at(43), 64), (0.4, 64), (x_at(43), 64), (x_at(40), 3)]
    for x, ran in steps:
        rows.clear()
        found = kept.geometry(x)
        assert sum(rows) == len(GEOMETRY) * ran
        for ours, wanted in zip(found, fresh.geometry(x), strict=True):
            # A few rows have other sums in a matrix product than many: half a step of float32.
            np.testing.assert_allclose(ours, wanted, rtol=2e-6, atol=1e-6)


@pytest.mark.parametrize("frames", [False, True])
@pytest.mark.parametrize("count", [0, 1])
def test_a_model_without_anchors_has_no_splats(count, frames):
    """As a thing has that was cut away whole."""
    model = make_random_model(3, k=4)
    model = (with_frames(model) if frames else model).with_anchors(slice(0, count))
    splats = Evaluator(model).geometry(0.5)
    assert [array.shape for array in splats] == [
        (4 * count, 3), (4 * count, 3), (4 * count, 4), (4 * count,)
    ]  # fmt: skip
    assert evaluate(model, 0.5, np.zeros(3)).color.shape == (4 * count, 3)
