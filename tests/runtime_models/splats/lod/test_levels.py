"""Leaves and levels: every splat in one leaf, halves, errors that rise, nothing across leaves."""

from itertools import pairwise

import numpy as np
import pytest

from shapeshift.runtime_models.splats.operations.merge_pairs import (
    COLOR,
    merging_losses,
    mixture_of,
    pair_costs,
)
from shapeshift.runtime_models.splats.operations.moment_matching import merge_groups, shown_area
from shapeshift.runtime_models.splats.sog.write_streamed import (
    Leaves,
    Tree,
    count_levels,
    cut_leaves,
    make_levels,
)
from tests.support.splat_scenes import random_layers, shell


def flattened(tree: Tree) -> list[int]:
    return [tree] if isinstance(tree, int) else [leaf for part in tree for leaf in flattened(part)]


def ignore(level: int, part: float) -> None:
    """Nobody wants to know how far it is."""


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 127, 128, 129, 5000])
def test_leaves_hold_every_splat_once_and_none_too_many(count):
    leaves = cut_leaves(random_layers(count).means, 64)
    sizes = np.bincount(leaves.of_splat, minlength=leaves.count)
    assert len(sizes) == leaves.count and sizes.sum() == count
    assert sizes.max() <= 64 and (sizes.min() >= 64 // 2 or leaves.count == 1)
    assert flattened(leaves.tree) == list(range(leaves.count))


def test_leaves_are_apart():
    """The two halves at the top do not overlap along the side that was cut: the longest."""
    means = random_layers(1000).means * np.array([1, 5, 1], np.float32)
    leaves = cut_leaves(means, 64)
    half = np.isin(leaves.of_splat, flattened(leaves.tree[0]))
    assert means[half, 1].max() <= means[~half, 1].min()


def test_splats_of_one_place_are_cut_too():
    leaves = cut_leaves(np.zeros((1000, 3), np.float32), 64)
    assert np.bincount(leaves.of_splat).max() <= 64


@pytest.mark.parametrize(
    ("splats", "leaves", "levels"), [(1, 1, 1), (63, 1, 1), (64, 1, 2), (128, 1, 3), (10**9, 1, 10)]
)
def test_levels_end_before_leaves_are_empty(splats, leaves, levels):
    assert count_levels(splats, leaves) == levels


def test_each_level_is_half_of_the_one_before_leaf_by_leaf():
    layers = random_layers(4000, coefficients=1)
    layers = layers.with_rows(layers.opacity > 0)
    leaves = cut_leaves(layers.means, 500)
    told: list[tuple[int, float]] = []
    levels = list(make_levels(layers, leaves, 4, lambda *how: told.append(how)))
    count = layers.splat_count
    assert [level.splats.splat_count for level in levels] == [count >> k for k in range(4)]
    assert told == sorted(told) and {number for number, _ in told} == {1, 2, 3}
    assert [part for _, part in told].count(1.0) == 3
    assert len(told) > 3 * 4  # it moves within a level, too
    whole = np.bincount(leaves.of_splat, shown_area(layers.scales, layers.opacity))
    for level, coarser in pairwise(levels):
        assert (np.diff(level.leaf) >= 0).all() and set(level.leaf) == set(range(leaves.count))
        assert (coarser.errors >= level.errors).all() and np.isfinite(coarser.errors).all()
        shown = np.bincount(level.leaf, shown_area(level.splats.scales, level.splats.opacity))
        assert (shown <= whole * (1 + 1e-5)).all() and (shown > 0.5 * whole).all()
    assert (levels[0].errors == 0).all() and (levels[1].errors > 0).all()
    again = list(make_levels(layers, leaves, 4, ignore))
    for one, other in zip(levels, again, strict=True):
        assert one.splats.means.tobytes() == other.splats.means.tobytes()


def test_detail_is_kept_longer_than_one_colour():
    """Two leaves of one shape, one of one colour, one of random colours."""
    layers = shell(600)
    both = layers.with_rows(np.tile(np.arange(600), 2))
    both.means[600:, 0] += 10
    both.sh[:600] = 0.3
    both.sh[600:] = np.random.default_rng(0).normal(size=(600, 1, 3))
    leaves = Leaves(np.repeat(np.arange(2, dtype=np.int32), 600), 2, (0, 1))
    last = list(make_levels(both, leaves, 3, ignore))[-1]
    smooth, rough = np.bincount(last.leaf)
    assert smooth < rough and smooth + rough == 300


def test_the_loss_of_pairs_is_their_cost():
    """Against the formula that chooses them, up to the rounding of float32; DETAIL apart."""
    layers = random_layers(400, coefficients=1)
    layers = layers.with_rows(layers.opacity > 0.01)
    layers = layers.with_rows(slice(0, layers.splat_count // 2 * 2))
    layers.opacity[:] *= 0.2  # none above 1: areas are those of the moments
    count = layers.splat_count
    merged, into = merge_groups(layers, np.arange(count) // 2)
    losses = merging_losses(layers, merged, into)
    found = np.bincount(into, losses)
    mixture = mixture_of(layers)
    costs = pair_costs(mixture[:, ::2], mixture[:, 1::2])
    weight = mixture[12, ::2] + mixture[12, 1::2]
    np.testing.assert_allclose(found[into[::2]], costs * weight**0.2, rtol=2e-3, atol=1e-9)
    assert COLOR > 0
