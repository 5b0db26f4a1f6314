"""choose, where the leaves in sight ask for too much: parents stand for what is far away.

A parent is opened, and its children drawn instead, for the error that this removes times the
children's pixels, over the splats that it adds.  Openings and finer levels of leaves are one list,
taken best first; none comes before the opening above it.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.leaf_levels import LeafLevels
from shapeshift.runtime_models.splats.parents import NodeTree

# choose: which level of detail each leaf is drawn at, within a budget of splats.
#
# Every step of a leaf to a finer level is worth the error that it removes, times the pixels that
# the leaf is seen in, over the splats that it adds. Steps are taken best first, until one does
# not fit.

NOT_DRAWN = -1  # the level of a leaf that is left out
KEPT = 1.15  # times its worth counts a step that is taken already, so that levels do not flicker


@dataclass(frozen=True)
class Upgrades:
    """What a budget can be spent on, of all leaves; a leaf's own in their order."""

    coarsest: np.ndarray  # (L,) level that a leaf begins with
    base: np.ndarray  # (L,) splats of it
    leaf: np.ndarray  # (S,)
    level: np.ndarray  # (S,) that the step leads to
    more: np.ndarray  # (S,) splats that it adds, above 0
    gain: np.ndarray  # (S,) error that it removes, a splat; falling within a leaf


def steps_of(levels: LeafLevels) -> Upgrades:
    """The lower convex hull of each leaf's errors over its counts: what lies above it, no budget
    would stop at.  The finest level is always reached, and no finer level counts as a worse one.
    """
    counts = levels.counts.astype(np.int64)
    there = counts > 0
    errors = np.where(there, levels.errors, -np.inf)
    errors = np.maximum.accumulate(np.maximum(errors, 0), axis=1)  # rising with the level
    finest = np.argmax(there, axis=1)
    now = levels.coarsest
    parts: list[tuple[np.ndarray, ...]] = []
    columns = np.arange(counts.shape[1])
    while len(left := np.flatnonzero(now > finest)):
        at = now[left]
        more = counts[left] - counts[left, at][:, None]  # (n, K)
        removed = errors[left, at][:, None] - errors[left]
        open_to = there[left] & (columns < at[:, None])
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.where(more > 0, removed / np.maximum(more, 1), np.inf)
        gain = np.where(open_to, gain, -1.0)
        best = np.argmax(gain, axis=1)  # the finest of equal ones
        row = np.arange(len(left))
        parts.append((left, best, more[row, best], gain[row, best]))
        now[left] = best
    if not parts:
        nothing = np.zeros(0, np.int64)
        return Upgrades(levels.coarsest, base_of(levels), nothing, nothing, nothing, np.zeros(0))
    leaf, level, more, gain = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(leaf, kind="stable")
    return Upgrades(levels.coarsest, base_of(levels), leaf[order], level[order], more[order],
                 gain[order])  # fmt: skip


def base_of(levels: LeafLevels) -> np.ndarray:
    """(L,) splats of the coarsest level of each leaf."""
    return levels.counts[np.arange(len(levels.counts)), levels.coarsest].astype(np.int64)


def joined(each: list[Upgrades]) -> Upgrades:
    """The steps of several objects; leaves are numbered on."""
    first = np.cumsum([0, *(len(steps.base) for steps in each)])
    moved = [steps.leaf + start for steps, start in zip(each, first[:-1], strict=True)]

    def column(name: str) -> np.ndarray:
        return np.concatenate([getattr(steps, name) for steps in each])

    return Upgrades(
        column("coarsest"), column("base"), np.concatenate(moved), column("level"), column("more"),
        column("gain"),
    )  # fmt: skip


def choose(
    steps: Upgrades, weight: np.ndarray, budget: int, held: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """(L,) levels, NOT_DRAWN where a leaf is not wanted, and (L,) what the last step of each is
    worth.  Together they never have more than `budget` splats.

    weight: (L,) pixels that a leaf is seen in; what is not above 0 is not drawn.  held: (L,) levels
    that are drawn now.  The same arguments give the same levels.
    """
    level = np.full(len(steps.base), NOT_DRAWN)
    worth = np.zeros(len(level))
    wanted = np.flatnonzero(weight > 0)
    wanted = wanted[np.argsort(-weight[wanted], kind="stable")]
    used = np.cumsum(steps.base[wanted])
    taken = wanted[: int(np.searchsorted(used, budget, side="right"))]
    level[taken] = steps.coarsest[taken]
    worth[taken] = np.inf
    if not len(taken):
        return level, worth
    left = budget - int(used[len(taken) - 1])
    mine = level[steps.leaf] != NOT_DRAWN
    value = step_values(steps, weight, held)
    rows = np.flatnonzero(mine)
    # Upgrades of no gain come last, and within a leaf they keep their order.
    rows = rows[np.argsort(-value[rows], kind="stable")]
    rows = rows[: int(np.searchsorted(np.cumsum(steps.more[rows]), left, side="right"))]
    level[steps.leaf[rows]] = steps.level[rows]  # of several of a leaf the last one stays
    worth[steps.leaf[rows]] = value[rows]
    return level, worth


def step_values(steps: Upgrades, weight: np.ndarray, held: np.ndarray | None) -> np.ndarray:
    """(S,) what each finer level is worth; one that is drawn already KEPT times as much."""
    value = steps.gain * weight[steps.leaf]
    if held is None:
        return value
    at = held[steps.leaf]
    return np.where((at != NOT_DRAWN) & (at <= steps.level), KEPT * value, value)


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
