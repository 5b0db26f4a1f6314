"""choose: which level of detail each leaf is drawn at, within a budget of splats.

Every step of a leaf to a finer level is worth the error that it removes, times the pixels that the
leaf is seen in, over the splats that it adds.  Steps are taken best first, until
one does not fit.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.leaf_levels import LeafLevels

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
