"""Turns a run back when it dies: loss not finite, or nothing left to see."""

import numpy as np

LEAST_VISIBLE = 0.01  # of the largest share of splats that this modality has had on screen
LEAST_SHOWN = 0.02  # of the contrast to the background that the photo has
EVERY = 5  # rounds between looks; a round is one step of every modality
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

    def expect(self, modality: str, visible: float) -> None:
        """`visible` is the share of all splats that are on screen in a healthy state, 0..1."""
        self.most_visible[modality] = max(self.most_visible.get(modality, 0.0), visible)

    def healthy(self, modality: str, loss: float, visible: float, shown: float) -> bool:
        """`shown` is the picture's mean contrast to the background over the photo's.

        Splats that have shrunk to black dots are on screen, but show nothing.
        """
        self.expect(modality, visible)
        enough = visible > LEAST_VISIBLE * self.most_visible[modality] and shown > LEAST_SHOWN
        return bool(np.isfinite(loss)) and enough

    def remember(self, state: dict[str, np.ndarray]) -> None:
        self.snapshots = [*self.snapshots, state][-KEPT:]

    def fall_back(self) -> dict[str, np.ndarray]:
        """The newest snapshot, which is given up unless it is the last one left."""
        self.trips += 1
        return self.snapshots.pop() if len(self.snapshots) > 1 else self.snapshots[0]
