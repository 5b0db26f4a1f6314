"""A scene cut into leaves of few splats each, under a tree: what levels of detail are chosen by."""

from dataclasses import dataclass

import numpy as np

Tree = int | tuple["Tree", "Tree"]  # a leaf's number, or two halves


@dataclass(frozen=True)
class Leaves:
    """Splats by leaf; leaves are numbered in the order of the tree."""

    of_splat: np.ndarray  # (N,) int32
    count: int
    tree: Tree


def cut_leaves(means: np.ndarray, most: int) -> Leaves:
    """Leaves of at most `most` splats at places (N, 3), N > 0: halves along the longest side of
    their box, again and again (a k-d tree).  The same places give the same leaves.
    """
    of_splat, count = np.empty(len(means), np.int32), 0

    def cut(rows: np.ndarray) -> Tree:
        nonlocal count
        if len(rows) <= most:
            of_splat[rows] = count
            count += 1
            return count - 1
        places = means[rows]
        with np.errstate(over="ignore"):
            axis = int(np.argmax(places.max(axis=0) - places.min(axis=0)))
        order = np.argpartition(places[:, axis], len(rows) // 2)
        # In their order: which of two equal places comes first must not hang on the sorting.
        return tuple(
            cut(np.sort(rows[half])) for half in (order[: len(rows) // 2], order[len(rows) // 2 :])
        )  # type: ignore[return-value]

    tree = cut(np.arange(len(means)))
    return Leaves(of_splat, count, tree)
