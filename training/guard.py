"""Turns a run back when it dies: loss not finite, or nothing left to see."""

import numpy as np

LEAST_VISIBLE = 0.01  # of the largest share of splats that this modality has had on screen
LEAST_SHOWN = 0.3  # of the contrast to the background that the photo has, or the first picture had
IN_A_ROW = 3  # looks that show nothing: one alone may be a camera inside of something
PROBATION = 8  # looks after falling back, over which the mean loss has to come down to ...
GAINED = 0.6  # ... this share of an untrained model's
EVERY = 5  # rounds between looks; a round is one step of every modality
SNAPSHOT_EVERY = 100  # steps
KEPT = 3  # snapshots


class Guard:
    """Keeps the last healthy states.  When `healthy` says no, `fall_back` gives one to go on from.

    A collapse can begin before it shows, so falling back again soon goes one snapshot further.
    """

    def __init__(self, state: dict[str, np.ndarray]) -> None:
        self.snapshots = [state]
        self.first_loss: dict[str, float] = {}  # of each modality
        self.most: dict[str, tuple[float, float]] = {}  # visible and shown of each modality
        self.trips = 0
        self.empty = 0  # looks in a row
        self.gains: list[float] | None = None  # losses over first losses since falling back
        self.patience = 0  # looks before these count

    def expect(self, modality: str, loss: float, visible: float, shown: float) -> None:
        """What a picture of a modality has; the first time, of the untrained or resumed model.

        visible: the share of all splats that are on screen, 0..1.  shown: the picture's mean
        contrast to the background over its photo's; splats that have shrunk to black dots are on
        screen, but show nothing.
        """
        before = self.most.get(modality, (0.0, 0.0))
        self.most[modality] = (max(before[0], visible), max(before[1], min(shown, 1.0)))
        self.first_loss.setdefault(modality, loss)

    def healthy(self, modality: str, loss: float, visible: float, shown: float) -> bool:
        """Whether the run may go on.  After falling back, that takes a falling loss as well."""
        self.expect(modality, loss, visible, shown)
        most_visible, most_shown = self.most[modality]
        enough = visible > LEAST_VISIBLE * most_visible and shown > LEAST_SHOWN * most_shown
        self.empty = 0 if enough else self.empty + 1
        improves = True
        if self.patience:
            self.patience -= 1
        elif self.gains is not None:
            self.gains.append(loss / self.first_loss[modality])
            if len(self.gains) == PROBATION:
                improves = bool(np.mean(self.gains) < GAINED)
                self.gains = None
        return bool(np.isfinite(loss)) and self.empty < IN_A_ROW and improves

    @property
    def sure(self) -> bool:
        """Whether the last looks were good, so that a state is worth keeping."""
        return self.empty == 0 and self.gains is None

    def remember(self, state: dict[str, np.ndarray]) -> None:
        self.snapshots = [*self.snapshots, state][-KEPT:]

    def fall_back(self, patience: int = 0) -> dict[str, np.ndarray]:
        """The newest snapshot, which is given up unless it is the last one left.

        patience: looks that a gentler start takes before the loss has to come down.
        """
        self.trips += 1
        self.empty, self.gains, self.patience = 0, [], patience
        return self.snapshots.pop() if len(self.snapshots) > 1 else self.snapshots[0]
