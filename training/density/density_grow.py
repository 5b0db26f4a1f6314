"""A change of anchors: some go because they show nothing, others come where they are needed."""

import numpy as np

from shapeshift.training.density.density import (
    LEAST_STEPS,
    LEAST_VIEWS,
    Evidence,
    Newcomers,
    changed_state,
    given_up,
    newcomers,
)
from shapeshift.training.settings import TrainSettings


def given(seen: np.ndarray) -> np.ndarray:
    """(A,) pixels that an anchor gives to a picture that has it, at the stop where it gives most.

    seen: (stops, A, 2) of Evidence; from fewer pictures than LEAST_VIEWS nothing can be said, and
    the anchor counts as giving without bound.
    """
    sums, views = seen[..., 0], seen[..., 1]
    each = sums / np.maximum(views, 1)
    return np.where(views.sum(0) < LEAST_VIEWS, np.inf, each.max(0))


def useless(evidence: dict[str, np.ndarray], splats: int, settings: TrainSettings) -> np.ndarray:
    """(A,) bool: anchors that showed nothing at any stop, by each of the measures asked for."""
    steps = int(evidence["evidence.steps"])
    gone = given_up(evidence["evidence.opacity"], steps, splats, settings.prune_opacity)
    if "evidence.seen" in evidence and steps >= LEAST_STEPS:
        seen = evidence["evidence.seen"]
        gone |= given(seen) < settings.prune_weight
        gone |= seen[..., 1].sum(0) < settings.prune_views * steps
    return gone


def weakest(evidence: dict[str, np.ndarray], among: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most `count` anchors `among` (A,) bool that give least to their pictures."""
    gives = np.where(among, given(evidence["evidence.seen"]), np.inf)
    order = np.argsort(gives, kind="stable")[:count]
    return order[np.isfinite(gives[order])]


def change(
    anchors: np.ndarray,
    means: list[np.ndarray],
    evidence: Evidence,
    voxel: float,
    most: int,
    settings: TrainSettings,
) -> tuple[np.ndarray, Newcomers]:
    """(A,) bool which anchors stay, and who comes, so that at most `most` are left.

    means: (A * k, 3) metres of every stop's splats.
    """
    known, strategy = evidence.state(), evidence.watch.strategy
    threshold = settings.grow_threshold or strategy.threshold
    gradients = np.split(known["evidence.gradient"], evidence.groups)
    new = newcomers(
        anchors, means, gradients, voxel, threshold, strategy.relative, settings.grow_grids
    )
    splats = len(means[0]) // len(anchors)
    gone = useless(known, splats, settings)
    if gone.all():
        gone[:] = False
    room = max(most - int((~gone).sum()), 0)
    if settings.grow_replace and len(new.anchors) > room:
        swaps = min(len(new.anchors) - room, int(settings.grow_replace * len(anchors)))
        among = ~gone
        among[new.parents] = False  # who is needed itself does not make room
        freed = weakest(known, among, swaps)
        gone[freed] = True
        room += len(freed)
    # Pulls of all stops together are compared grid by grid: a region that pulls at several sizes
    # and stops at once would else take all the room.  Pulls of each stop have to share it fairly.
    return ~gone, new.at_most(room, by_pull=evidence.groups > 1)


def changed(state: dict[str, np.ndarray], *arguments) -> dict[str, np.ndarray]:
    """The optimiser's state after a `change` with the rest of its arguments."""
    return changed_state(state, *change(state["anchors.value"], *arguments))
