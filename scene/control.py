"""The control over stops and time, and from place to place where an object has selectors.

It is a number x, a place on the slider, or a blend of any stops (runtime_models/stop_weights.py).
The rule for x outside 0 to 1, where no network was trained: a request for it by number is
refused (commands, SceneObject and selectors name the value, NaN too); what a hand or a clock moves
is clamped (sliders, snap, Sweep).  So nothing below ever meets such a value.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.runtime_models.stop_dates import seconds_of
from shapeshift.runtime_models.stop_weights import NO_STOPS, Control, Controls, StopBlend, is_each
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.sections.cut import kept_by
from shapeshift.scene.sections.section import SceneSection
from shapeshift.scene.selectors.selector import Selector

SNAP = 0.02  # of the slider's range: nearer than this to a stop is on the stop


def snap(x: float, stops: Sequence[Stop], reach: float = SNAP) -> float:
    """x in 0..1, moved onto the nearest stop when that is at most `reach` away."""
    x = min(max(x, 0.0), 1.0)
    nearest = min((s.x for s in stops), key=lambda stop_x: abs(stop_x - x), default=x)
    return nearest if abs(nearest - x) <= reach else x


def control_of(obj: SceneObject) -> Controls:
    """Of an object: one for all of it, or one an anchor (layers: a splat), float32: numbers (A,),
    or where these do not do weights of its stops (A, S).

    A border shows what a shift from outside to inside shows on its way: no third stop.  What lies
    beyond a section that shows another control there lies over all selectors.
    """
    x: Controls = obj.x
    parts = [(selector_weights(obj, selector), selector.x) for selector in obj.selectors]
    for one in beyond_sections(obj):
        assert one.beyond is not None, "those that show something"
        parts.append((weights_beyond(obj, one), one.beyond))
    for weights, inside in parts:
        if not weights.any():  # a lens that looks elsewhere costs nothing
            continue
        whole = (weights == weights[0]).all()
        x = obj.model.blend.between(x, inside, float(weights[0]) if whole else weights)
    return np.clip(x, 0, 1).astype(np.float32) if is_each(x) else x


def selector_weights(obj: SceneObject, selector: Selector) -> np.ndarray:
    """(A,) float32 0..1: how much of each anchor (layers: splat) is inside."""
    model = obj.model
    places = model.means if isinstance(model, SplatLayers) else model.anchors  # (A, 3) metres
    return selector.weights(_in_space(places, obj, selector.space))


def controls_within(obj: SceneObject) -> list[Control]:
    """Its own control, and those of its parts."""
    beyond = [one.beyond for one in beyond_sections(obj) if one.beyond is not None]
    return [obj.x, *(selector.x for selector in obj.selectors), *beyond]


def beyond_sections(obj: SceneObject) -> tuple[SceneSection, ...]:
    """The sections that show another control beyond them."""
    return tuple(one for one in obj.sections if one.enabled and one.beyond is not None)


def weights_beyond(obj: SceneObject, section: SceneSection) -> np.ndarray:
    """(A,) float32 0..1: how much of each anchor (layers: splat) lies beyond a section."""
    model = obj.model
    places = model.means if isinstance(model, SplatLayers) else model.anchors  # (A, 3) metres
    planes = section.half_spaces_of(obj.world_from_object)
    return 1 - kept_by(planes, section.edge, section.width_m, places)


def covered(obj: SceneObject, selectors: Sequence[Selector]) -> np.ndarray:
    """(A,) 0..1: how much of each anchor lies in any of them."""
    model = obj.model
    outside = np.ones(model.splat_count if isinstance(model, SplatLayers) else len(model.anchors))
    for selector in selectors:
        outside = outside * (1 - selector_weights(obj, selector))
    return 1 - outside


def control_key(obj: SceneObject) -> tuple:
    """What control_of depends on; of one model, equal keys give equal control values."""
    beyond = beyond_sections(obj)
    if not any(part.space == "world" for part in (*obj.selectors, *beyond)):
        return obj.x, obj.selectors, beyond
    pose = obj.world_from_object
    return obj.x, obj.selectors, beyond, (*pose.position, *pose.wxyz)


def _in_space(places: np.ndarray, obj: SceneObject, space: str) -> np.ndarray:
    """Places (A, 3) of the object's frame in a selector's space."""
    if space == "object":
        return places
    world_from_object = obj.world_from_object.matrix()
    return places @ world_from_object[:3, :3].T + world_from_object[:3, 3]


def ease(t: float) -> float:
    """Smooth start and stop: 0..1 to 0..1 with no speed at both ends."""
    return t * t * (3 - 2 * t)


def unease(y: float) -> float:
    """The inverse of `ease`, in closed form."""
    return 0.5 - float(np.sin(np.arcsin(1 - 2 * y) / 3))


Ease = Callable[[float], float]
# Name -> (part of the way at part t of the time, its inverse).
EASES: dict[str, tuple[Ease, Ease]] = {
    "smooth": (ease, unease),
    "even": (lambda t: t, lambda y: y),
    "slow start": (lambda t: t * t, lambda y: y**0.5),
    "slow end": (lambda t: t * (2 - t), lambda y: 1 - (1 - y) ** 0.5),
}
MODES = ("ping-pong", "loop", "once")
SHIFT_S = 0.6  # from any stop to any other, when somebody asks for it


@dataclass
class Shift:
    """The control of an object on its way from where it is to where somebody wants it."""

    start: Control
    end: Control
    blend: StopBlend  # of the object's model
    seconds: float = 0.0  # since it began

    @property
    def control(self) -> Control:
        return self.blend.between(self.start, self.end, ease(min(self.seconds / SHIFT_S, 1.0)))

    @property
    def over(self) -> bool:
        return self.seconds >= SHIFT_S


@dataclass
class Sweep:
    """The control as a function of time: from stop to stop, resting a moment at each.

    `seconds` counts playing time, so stopping and resuming keeps its place; `resume_at` moves it
    to where the hand has left the slider.  All fields may be changed while it plays.
    """

    xs: tuple[float, ...]  # x of the stops to visit, ascending
    blend: StopBlend = NO_STOPS  # of the model: ways between them; without: through all x
    leg_s: float = 2.5  # from one stop to the next
    rest_s: float = 0.8  # at each stop
    seconds: float = 0.0
    playing: bool = False
    ease: str = "smooth"  # one of EASES
    mode: str = "ping-pong"  # one of MODES: back the same way, back in one leg, or ends there
    by_date: bool = False  # legs take as long as their stops' dates are apart, leg_s in the mean

    @staticmethod
    def over(blend: StopBlend) -> "Sweep":
        """Through all stops; evenly in time, without rests, where all have dates."""
        xs = tuple(sorted({stop.x for stop in blend.stops}))
        if len(xs) < 3 or not all(stop.date for stop in blend.stops):
            return Sweep(xs, blend)
        return Sweep(xs, blend, rest_s=0.0, ease="even", by_date=True)

    @property
    def way(self) -> tuple[float, ...]:
        """x of the stops in the order of one round; it ends where it began, unless played once."""
        if self.mode == "once" or len(self.xs) < 2:
            return self.xs
        back = self.xs[-2:0:-1] if self.mode == "ping-pong" else ()
        return self.xs + back + self.xs[:1]

    @property
    def legs(self) -> tuple[float, ...]:
        """Seconds of each leg of the way, without the rest before it."""
        way = self.way
        dates = {s.x: seconds_of(s.date) for s in self.blend.stops if s.date}
        if not self.by_date or not all(x in dates for x in way) or len(way) < 2:
            return (self.leg_s,) * max(len(way) - 1, 0)
        apart = [abs(dates[b] - dates[a]) for a, b in pairwise(way)]
        return tuple(self.leg_s * len(apart) * each / sum(apart) for each in apart)

    @property
    def period(self) -> float:
        """Seconds of one round; 0 when there is nowhere to go."""
        legs = self.legs
        return sum(legs) + len(legs) * self.rest_s

    def play(self, control: Control) -> Control:
        """Starts there; returns where: the beginning when a single round was at its end."""
        self.playing = self.period > 0
        at_end = self.playing and self.blend.slider_x(control) >= self.xs[-1]
        if at_end and self.mode == "once":
            self.seconds = 0.0
            return self.xs[0]
        return control

    def advance(self, seconds: float) -> Control:
        """Plays on and returns the control; a single round ends by itself."""
        if self.period > 0:
            self.seconds += seconds
            if self.mode != "once":
                self.seconds %= self.period
            elif self.seconds >= self.period:
                self.seconds, self.playing = self.period, False
        return self.control

    @property
    def control(self) -> Control:
        if not self.period > 0:
            return self.xs[0] if self.xs else 0.0
        leg, into = self._place()
        part = EASES[self.ease][0](min(max((into - self.rest_s) / self.legs[leg], 0.0), 1.0))
        return self.blend.between(self.way[leg], self.way[leg + 1], part)

    @property
    def x(self) -> float:
        """Where the slider's knob is."""
        return self.blend.slider_x(self.control)

    def resume_at(self, control: Control) -> None:
        """Continues from there, on the next leg that passes it, if possible in the same direction.

        Where none does, since a stop is not visited, on one that passes the knob's place.
        """
        if not self.period > 0 or self._shows(self.control, control):
            return
        x, way = self.blend.slider_x(control), self.way
        x = min(max(x, self.xs[0]), self.xs[-1])
        now, count = self._place()[0], len(way) - 1
        upwards = way[now + 1] > way[now]

        def part_at(leg: int) -> float:
            return min(max((x - way[leg]) / (way[leg + 1] - way[leg]), 0.0), 1.0)

        def preferred(leg: int) -> tuple:
            there = self.blend.between(way[leg], way[leg + 1], part_at(leg))
            turns = (way[leg + 1] > way[leg]) != upwards
            return not self._shows(there, control), turns, (leg - now) % count

        passing = [i for i in range(count) if min(way[i : i + 2]) <= x <= max(way[i : i + 2])]
        leg = min(passing, key=preferred)
        part = EASES[self.ease][1](part_at(leg))
        before, legs = sum(self.legs[:leg]) + leg * self.rest_s, self.legs
        self.seconds = before + self.rest_s + part * legs[leg]

    def _shows(self, one: Control, other: Control) -> bool:
        """Whether two controls look the same."""
        apart = self.blend.weights(one) - self.blend.weights(other)
        return abs(self.blend.slider_x(one) - self.blend.slider_x(other)) < 1e-6 and (
            bool((np.abs(apart) < 1e-5).all())
        )

    def _place(self) -> tuple[int, float]:
        """The leg of the way it is on, and seconds since it began, with the rest before it."""
        legs = self.legs
        if self.mode == "once" and self.seconds >= self.period:
            return len(legs) - 1, legs[-1] + self.rest_s
        into = self.seconds % self.period
        for leg, seconds in enumerate(legs[:-1]):
            if into < seconds + self.rest_s:
                return leg, into
            into -= seconds + self.rest_s
        return len(legs) - 1, into
