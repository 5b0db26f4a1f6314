"""Pruning by importance and joining: exact numbers, the order, origins, labels, columns."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.layers.read_layers import join_layers
from shapeshift.runtime_models.splats.operations.decimate import (
    certain_ones,
    evenly,
    largest,
    left_whole,
    prominence,
    prune_by_importance,
)
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.models import make_random_model
from tests.support.splats.ply_files import some_splats

WEIGHTS = {
    "any": lambda n: np.random.default_rng(n).random(n),
    "nothing": np.zeros,
    "alike": np.ones,
    "far apart": lambda n: np.random.default_rng(n).lognormal(0, 5, n),
    "few": lambda n: np.where(np.arange(n) % 7 == 0, 1e6, 0.0),
    "halves": lambda n: 2.0 ** -np.arange(n),
}


@pytest.mark.parametrize("kind", WEIGHTS)
@pytest.mark.parametrize("count", [2, 3, 10, 255, 256, 257, 5000])
def test_so_many_stay_and_no_other_number(kind, count):
    weights = WEIGHTS[kind](count)
    order = np.random.default_rng(1).permutation(count)
    for most in {1, 2, count // 7 + 1, count // 2, count - 1} - {0, count}:
        rows = evenly(weights, order, most)
        assert len(rows) == most and (np.diff(rows) > 0).all()
        assert 0 <= rows[0] and rows[-1] < count
        np.testing.assert_array_equal(rows, evenly(weights, order, most))


def test_what_shows_most_is_certain_and_what_shows_nothing_goes_first():
    weights = np.r_[np.zeros(50), np.full(50, 1.0), np.full(5, 1e9)]
    order = np.random.default_rng(0).permutation(105)
    kept = evenly(weights, order, 30)
    assert set(range(100, 105)) <= set(kept) and kept.min() >= 50
    assert certain_ones(np.sort(weights)[::-1], 30) == 5


def test_chances_are_those_of_the_weights():
    """Drawn along 200 orders each row is there as often as its weight says."""
    weights, most = np.r_[np.full(40, 1.0), np.full(40, 3.0)], 40
    rng, seen = np.random.default_rng(0), np.zeros(80)
    for _ in range(400):
        seen[evenly(weights, rng.permutation(80), most)] += 1 / 400
    assert abs(seen[:40].mean() - 0.25) < 0.02 and abs(seen[40:].mean() - 0.75) < 0.02


def test_neighbours_along_the_order_are_thinned_alike():
    kept = evenly(np.ones(1000), np.arange(1000), 250)
    assert (np.diff(kept) == 4).all()


def test_what_shows_is_opacity_times_the_two_larger_sides():
    """A needle shows less than a disc of its length, whichever axis is which."""
    sides = [(1.0, 1e-3, 1e-3), (1e-3, 1.0, 1.0), (0.1, 0.1, 1e-3), (1.0, 1.0, 1e-3)]
    sides += [(1e-3, 0.1, 0.1), (1.0, 1.0, 1.0)]
    opacity = np.array([1.0, 1.0, 1.0, 0.25, 1.0, -0.5], np.float32)
    layers = join_layers(
        [replace(some_splats(6), scales=np.array(sides, np.float32), opacity=opacity)],
        (Stop("a", 0.0),), "", ["a.ply"],
    )  # fmt: skip
    area = np.array([1e-3, 1.0, 1e-2, 0.25, 1e-2, 0.0])  # opacity * middle * most
    np.testing.assert_allclose(prominence(layers), area**0.25, rtol=1e-6)
    kept = {tuple(row) for row in np.round(prune_by_importance(layers, 4).scales, 4).tolist()}
    assert (1.0, 0.001, 0.001) not in kept, "a needle stays for its length alone"


def test_largest_rows_rise_and_of_equals_the_first_stay():
    assert largest(np.array([1, 5, 5, 0, 5, 9]), 3).tolist() == [1, 2, 5]


def test_a_scene_is_pruned_over_all_layers_together(tmp_path):
    for i, count in enumerate((300, 500)):
        extra = {"own": np.arange(count, dtype=np.float32)}
        splats = replace(some_splats(count, 4, seed=i), extra=extra)
        write_ply(splats, tmp_path / f"layer{i}.ply")
    whole = read_model(tmp_path)
    for most in (1, 2, 399, 799):
        part = prune_by_importance(whole, most)
        assert part.splat_count == most and part.layer.shape == (most,)
        # Each row is one of the whole scene, in its order.
        rows = [np.flatnonzero((whole.means == mean).all(1))[0] for mean in part.means]
        assert (np.diff(rows) > 0).all()
        for name in ("scales", "wxyz", "opacity", "sh", "layer"):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[rows])
        np.testing.assert_array_equal(part.extra["own"], whole.extra["own"][rows])
        (found,) = part.findings
        assert f"asks for {most:,}" in found.what and "kept" in found.done
    assert prune_by_importance(whole, 800) is whole


def test_max_splats_counts_over_all_layers_together(tmp_path):
    for i, count in enumerate((300, 500)):
        write_ply(some_splats(count, 4, seed=i), tmp_path / f"layer{i}.ply")
    for most in (1, 2, 399, 799):
        part = read_model(tmp_path, Reading(most_splats=most))
        assert part.splat_count == most and part.layer.shape == (most,)
        assert f"asks for {most:,}" in part.findings[-1].what
    for most in (0, 800, 801):
        same = read_model(tmp_path, Reading(most_splats=most))
        assert same.splat_count == 800 and same.findings == ()


def test_one_part_is_not_copied():
    part = replace(some_splats(5), extra={"own": np.arange(5.0)})
    layers = join_layers([part], (Stop("a", 0.0),), "", ["a.ply"])
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        assert getattr(layers, name) is getattr(part, name)
    assert layers.extra["own"] is part.extra["own"] and layers.labels is None


def test_parts_share_the_first_origin_and_all_columns():
    a = replace(some_splats(3, 1), origin=(1e6, 0.0, 0.0), extra={"a": np.arange(3.0)})
    b = replace(
        some_splats(4, 4, seed=1), origin=(1e6 + 10, 5.0, 0.0), antialiased=True,
        labels=np.arange(4, dtype=np.int32), extra={"b": np.arange(4, dtype=np.uint8)},
    )  # fmt: skip
    parts = [a, b]
    layers = join_layers(parts, (Stop("a", 0.0), Stop("b", 1.0)), "", ["a", "b"])
    assert parts == [] and layers.origin == (1e6, 0.0, 0.0) and layers.antialiased
    np.testing.assert_array_equal(layers.means[:3], a.means)
    np.testing.assert_allclose(
        layers.means[3:], b.means + np.array([10, 5, 0], np.float32), atol=1e-6
    )
    assert layers.means.dtype == np.float32 and layers.extra["b"].dtype == np.uint8
    assert layers.extra["a"].tolist() == [0, 1, 2, 0, 0, 0, 0]
    assert layers.extra["b"].tolist() == [0, 0, 0, 0, 1, 2, 3]
    assert layers.labels.tolist() == [0, 0, 0, 0, 1, 2, 3]
    assert (layers.sh[:3, 1:] == 0).all() and layers.layer.tolist() == [0] * 3 + [1] * 4


def test_a_model_of_anchors_stays_whole_and_says_so():
    model = make_random_model(20, k=3)
    assert left_whole(model, 0, "a") is model and left_whole(model, 60, "a") is model
    same = left_whole(model, 59, "a")
    (found,) = same.findings
    assert same.splat_count == 60 and "asks for 59" in found.what and not found.repaired
