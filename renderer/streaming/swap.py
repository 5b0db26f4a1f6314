"""Parents that come where their children go, and the other way round: which nodes fade together."""

import numpy as np

from shapeshift.renderer.streaming.choose import NOT_DRAWN
from shapeshift.renderer.streaming.choose_tree import downwards, upwards
from shapeshift.runtime_models.splats.lod.parents import NodeTree

NONE = np.zeros(0, np.int64)


def patient(
    tree: NodeTree | None, wanted: np.ndarray, level: np.ndarray, fading: np.ndarray
) -> np.ndarray:
    """(N,) wanted levels, but those that are there where a node, one above or one below fades: one
    change after the other.
    """
    if tree is None or not fading.any():
        return wanted
    return np.where(fading | related(tree, fading), level, wanted)


def swapped(
    tree: NodeTree | None, wanted: np.ndarray, level: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n,) that go because some above or below them come, and these (m,)."""
    gone, new = (
        (here == NOT_DRAWN) & (there != NOT_DRAWN)
        for here, there in ((wanted, level), (level, wanted))
    )
    if tree is None or not (gone.any() and new.any()):
        return NONE, NONE
    return np.flatnonzero(gone & related(tree, new)), np.flatnonzero(new & related(tree, gone))


def comes_finer(tree: NodeTree | None, level: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(N,) bool: a leaf at a finer level than before, a parent where its children come, a child
    where its parents go, and what comes alone.
    """
    new, gone = (
        (there != NOT_DRAWN) & (other == NOT_DRAWN)
        for there, other in ((level, before), (before, level))
    )
    if tree is not None:
        opened = gone & upwards(tree, np.logical_or, new)
        new = new & ~upwards(tree, np.logical_or, gone)  # a parent that comes is coarser
        return opened | new | ((level != NOT_DRAWN) & (level < before))
    return new | ((level != NOT_DRAWN) & (level < before))


def related(tree: NodeTree, nodes: np.ndarray) -> np.ndarray:
    """(N,) bool: above or below one of nodes (N,) bool, or one of them."""
    return upwards(tree, np.logical_or, nodes) | downwards(tree, np.logical_or, nodes)
