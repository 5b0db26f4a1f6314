"""Turns a run back when it dies: loss not finite, or nothing left to see."""

import numpy as np

LEAST_VISIBLE = 0.01  # of the largest share of splats that this modality has had on screen
EVERY = 10  # steps between looks
SNAPSHOT_EVERY = 100  # steps
KEPT = 3  # snapshots


class Guard:
    """Keeps the last healthy states.  When `healthy` says no, `fall_back` gives one to go on from.

    A collapse can begin before it shows, so falling back again soon goes one snapshot further.
    """

    def __init__(self, state: dict[str, np.ndarray]) -> None:
        self.snapshots = [state]
        self.most_visible: dict[str, float] = {}
        self.trips = 0

    def healthy(self, modality: str, loss: float, visible: float) -> bool:
        """`visible` is the share of all splats that were on screen in this step, 0..1."""
        self.most_visible[modality] = max(self.most_visible.get(modality, 0.0), visible)
        return bool(np.isfinite(loss)) and visible > LEAST_VISIBLE * self.most_visible[modality]

    def remember(self, state: dict[str, np.ndarray]) -> None:
        self.snapshots = [*self.snapshots, state][-KEPT:]

    def fall_back(self) -> dict[str, np.ndarray]:
        """The newest snapshot, which is given up unless it is the last one left."""
        self.trips += 1
        return self.snapshots.pop() if len(self.snapshots) > 1 else self.snapshots[0]
