"""The control value x over stops and time: snapping to named stops, the sweep of play."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime_models.model import Stop

SNAP = 0.02  # of the slider's range: nearer than this to a stop is on the stop


def snap(x: float, stops: Sequence[Stop], reach: float = SNAP) -> float:
    """x in 0..1, moved onto the nearest stop when that is at most `reach` away."""
    x = min(max(x, 0.0), 1.0)
    nearest = min((s.x for s in stops), key=lambda stop_x: abs(stop_x - x), default=x)
    return nearest if abs(nearest - x) <= reach else x


def ease(t: float) -> float:
    """Smooth start and stop: 0..1 to 0..1 with no speed at both ends."""
    return t * t * (3 - 2 * t)


def unease(y: float) -> float:
    """The inverse of `ease`, in closed form."""
    return 0.5 - float(np.sin(np.arcsin(1 - 2 * y) / 3))


@dataclass
class Sweep:
    """x as a function of time: from stop to stop and back, resting a moment at each.

    `seconds` counts playing time, so stopping and resuming keeps its place; `resume_at` moves it
    to where the hand has left the slider.
    """

    xs: tuple[float, ...]  # the stops' x, ascending
    leg_s: float = 2.5
    rest_s: float = 0.8
    seconds: float = 0.0
    playing: bool = False

    @staticmethod
    def over(stops: Sequence[Stop]) -> "Sweep":
        return Sweep(tuple(sorted({s.x for s in stops})))

    @property
    def period(self) -> float:
        """Seconds of a way there and back."""
        return 2 * (len(self.xs) - 1) * (self.leg_s + self.rest_s)

    def advance(self, seconds: float) -> float:
        """Plays on and returns x."""
        if self.period > 0:
            self.seconds = (self.seconds + seconds) % self.period
        return self.x

    @property
    def x(self) -> float:
        if not self.period > 0:
            return self.xs[0] if self.xs else 0.0
        way = self.xs + self.xs[-2:0:-1] + self.xs[:1]  # there and back to the first
        leg, into = divmod(self.seconds % self.period, self.leg_s + self.rest_s)
        start, end = way[int(leg)], way[int(leg) + 1]
        part = ease(min(max((into - self.rest_s) / self.leg_s, 0.0), 1.0))
        return start + (end - start) * part

    def resume_at(self, x: float) -> None:
        """Continues from x, in the direction in which it was going."""
        if not self.period > 0 or abs(self.x - x) < 1e-6:
            return
        x = min(max(x, self.xs[0]), self.xs[-1])
        backwards = self.seconds % self.period >= self.period / 2
        leg = int(np.clip(np.searchsorted(self.xs, x, side="right") - 1, 0, len(self.xs) - 2))
        part = unease((x - self.xs[leg]) / (self.xs[leg + 1] - self.xs[leg]))
        if backwards:
            leg, part = 2 * (len(self.xs) - 1) - 1 - leg, 1 - part
        self.seconds = leg * (self.leg_s + self.rest_s) + self.rest_s + part * self.leg_s
