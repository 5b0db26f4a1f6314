"""The slider's track in numbers: where stops, ticks and knob lie, and what a hand does with them.

Lengths are logical pixels of the window.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_dates import x_of_date
from shapeshift.runtime_models.stop_weights import Control, StopWeights
from shapeshift.scene.control import SNAP, snap

STEP = 0.01  # of x: one press of an arrow key
ON_STOP = 1e-3  # nearer than this to a stop is what it shows
SAME_X = 1e-6  # nearer than this to a stop is on it


@dataclass(frozen=True)
class Track:
    """A line from x = 0 to x = 1, and the knob on it."""

    left: float
    width: float
    knob: float  # the knob's radius

    def place(self, x: float) -> float:
        """Where x lies."""
        return self.left + self.width * x

    def x(self, place: float) -> float:
        """x at a place; not clamped."""
        return (place - self.left) / max(self.width, 1.0)


@dataclass
class Grip:
    """What the mouse holds of a track between press and release.

    Pressed on a knob, it stays under the finger where it was taken; pressed beside them, the
    nearest comes to the mouse.
    """

    knob: int = 0  # which of the track's knobs
    offset: float = 0.0  # from the mouse to the knob's middle
    start: float | None = None  # where the mouse took the knob and has not moved since

    def press(self, track: Track, xs: Sequence[float], mouse: float) -> None:
        """The button went down at `mouse`, with knobs at `xs`; the last one lies above."""
        offsets = [track.place(x) - mouse for x in xs]
        self.knob = min(reversed(range(len(xs))), key=lambda knob: abs(offsets[knob]))
        offset = offsets[self.knob]
        on_knob = abs(offset) <= track.knob
        self.offset = offset if on_knob else 0.0
        self.start = mouse if on_knob else None

    def drag(
        self, track: Track, x: float, mouse: float, stops: Sequence[Stop], reach: float = SNAP
    ) -> float:
        """The held knob's x, before at `x`: within 0..1, on a stop at most `reach` away."""
        if self.start == mouse:
            return x  # a press alone moves nothing
        self.start = None
        return snap(track.x(mouse + self.offset), stops, reach)


def half_ways(stops: Sequence[Stop]) -> list[float]:
    """x half-way between each stop and the next."""
    xs = sorted({stop.x for stop in stops})
    return [(a + b) / 2 for a, b in pairwise(xs)]


def next_stop(stops: Sequence[Stop], x: float, direction: int) -> float:
    """x of the nearest stop above (1) or below (-1); x itself where there is none."""
    beyond = [stop.x for stop in stops if (stop.x - x) * direction > SAME_X]
    return min(beyond, key=lambda stop_x: abs(stop_x - x), default=x)


def shown_stop(stops: Sequence[Stop], x: float) -> str:
    """What is seen at x, in words: a stop's name, or how far it is on the way between two."""
    stops = sorted(stops, key=lambda stop: stop.x)
    below = [stop for stop in stops if stop.x <= x + ON_STOP]
    above = [stop for stop in stops if stop.x > x + ON_STOP]
    if below and x - below[-1].x <= ON_STOP:
        return below[-1].name
    if below and above:
        part = (x - below[-1].x) / (above[0].x - below[-1].x)
        percent = min(max(round(100 * part), 1), 99)  # 0 and 100 are for the stops themselves
        return f"{below[-1].name} to {above[0].name}, {percent} %"
    end = (below[-1:] or above[:1])[0].name if stops else ""
    return f"{end}  x {x:.2f}".strip()


def shown_words(stops: Sequence[Stop], control: Control, x: float) -> str:
    """The same of a control whose knob stands at x: a blend of two stops is between these two,
    whatever stop the knob has come to.
    """
    if not is_blend(control):
        return shown_stop(stops, x)
    assert isinstance(control, StopWeights)
    (start, _), (end, weight) = control.parts[0], control.parts[-1]
    return f"{start} to {end}, {100 * weight:.0f} %"


def is_blend(control: Control) -> bool:
    """Whether it shows several stops, wherever its knob stands."""
    return isinstance(control, StopWeights) and len(control.parts) > 1


def stepped(x: float, steps: int) -> float:
    """x some STEPs further, within 0..1 and without the rounding that adds up."""
    return min(max(round(x + steps * STEP, 6), 0.0), 1.0)


def read_x(text: str, stops: Sequence[Stop]) -> float:
    """x of what was typed: a number from 0 to 1, a stop's name, or a date where stops have dates.

    ValueError, one sentence.
    """
    word = text.strip()
    named = {stop.name.casefold(): stop.x for stop in reversed(stops)}  # the first of a ring's ends
    if word.casefold() in named:
        return named[word.casefold()]
    if word[4:5] == "-" and any(stop.date for stop in stops):
        return x_of_date(word, stops)
    try:
        x = float(word.replace(",", "."))
    except ValueError:
        x = float("nan")
    if not 0 <= x <= 1:
        names = ", ".join(stop.name for stop in stops)
        or_stop = f" or a stop ({names})" if names else ""
        raise ValueError(f"x is '{word[:40]}'; a number from 0 to 1{or_stop} is wanted.")
    return x
