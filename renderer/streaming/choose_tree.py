"""choose, where the leaves in sight ask for too much: parents stand for what is far away.

A parent is opened, and its children drawn instead, for the error that this removes times the
children's pixels, over the splats that it adds.  Openings and finer levels of leaves are one list,
taken best first; none comes before the opening above it.
"""

import numpy as np

from shapeshift.renderer.streaming.choose import (
    KEPT,
    NOT_DRAWN,
    Upgrades,
    choose,
    step_values,
)
from shapeshift.runtime_models.splats.lod.parents import NodeTree

CROWDED = 0.5  # of the budget: where coarsest levels take more, parents may stand for some
BESIDE = 1e-6  # pixels that a leaf beside the picture counts: last, and the coarsest of all


def is_crowded(splats: int, budget: int) -> bool:
    """Whether leaves of so many splats at their coarsest want parents."""
    return splats > CROWDED * budget


def choose_nodes(
    steps: Upgrades, tree: NodeTree | None, weight: np.ndarray, budget: int,
    held: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """`choose` over the leaves, or over all nodes where there is a tree, and leaves in sight crowd
    the budget; what lies beside the picture is not drawn then.
    """
    if tree is None or not is_crowded(int(steps.base[weight > BESIDE].sum()), budget):
        return choose(steps, weight, budget, held)
    return choose_in_tree(steps, tree, np.where(weight > BESIDE, weight, 0.0), budget, held)


def joined_trees(each: list[NodeTree]) -> NodeTree:
    """Those of several objects; nodes are numbered on."""
    first = np.cumsum([0, *(len(tree.parent) for tree in each)])
    pairs = zip(each, first[:-1], strict=True)
    parent = [np.where(t.parent >= 0, t.parent + start, -1) for t, start in pairs]
    height, error = ([getattr(t, name) for t in each] for name in ("height", "error"))
    return NodeTree(np.concatenate(parent), np.concatenate(height), np.concatenate(error))


def choose_in_tree(
    steps: Upgrades, tree: NodeTree, weight: np.ndarray, budget: int, held: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """As `choose`, over all nodes (N,); of leaves alone a weight is given.

    Every object that is seen has its root at least, until the budget is spent on roots: then what
    shows least is left out.
    """
    weight = upwards(tree, np.add, np.where(weight > 0, weight, 0.0))
    level, worth = np.full(len(weight), NOT_DRAWN), np.zeros(len(weight))
    roots = np.flatnonzero((tree.parent < 0) & (weight > 0))
    roots = roots[np.argsort(-weight[roots], kind="stable")]
    used = np.cumsum(steps.base[roots])
    roots = roots[: int(np.searchsorted(used, budget, side="right"))]
    if not len(roots):
        return level, worth
    left = budget - int(used[len(roots) - 1])
    there = np.zeros(len(weight), bool)
    there[roots] = True
    there = downwards(tree, np.logical_and, np.where(tree.parent < 0, there, weight > 0))
    parents, more, value = openings(steps, tree, weight, held, there)
    rows = np.flatnonzero(there[steps.leaf])
    worths = step_values(steps, weight, held)[rows]
    above = tree.parent[steps.leaf[rows]]
    worths = np.where(above >= 0, np.minimum(worths, value[np.maximum(above, 0)]), worths)
    # Of equal ones those above come first, and within a leaf steps keep their order.
    order = np.argsort(-np.concatenate([value[parents], worths]), kind="stable")
    added = np.concatenate([more[parents], steps.more[rows]])
    taken = order[: prefix(added[order], left)]
    while len(taken) < len(order) and order[len(taken)] < len(parents):
        # An opening that does not fit is left out with all below it; what comes next may fit.
        large = order[len(taken) :]
        large = large[(large < len(parents)) & (added[large] > left - added[taken].sum())]
        closed = np.zeros(len(weight), bool)
        closed[parents[large]] = True
        closed = downwards(tree, np.logical_or, closed)
        items = np.concatenate([closed[parents], closed[steps.leaf[rows]]])
        order = order[~items[order]]
        taken = order[: prefix(added[order], left)]
    opened = np.zeros(len(weight), bool)
    opened[parents[taken[taken < len(parents)]]] = True
    beneath = (tree.parent < 0) | opened[np.maximum(tree.parent, 0)]
    drawn = there & beneath & ~opened
    level[drawn], worth[drawn] = steps.coarsest[drawn], np.inf
    finer = taken[taken >= len(parents)] - len(parents)
    level[steps.leaf[rows[finer]]] = steps.level[rows[finer]]  # of several the last one stays
    worth[steps.leaf[rows[finer]]] = worths[finer]
    return level, worth


def prefix(added: np.ndarray, left: int) -> int:
    """How many of these, one after the other, never add more than is left."""
    return int(np.searchsorted(np.maximum.accumulate(np.cumsum(added)), left, side="right"))


def openings(
    steps: Upgrades, tree: NodeTree, weight: np.ndarray, held: np.ndarray | None, there: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Parents (P,) that may be opened, those above first; of all nodes the splats that this adds,
    which may be below 0, and what it is worth.
    """
    below = np.flatnonzero(there & (tree.parent >= 0))
    above = tree.parent[below]
    more, gain = np.zeros(len(there), np.int64), np.zeros(len(there))
    np.add.at(more, above, steps.base[below])
    more -= steps.base
    np.add.at(gain, above, weight[below] * (tree.error[above] - tree.error[below]))
    value = np.where(more > 0, np.maximum(gain, 0) / np.maximum(more, 1), np.inf)
    if held is not None:
        drawn = np.where(held != NOT_DRAWN, 1, 0)
        value = np.where(upwards(tree, np.add, drawn) > drawn, KEPT * value, value)
    parents = np.flatnonzero(there & (tree.height > 0))
    value[tree.height == 0] = np.inf
    value = downwards(tree, np.minimum, value)
    return parents[np.argsort(-tree.height[parents], kind="stable")], more, value


def upwards(tree: NodeTree, join: np.ufunc, values: np.ndarray) -> np.ndarray:
    """(N,) of each node its own and what all below it have, joined."""
    out = values.copy()
    for height in range(int(tree.height.max(initial=0))):
        below = np.flatnonzero((tree.height == height) & (tree.parent >= 0))
        join.at(out, tree.parent[below], out[below])
    return out


def downwards(tree: NodeTree, join: np.ufunc, values: np.ndarray) -> np.ndarray:
    """(N,) of each node its own and what all above it have, joined."""
    out = values.copy()
    for height in range(int(tree.height.max(initial=0)) - 1, -1, -1):
        below = np.flatnonzero((tree.height == height) & (tree.parent >= 0))
        out[below] = join(out[below], out[tree.parent[below]])
    return out
