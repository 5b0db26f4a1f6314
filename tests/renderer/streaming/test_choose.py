"""Levels of leaves by a budget: against a slow heap, and what holds of every choice."""

import heapq

import numpy as np
import pytest

from shapeshift.renderer.streaming.choose import NOT_DRAWN, choose, joined, steps_of
from shapeshift.runtime_models.leaf_levels import LeafLevels


def some_levels(leaves: int, kinds: int = 5, seed: int = 0, convex: bool = True) -> LeafLevels:
    rng = np.random.default_rng(seed)
    counts = np.maximum(rng.integers(100, 4000, (leaves, 1)) >> np.arange(kinds), 1)
    grows = np.sort(rng.uniform(0.1, 1, (leaves, kinds - 1)), axis=1) if convex else (
        rng.uniform(0, 1, (leaves, kinds - 1))
    )  # fmt: skip
    errors = np.concatenate([np.zeros((leaves, 1)), np.cumsum(grows, axis=1)], axis=1)
    box = rng.normal(size=(leaves, 3))
    return LeafLevels(box, box + 1, counts, errors)


def by_a_heap(levels: LeafLevels, weight: np.ndarray, budget: int) -> np.ndarray:
    """Step by step: of all next finer levels the best, until one does not fit."""
    wanted = [i for i in np.argsort(-weight, kind="stable") if weight[i] > 0]
    level, used, coarsest = np.full(len(weight), NOT_DRAWN), 0, levels.coarsest
    for i in wanted:
        if used + levels.counts[i, coarsest[i]] > budget:
            break
        level[i] = coarsest[i]
        used += levels.counts[i, coarsest[i]]
    heap: list[tuple] = []

    def offer(i: int) -> None:
        finer = level[i] - 1
        if finer >= 0:
            more = levels.counts[i, finer] - levels.counts[i, level[i]]
            gain = weight[i] * (levels.errors[i, level[i]] - levels.errors[i, finer]) / more
            heapq.heappush(heap, (-gain, i, finer, more))

    for i in np.flatnonzero(level != NOT_DRAWN):
        offer(int(i))
    while heap:
        _, i, finer, more = heapq.heappop(heap)
        if used + more > budget:
            break
        level[i], used = finer, used + more
        offer(i)
    return level


def splats(levels: LeafLevels, level: np.ndarray) -> int:
    drawn = np.flatnonzero(level != NOT_DRAWN)
    return int(levels.counts[drawn, level[drawn]].sum())


@pytest.mark.parametrize("budget", [1, 1000, 20_000, 60_000, 10**9])
def test_a_convex_scene_is_chosen_as_by_a_heap(budget):
    """Errors whose steps get dearer towards the finest: there both ways are the same greedy one."""
    levels = some_levels(60)
    weight = np.random.default_rng(1).uniform(0, 100, 60) * (np.arange(60) % 7 > 0)
    level, _ = choose(steps_of(levels), weight, budget)
    expected = by_a_heap(levels, weight, budget)
    # The heap stops a leaf's chain where the hull may skip a level of no more gain.
    assert (level == expected).mean() > 0.95
    assert abs(splats(levels, level) - splats(levels, expected)) <= 4000


@pytest.mark.parametrize("convex", [True, False])
@pytest.mark.parametrize("budget", [0, 1, 99, 100, 5000, 50_000, 10**9])
def test_the_budget_is_never_exceeded_and_the_same_comes_again(budget, convex):
    levels = some_levels(100, seed=2, convex=convex)
    weight = np.random.default_rng(3).uniform(-1, 10, 100)
    level, worth = choose(steps_of(levels), weight, budget)
    assert splats(levels, level) <= budget
    again = choose(steps_of(levels), weight.copy(), budget)
    assert (again[0] == level).all() and (again[1] == worth).all()
    assert (level[weight <= 0] == NOT_DRAWN).all()
    if budget == 10**9:
        assert (level[weight > 0] == 0).all()


def test_more_budget_never_makes_a_leaf_coarser():
    levels = some_levels(80, seed=4, convex=False)
    weight, steps = np.random.default_rng(5).uniform(0.1, 9, 80), steps_of(levels)
    before = np.full(80, 99)
    for budget in range(0, 300_000, 7_000):
        level = choose(steps, weight, budget)[0]
        shown = np.where(level == NOT_DRAWN, 98, level)
        assert (shown <= before).all()
        before = shown


def test_a_level_that_is_held_is_kept_up_to_15_percent():
    """Two leaves alike, room for one step: the other one gets it at more than 1.15 times."""
    counts, errors = np.array([[20, 10], [20, 10]]), np.array([[0.0, 1], [0, 1]])
    steps = steps_of(LeafLevels(np.zeros((2, 3)), np.ones((2, 3)), counts, errors))
    held = np.array([0, 1])
    for more, expected in ((1.0, [0, 1]), (1.14, [0, 1]), (1.16, [1, 0])):
        level, _ = choose(steps, np.array([1.0, more]), 30, held)
        assert level.tolist() == expected
        fresh, _ = choose(steps, np.array([1.0, more]), 30)
        assert fresh.tolist() == ([0, 1] if more == 1.0 else [1, 0])


def test_levels_that_are_missing_or_no_finer_are_passed_over():
    counts = np.array([[0, 40, 0, 10], [5, 5, 5, 5], [9, 0, 0, 0], [30, 30, 20, 10]])
    errors = np.tile(np.arange(4.0), (4, 1))
    levels = LeafLevels(np.zeros((4, 3)), np.ones((4, 3)), counts, errors)
    steps = steps_of(levels)
    assert steps.coarsest.tolist() == [3, 3, 0, 3] and steps.base.tolist() == [10, 5, 9, 10]
    level, _ = choose(steps, np.ones(4), 10**6)
    assert level.tolist() == [1, 0, 0, 0]
    two = joined([steps, steps])
    assert choose(two, np.ones(8), 10**6)[0].tolist() == [1, 0, 0, 0] * 2


def test_an_error_that_falls_with_coarser_levels_counts_as_none():
    counts, errors = np.array([[40, 20, 10]]), np.array([[0.5, 0.1, 0.2]])
    steps = steps_of(LeafLevels(np.zeros((1, 3)), np.ones((1, 3)), counts, errors))
    assert (steps.gain >= 0).all() and (steps.more > 0).all()
    assert choose(steps, np.ones(1), 40)[0].tolist() == [0]
