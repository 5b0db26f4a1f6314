"""The control value x over stops and time, and from place to place where an object has selectors.

The rule for x outside 0 to 1, where no network was trained: whoever asks for it by number is
refused (commands, SceneObject and selectors name the value, NaN too); what a hand or a clock moves
is clamped (sliders, snap, Sweep).  So nothing below ever meets such a value.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime_models.model import SplatLayers, Stop
from scene.scene import SceneObject

SNAP = 0.02  # of the slider's range: nearer than this to a stop is on the stop


def snap(x: float, stops: Sequence[Stop], reach: float = SNAP) -> float:
    """x in 0..1, moved onto the nearest stop when that is at most `reach` away."""
    x = min(max(x, 0.0), 1.0)
    nearest = min((s.x for s in stops), key=lambda stop_x: abs(stop_x - x), default=x)
    return nearest if abs(nearest - x) <= reach else x


def control_of(thing: SceneObject) -> float | np.ndarray:
    """x of an object: one value for all of it, or (A,) float32, one an anchor (layers: a splat).

    Each selector mixes its x in by its weight at the anchor, so that a border shows what the slider
    shows on the way between both.
    """
    if not thing.selectors:
        return thing.x
    model = thing.model
    places = model.means if isinstance(model, SplatLayers) else model.anchors  # (A, 3) metres
    x = np.full(len(places), thing.x)
    for selector in thing.selectors:
        weights = selector.weights(_in_space(places, thing, selector.space))
        x += (selector.x - x) * weights
    if not len(x) or (x == x[0]).all():  # a lens that looks elsewhere costs nothing
        return float(x[0]) if len(x) else thing.x
    return np.clip(x, 0, 1).astype(np.float32)


def control_key(thing: SceneObject) -> tuple:
    """What control_of depends on; of one model, equal keys give equal control values."""
    if not any(selector.space == "world" for selector in thing.selectors):
        return thing.x, thing.selectors
    pose = thing.world_from_object
    return thing.x, thing.selectors, (*pose.position, *pose.wxyz)


def _in_space(places: np.ndarray, thing: SceneObject, space: str) -> np.ndarray:
    """Places (A, 3) of the object's frame in a selector's space."""
    if space == "object":
        return places
    world_from_object = thing.world_from_object.matrix()
    return places @ world_from_object[:3, :3].T + world_from_object[:3, 3]


def ease(t: float) -> float:
    """Smooth start and stop: 0..1 to 0..1 with no speed at both ends."""
    return t * t * (3 - 2 * t)


def unease(y: float) -> float:
    """The inverse of `ease`, in closed form."""
    return 0.5 - float(np.sin(np.arcsin(1 - 2 * y) / 3))


EASES = {  # name -> (part of the way at part t of the time, its inverse)
    "smooth": (ease, unease),
    "even": (lambda t: t, lambda y: y),
    "slow start": (lambda t: t * t, lambda y: y**0.5),
    "slow end": (lambda t: t * (2 - t), lambda y: 1 - (1 - y) ** 0.5),
}
MODES = ("ping-pong", "loop", "once")


@dataclass
class Sweep:
    """x as a function of time: from stop to stop, resting a moment at each.

    `seconds` counts playing time, so stopping and resuming keeps its place; `resume_at` moves it
    to where the hand has left the slider.  All fields may be changed while it plays.
    """

    xs: tuple[float, ...]  # x of the stops to visit, ascending
    leg_s: float = 2.5  # from one stop to the next
    rest_s: float = 0.8  # at each stop
    seconds: float = 0.0
    playing: bool = False
    ease: str = "smooth"  # one of EASES
    mode: str = "ping-pong"  # one of MODES: back the same way, back in one leg, or ends there

    @staticmethod
    def over(stops: Sequence[Stop]) -> "Sweep":
        return Sweep(tuple(sorted({s.x for s in stops})))

    @property
    def way(self) -> tuple[float, ...]:
        """x of the stops in the order of one round; it ends where it began, unless played once."""
        if self.mode == "once" or len(self.xs) < 2:
            return self.xs
        back = self.xs[-2:0:-1] if self.mode == "ping-pong" else ()
        return self.xs + back + self.xs[:1]

    @property
    def period(self) -> float:
        """Seconds of one round; 0 when there is nowhere to go."""
        return max(len(self.way) - 1, 0) * (self.leg_s + self.rest_s)

    def play(self, x: float) -> float:
        """Starts at x; returns where: the beginning when a single round was at its end."""
        self.playing = self.period > 0
        if self.playing and self.mode == "once" and x >= self.xs[-1]:
            self.seconds = 0.0
            return self.xs[0]
        return x

    def advance(self, seconds: float) -> float:
        """Plays on and returns x; a single round ends by itself."""
        if self.period > 0:
            self.seconds += seconds
            if self.mode != "once":
                self.seconds %= self.period
            elif self.seconds >= self.period:
                self.seconds, self.playing = self.period, False
        return self.x

    @property
    def x(self) -> float:
        if not self.period > 0:
            return self.xs[0] if self.xs else 0.0
        leg, into = self._place()
        part = EASES[self.ease][0](min(max((into - self.rest_s) / self.leg_s, 0.0), 1.0))
        start, end = self.way[leg], self.way[leg + 1]
        return start + (end - start) * part

    def resume_at(self, x: float) -> None:
        """Continues from x, on the next leg that passes it, if possible in the same direction."""
        if not self.period > 0 or abs(self.x - x) < 1e-6:
            return
        way = self.way
        x = min(max(x, self.xs[0]), self.xs[-1])
        now, count = self._place()[0], len(way) - 1
        upwards = way[now + 1] > way[now]
        passing = [i for i in range(count) if min(way[i : i + 2]) <= x <= max(way[i : i + 2])]
        leg = min(passing, key=lambda i: ((way[i + 1] > way[i]) != upwards, (i - now) % count))
        part = EASES[self.ease][1](min(max((x - way[leg]) / (way[leg + 1] - way[leg]), 0.0), 1.0))
        self.seconds = leg * (self.leg_s + self.rest_s) + self.rest_s + part * self.leg_s

    def _place(self) -> tuple[int, float]:
        """The leg of the way it is on, and seconds since it began, with the rest before it."""
        step = self.leg_s + self.rest_s
        if self.mode == "once" and self.seconds >= self.period:
            return len(self.way) - 2, step
        leg, into = divmod(self.seconds % self.period, step)
        return min(int(leg), len(self.way) - 2), into
