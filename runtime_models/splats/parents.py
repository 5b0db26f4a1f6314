"""Parents above the leaves of a scene: a few splats for eight nodes below, up to one for all.

They are merged from the coarsest levels when a scene is opened whose leaves ask for more than a
budget has; no file holds them.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.leaf_levels import (
    LeafLevels,
    LeafSource,
    LeafSplats,
    Throttle,
    unpaced,
)
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.splats.operations.merge_pairs import pair_groups
from shapeshift.runtime_models.splats.operations.moment_matching import merge_groups

CHILDREN = 8  # neighbours of a tree's order, which is an order of space
SPLATS = 48  # of a parent in the mean: as a leaf's coarsest level has


@dataclass(frozen=True)
class NodeTree:
    """Nodes are leaves, then parents, a layer after the other; the last node of all is the root."""

    parent: np.ndarray  # (N,) node above each; -1: it is a root
    height: np.ndarray  # (N,) 0 of a leaf, and of a parent one more than of its children
    error: np.ndarray  # (N,) what its fewest splats show wrong, in the unit of the leaves' errors


class ParentedLeaves:
    """A LeafSource with parents behind the leaves of another one; each has one level."""

    def __init__(self, source: LeafSource, levels: LeafLevels, coarse_leaf: np.ndarray) -> None:
        self.levels, self.coarse_leaf, self._source = levels, coarse_leaf, source
        more = len(levels.counts) - len(source.part)
        self.part = np.pad(source.part, ((0, more), (0, 0)))  # no file has them, nobody asks
        self.coefficients, self.budget = source.coefficients, source.budget

    @property
    def problem(self) -> str:
        return self._source.problem

    def share_memory(self, taken: int) -> None:
        self._source.share_memory(taken)

    def at_hand(self) -> np.ndarray:
        return self._source.at_hand()

    def broken(self) -> np.ndarray:
        return self._source.broken()

    def load(self, part: int, pace: Throttle = unpaced) -> None:
        self._source.load(part, pace)

    def read(self, leaves: np.ndarray, levels: np.ndarray) -> Iterator[LeafSplats]:
        return self._source.read(leaves, levels)


def with_parents(model: SplatLayers) -> tuple[SplatLayers, NodeTree]:
    """The coarsest levels with their parents' splats behind them, and how they hang together."""
    source = model.leaves
    assert source is not None, "only models in leaves have parents"
    layer, node = replace(model, leaves=None), source.coarse_leaf
    below = np.arange(len(source.part))  # nodes of the layer
    parts, nodes, parents = [layer], [node], [np.full(len(below), -1)]
    while len(below) > 1:
        above = below[-1] + 1 + np.arange(-(-len(below) // CHILDREN))
        parents[-1] = np.repeat(above, CHILDREN)[: len(below)]
        layer, node = merged(layer, parents[-1][node - below[0]], SPLATS * len(above))
        parts.append(layer)
        nodes.append(node)
        parents.append(np.full(len(above), -1))
        below = above
    parent, of_splat = np.concatenate(parents), np.concatenate(nodes)
    height = np.repeat(np.arange(len(parents)), [len(each) for each in parents])
    number = np.bincount(of_splat, minlength=len(parent))
    levels, error = levels_of(source.levels, parent, height, number)
    leaves = ParentedLeaves(source, levels, of_splat.astype(np.int32))
    names = ("means", "scales", "wxyz", "opacity", "sh", "layer")
    means, scales, wxyz, opacity, sh, stop = (
        np.concatenate([getattr(part, name) for part in parts]) for name in names
    )
    alone = replace(
        model, means=means, scales=scales, wxyz=wxyz, opacity=opacity, sh=sh, layer=stop,
        labels=None, extra={}, leaves=leaves,
    )  # fmt: skip
    return alone, NodeTree(parent, height, error)


def merged(layer: SplatLayers, node: np.ndarray, most: int) -> tuple[SplatLayers, np.ndarray]:
    """About `most` splats for all of them, none for two nodes (N,), and the node of each."""
    out, into = merge_groups(layer, pair_groups(layer, most, kinds=node.astype(np.int32)))
    of_row = np.empty(out.splat_count, np.int64)
    of_row[into] = node
    return out, of_row


def levels_of(
    leaves: LeafLevels, parent: np.ndarray, height: np.ndarray, number: np.ndarray
) -> tuple[LeafLevels, np.ndarray]:
    """Levels of all nodes (N,) that have so many splats (N,), and their errors at the coarsest.

    Halving a leaf once more is taken to cost what its last halving did, in whatever unit.
    """
    count, size = len(leaves.counts), len(parent)
    more = ((0, size - count), (0, 0))
    counts, errors = np.pad(leaves.counts, more), np.pad(leaves.errors, more)
    low, high = (np.pad(each, more, constant_values=np.nan) for each in (leaves.low, leaves.high))
    rows, coarsest = np.arange(count), leaves.coarsest
    step = np.zeros(size)  # of a halving
    error, splats = np.zeros(size), number.astype(np.float64)
    error[:count] = leaves.errors[rows, coarsest]
    finer = np.maximum(coarsest - 1, 0)
    step[:count] = np.maximum(error[:count] - leaves.errors[rows, finer], 0)
    for layer in range(1, int(height.max()) + 1):
        below = np.flatnonzero(height == layer - 1)
        above, starts = np.unique(parent[below], return_index=True)
        low[above] = np.minimum.reduceat(low[below], starts)
        high[above] = np.maximum.reduceat(high[below], starts)
        weight = np.maximum(splats[below], 1)
        total = np.add.reduceat(weight, starts)
        halvings = np.log2(np.maximum(total / np.maximum(splats[above], 1), 1))
        step[above] = np.add.reduceat(weight * step[below], starts) / total
        mean = np.add.reduceat(weight * error[below], starts) / total
        error[above] = mean + halvings * step[above]
    counts[count:, -1], errors[count:, -1] = number[count:], error[count:]
    return LeafLevels(low, high, counts, errors), error
