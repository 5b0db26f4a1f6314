"""Turns a run back when it dies: loss not finite, or nothing left to see."""

import numpy as np

LEAST_VISIBLE = 0.01  # of the largest share of splats that this modality has had on screen
LEAST_CONTRAST = 0.3  # of the contrast to the background of the photo, or of the first picture
IN_A_ROW = 3  # checks that show nothing: one alone may be a camera inside of something
PROBATION = 8  # checks after a rollback, over which the mean loss has to come down to ...
GAINED = 0.6  # ... this share of an untrained model's
EVERY = 5  # rounds between checks; a round is one step of every modality
SNAPSHOT_EVERY = 100  # steps
KEPT = 3  # snapshots


class DivergenceGuard:
    """Keeps the last healthy states.  When `is_healthy` is False, `rollback` gives one of them.

    A collapse can begin before it shows, so a second rollback soon after goes one snapshot further.
    """

    def __init__(self, state: dict[str, np.ndarray]) -> None:
        self.snapshots = [state]
        self.first_loss: dict[str, float] = {}  # of each modality
        self.most: dict[str, tuple[float, float]] = {}  # visible and contrast of each modality
        self.rollbacks = 0
        self.empty = 0  # checks in a row
        self.gains: list[float] | None = None  # losses over first losses since the rollback
        self.grace = 0  # checks before these count

    def observe(self, modality: str, loss: float, visible: float, contrast: float) -> None:
        """What a picture of a modality has; the first time, of the untrained or resumed model.

        visible: the share of all splats that are on screen, 0..1.  contrast: the picture's mean
        contrast to the background over its photo's; splats that have shrunk to black dots are on
        screen, but show nothing.
        """
        before = self.most.get(modality, (0.0, 0.0))
        self.most[modality] = (max(before[0], visible), max(before[1], min(contrast, 1.0)))
        self.first_loss.setdefault(modality, loss)

    def is_healthy(self, modality: str, loss: float, visible: float, contrast: float) -> bool:
        """Whether the run may go on.  After a rollback, that takes a falling loss as well."""
        self.observe(modality, loss, visible, contrast)
        most_visible, most_contrast = self.most[modality]
        enough = visible > LEAST_VISIBLE * most_visible
        enough = enough and contrast > LEAST_CONTRAST * most_contrast
        self.empty = 0 if enough else self.empty + 1
        improves = True
        if self.grace:
            self.grace -= 1
        elif self.gains is not None:
            self.gains.append(loss / self.first_loss[modality])
            if len(self.gains) == PROBATION:
                improves = bool(np.mean(self.gains) < GAINED)
                self.gains = None
        return bool(np.isfinite(loss)) and self.empty < IN_A_ROW and improves

    @property
    def stable(self) -> bool:
        """Whether the last checks were good, so that a state is worth keeping."""
        return self.empty == 0 and self.gains is None

    def save_snapshot(self, state: dict[str, np.ndarray]) -> None:
        self.snapshots = [*self.snapshots, state][-KEPT:]

    def rollback(self, grace: int = 0) -> dict[str, np.ndarray]:
        """The newest snapshot, which is given up unless it is the last one left.

        grace: checks that a warm-up takes before the loss has to come down.
        """
        self.rollbacks += 1
        self.empty, self.gains, self.grace = 0, [], grace
        return self.snapshots.pop() if len(self.snapshots) > 1 else self.snapshots[0]
