"""Parents under a budget: beside a slow heap that opens them one by one, and what always holds."""

import heapq

import numpy as np
import pytest

from shapeshift.renderer.streaming.choose import (
    NOT_DRAWN,
    choose,
    choose_in_tree,
    choose_nodes,
    joined,
    joined_trees,
    steps_of,
)
from shapeshift.runtime_models.leaf_levels import LeafLevels
from shapeshift.runtime_models.splats.parents import NodeTree

KINDS = 4


def some_tree(leaves: int, seed: int) -> tuple[LeafLevels, NodeTree]:
    """Leaves and parents of three nodes each, with errors that fall from the root on."""
    rng = np.random.default_rng(seed)
    parents, heights, below = [], [], np.arange(leaves)
    while len(below) > 1:
        above = below[-1] + 1 + np.arange(-(-len(below) // 3))
        parents.append(np.repeat(above, 3)[: len(below)])
        heights.append(np.full(len(below), len(heights)))
        below = above
    parents.append(np.array([-1]))
    heights.append(np.array([len(heights)]))
    parent, height = np.concatenate(parents), np.concatenate(heights)
    counts = np.zeros((len(parent), KINDS), np.int64)
    counts[:leaves] = np.maximum(rng.integers(300, 3000, (leaves, 1)) >> np.arange(KINDS), 1)
    counts[leaves:, -1] = rng.integers(20, 60, len(parent) - leaves)
    errors = np.zeros(counts.shape)
    errors[:leaves] = np.cumsum(np.sort(rng.uniform(0, 1, (leaves, KINDS)), axis=1), axis=1) - 1
    errors[:leaves] -= errors[:leaves, :1]
    error = errors[:, -1]
    error[leaves:] = 4 * height[leaves:]
    return LeafLevels(
        np.zeros((len(parent), 3)), np.ones((len(parent), 3)), counts, errors
    ), NodeTree(parent, height, error)


def weight_of(tree: NodeTree, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    weight = rng.uniform(0, 100, len(tree.parent)) * (rng.uniform(size=len(tree.parent)) < 0.8)
    return np.where(tree.height == 0, weight, 0)


def by_a_heap(levels: LeafLevels, tree: NodeTree, weight: np.ndarray, budget: int) -> np.ndarray:
    """From the roots on always the best next thing, no better than what it had to wait for, until
    a step does not fit; openings that do not are passed over.
    """
    steps, base = steps_of(levels), steps_of(levels).base
    total = weight.copy()
    for node in np.argsort(tree.height, kind="stable"):
        if tree.parent[node] >= 0:
            total[tree.parent[node]] += total[node]
    level = np.full(len(weight), NOT_DRAWN)
    heap: list[tuple] = []

    def draw(node: int, most: float) -> None:
        level[node] = steps.coarsest[node]
        children = np.flatnonzero((tree.parent == node) & (total > 0))
        if tree.height[node] == 0:
            offer(node, 0, most)
        else:
            more = int(base[children].sum() - base[node])
            gain = float((total[children] * (tree.error[node] - tree.error[children])).sum())
            value = gain / more if more > 0 else np.inf
            heapq.heappush(heap, (-min(value, most), -tree.height[node], node, -1, more))

    def offer(leaf: int, number: int, most: float) -> None:
        mine = np.flatnonzero(steps.leaf == leaf)
        if number < len(mine):
            row = mine[number]
            value = min(steps.gain[row] * weight[leaf], most)
            heapq.heappush(heap, (-value, 1, leaf, number, int(steps.more[row])))

    used = 0
    for root in sorted(np.flatnonzero((tree.parent < 0) & (total > 0)), key=lambda i: -total[i]):
        if used + base[root] > budget:
            break
        used += int(base[root])
        draw(int(root), np.inf)
    while heap:
        value, _, node, number, more = heapq.heappop(heap)
        if used + more > budget and number >= 0:
            break
        if used + more > budget:  # an opening: nothing below it comes either
            continue
        used += more
        if number < 0:
            level[node] = NOT_DRAWN
            for child in np.flatnonzero((tree.parent == node) & (total > 0)):
                draw(int(child), -value)
        else:
            level[node] = steps.level[np.flatnonzero(steps.leaf == node)[number]]
            offer(node, number + 1, -value)
    return level


def drawn_splats(levels: LeafLevels, level: np.ndarray) -> int:
    drawn = np.flatnonzero(level != NOT_DRAWN)
    return int(levels.counts[drawn, level[drawn]].sum())


def above(tree: NodeTree, node: int) -> list[int]:
    out = []
    while tree.parent[node] >= 0:
        out.append(node := int(tree.parent[node]))
    return out


@pytest.mark.parametrize("leaves", [1, 2, 3, 4, 40])
@pytest.mark.parametrize("budget", [0, 19, 60, 500, 3000, 20_000, 10**9])
def test_it_is_what_a_heap_chooses(leaves, budget):
    for seed in range(4):
        levels, tree = some_tree(leaves, seed)
        weight = weight_of(tree, seed + 10)
        level, _ = choose_in_tree(steps_of(levels), tree, weight, budget, None)
        np.testing.assert_array_equal(level, by_a_heap(levels, tree, weight, budget))


@pytest.mark.parametrize("budget", [100, 1000, 9000, 50_000])
@pytest.mark.parametrize("in_motion", [False, True])
def test_what_is_drawn_covers_each_seen_leaf_once(budget, in_motion):
    each = [some_tree(30, seed) for seed in range(5)]
    tree = joined_trees([tree for _, tree in each])
    steps = joined([steps_of(levels) for levels, _ in each])
    counts = np.concatenate([levels.counts for levels, _ in each])
    weight, held = weight_of(tree, 3), None
    for turn in range(3):
        level, worth = choose_in_tree(steps, tree, np.roll(weight, turn), budget, held)
        held = level if in_motion else None
        drawn = np.flatnonzero(level != NOT_DRAWN)
        assert int(counts[drawn, level[drawn]].sum()) <= budget
        assert (worth[drawn] > 0).all() and not worth[level == NOT_DRAWN].any()
        roots = {node: (above(tree, node) or [node])[-1] for node in drawn}
        for leaf in np.flatnonzero((tree.height == 0) & (np.roll(weight, turn) > 0)):
            chain = [leaf, *above(tree, leaf)]
            shown = [node for node in chain if level[node] != NOT_DRAWN]
            assert len(shown) == (chain[-1] in roots.values())


def test_leaves_that_fit_well_are_chosen_without_parents():
    """To the bit what `choose` gives; where they crowd the budget parents take part."""
    levels, tree = some_tree(40, 5)
    steps, weight = steps_of(levels), weight_of(tree, 6)
    least = int(steps.base[weight > 0].sum())
    for budget, alike in ((2 * least, True), (2 * least - 1, False), (least // 2, False)):
        level, worth = choose_nodes(steps, tree, weight, budget)
        plain = choose(steps, weight, budget)
        assert (np.array_equal(level, plain[0]) and np.array_equal(worth, plain[1])) == alike
        assert (level[tree.height > 0] != NOT_DRAWN).any() != alike
    assert np.array_equal(choose_nodes(steps, None, weight, least // 2)[0],
                          choose(steps, weight, least // 2)[0])  # fmt: skip


def test_what_is_open_stays_open_up_to_15_percent():
    """Two objects alike with room for one opening: the other one gets it at 1.15 times as much."""
    parent = np.array([2, 2, -1, 5, 5, -1])
    tree = NodeTree(parent, np.array([0, 0, 1] * 2), np.array([0.0, 0, 1] * 2))
    levels = LeafLevels(np.zeros((6, 3)), np.ones((6, 3)), np.full((6, 1), 10),
                        tree.error[:, None])  # fmt: skip
    steps, held = steps_of(levels), np.array([0, 0, NOT_DRAWN, NOT_DRAWN, NOT_DRAWN, 0])
    for more, first in ((1.0, True), (1.14, True), (1.16, False)):
        weight = np.array([1.0, 1, 0, more, more, 0])
        level, _ = choose_in_tree(steps, tree, weight, 30, held)
        assert (level[:3] != NOT_DRAWN).tolist() == [first, first, not first]
        assert (level[3:] != NOT_DRAWN).tolist() == [not first, not first, first]
