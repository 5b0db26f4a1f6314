"""Where between its stops a model is shown: a place x on the slider, or weights over the stops.

Psi enters the first layer of every network linearly, so a blend of stops is the blend of their
encodings, Psi = sum of w_s Psi(x_s) (equation 5 of 3SGS, for any number of stops).  A shift from
one stop to another is then a way of its own: it passes no third stop, wherever that one lies on the
slider.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations, pairwise
from typing import TypeGuard, overload

import numpy as np

from shapeshift.runtime_models.stop import ControlEncoding, Stop
from shapeshift.runtime_models.stop_dates import x_of_date

SUM_SLACK = 1e-6  # by which weights may miss 1: what six decimals in a file leave


@dataclass(frozen=True)
class StopWeights:
    """A blend of stops by their names: each weight 0 to 1, 1 in the sum, zeros left out."""

    parts: tuple[tuple[str, float], ...]  # (stop, weight), no stop twice

    def __post_init__(self) -> None:
        """ValueError, one sentence, for what is no blend."""
        names = [name for name, _ in self.parts]
        total = sum(weight for _, weight in self.parts)
        sound = all(0 <= weight <= 1 for _, weight in self.parts) and len(set(names)) == len(names)
        if not (sound and abs(total - 1) <= SUM_SLACK):
            raise ValueError(
                f"the weights {control_text(self)} are no blend; stops, each once, with weights "
                "from 0 to 1 that add up to 1 are wanted."
            )
        kept = tuple((name, float(weight)) for name, weight in self.parts if weight > 0)
        object.__setattr__(self, "parts", kept)


Control = float | StopWeights  # x on the slider, 0 to 1, or a blend
Controls = Control | np.ndarray  # of everything, or one an anchor: (A,) of x, (A, S) of weights


def is_each(x: Controls) -> TypeGuard[np.ndarray]:
    """Whether there is one control an anchor, and not one of everything."""
    return np.ndim(x) > 0  # type: ignore[arg-type]  # 0 of a StopWeights


@dataclass(frozen=True)
class Pace:
    """How fast one stop is mixed into another, so that even steps change the picture evenly."""

    start: str  # names of two stops
    end: str
    blend: tuple[float, ...]  # weight of `end` at even steps of the way; rises from 0 to 1

    def __post_init__(self) -> None:
        """ValueError, one sentence, for a curve that is none."""
        rises = all(0 <= a < b <= 1 for a, b in pairwise(self.blend))
        if not (len(self.blend) >= 2 and rises and self.blend[0] == 0 and self.blend[-1] == 1):
            raise ValueError(
                f"the pace from '{self.start}' to '{self.end}' does not rise from 0 to 1."
            )


@dataclass(frozen=True)
class StopBlend:
    """The stops of a model, and the way from any of them to any other.

    x on the slider stands for a blend of its two neighbours.  `direct`: a number goes into the
    encoding as it is, since the networks know what lies between.
    """

    stops: tuple[Stop, ...]
    pace: tuple[Pace, ...] = ()
    direct: bool = False
    frames: bool = False  # the stops are moments: ways lead through what lies between

    @cached_property
    def names(self) -> tuple[str, ...]:
        return tuple(stop.name for stop in self.stops)

    @property
    def encodes_every_x(self) -> bool:
        """Whether a way between two numbers leads through all numbers between them."""
        return self.direct or len(self.stops) < 2

    @cached_property
    def is_time(self) -> bool:
        """Whether x is time, so that the way between two moments leads through all between."""
        return self.frames or (len(self.stops) > 1 and all(stop.date for stop in self.stops))

    @cached_property
    def _table(self) -> tuple[np.ndarray, np.ndarray]:
        """x (K,) rising, and the weights of all stops there (K, S): straight lines in between."""
        order = sorted(range(len(self.stops)), key=lambda s: self.stops[s].x)
        eye = np.eye(len(order))
        xs, rows = [self.stops[s].x for s in order[:1]], [eye[s] for s in order[:1]]
        for a, b in pairwise(order):
            curve = np.array([0.0, 1.0] if self.direct else self.curve(a, b))
            low, high = self.stops[a].x, self.stops[b].x
            xs += [*(low + (high - low) * np.linspace(0, 1, len(curve))[1:-1]), high]
            rows += [(1 - share) * eye[a] + share * eye[b] for share in curve[1:]]
        return np.array(xs), np.array(rows).reshape(len(xs), len(order))

    @cached_property
    def _curves(self) -> dict[tuple[int, int], np.ndarray]:
        """(start, end) -> weight of `end` at even steps, both ways."""
        curves = {}
        for pace in self.pace:
            if pace.start in self.names and pace.end in self.names:
                a, b = self.names.index(pace.start), self.names.index(pace.end)
                curves[a, b] = np.array(pace.blend)
                curves[b, a] = 1 - curves[a, b][::-1]
        return curves

    def curve(self, a: int, b: int) -> np.ndarray:
        """Weight of stop b at even steps of the way from stop a; even where nothing is known."""
        return self._curves.get((a, b), np.array([0.0, 1.0]))

    def weights(self, control: Controls) -> np.ndarray:
        """(S,) weights of all stops, or (A, S) where there is one control an anchor.

        Left of the first stop there is the first, right of the last the last.  ValueError for a
        stop that the model has not.
        """
        if isinstance(control, StopWeights):
            row = np.zeros(len(self.stops))
            for name, weight in control.parts:
                row[self._index(name)] = weight
            return row
        if is_each(control) and control.ndim == 2:
            return control
        xs, rows = self._table
        if not len(xs):
            return np.zeros((*np.shape(control), 0))
        return np.stack([np.interp(control, xs, column) for column in rows.T], axis=-1)

    @overload
    def between(self, start: Control, end: Control, part: float) -> Control: ...

    @overload
    def between(self, start: Controls, end: Control, part: float | np.ndarray) -> Controls: ...

    def between(self, start: Controls, end: Control, part: float | np.ndarray) -> Controls:
        """`part` 0..1 of the way from one control to another, one or (A,) of them, at even pace.

        Between two neighbours that is a number again, and where x is time; other ways lead there
        directly.
        """
        if np.ndim(part) == 0 and part in (0, 1):
            return end if part else start
        if self._walks(start, end):
            return start + (end - start) * part  # type: ignore[operator]  # numbers: they walk
        before, after = self.weights(start), self.weights(end)
        if np.ndim(part):
            return self._mixed_each(before, after, np.asarray(part))
        way = self._mixed(before, after, part)
        if way.ndim == 2:
            return way
        return StopWeights(tuple(zip(self.names, (way / way.sum()).tolist(), strict=True)))

    def slider_x(self, control: Control) -> float:
        """x of the slider's knob: of a blend, the mean of its stops' places, at even pace."""
        if not isinstance(control, StopWeights):
            return control
        row = self.weights(control)
        present = np.flatnonzero(row)
        if len(present) == 2:
            a, b = map(int, present)
            share = _part_of(self.curve(a, b), row[b])
            return float(self.stops[a].x + (self.stops[b].x - self.stops[a].x) * share)
        return float(row @ [stop.x for stop in self.stops])

    def _walks(self, start: Controls, end: Controls) -> bool:
        """Whether all numbers between two controls mean a blend of the same two stops."""
        if isinstance(start, StopWeights) or isinstance(end, StopWeights):
            return False
        if is_each(start) and start.ndim == 2:
            return False
        if self.encodes_every_x or self.is_time:
            return True
        xs = sorted(stop.x for stop in self.stops)
        low, high = min(np.min(start), end), max(np.max(start), end)
        return any(a <= low and high <= b for a, b in pairwise([-np.inf, *xs, np.inf]))

    def _mixed_each(self, start: np.ndarray, end: np.ndarray, part: np.ndarray) -> np.ndarray:
        """(A, S) at parts (A,), most of them 0 or 1: of a section all but those at its edge."""
        way = np.where(part[:, None] >= 1, end, start)
        between = ~((part <= 0) | (part >= 1))
        if between.any():
            starts = start[between] if start.ndim == 2 else start
            way[between] = self._mixed(starts, end, part[between])
        return way

    def _mixed(self, start: np.ndarray, end: np.ndarray, part: float | np.ndarray) -> np.ndarray:
        """Weights (S,) or (A, S) between weights."""
        part = np.asarray(part, np.float64)[..., None]  # () -> (1,), (A,) -> (A, 1)
        before = np.flatnonzero(start.reshape(-1, len(end)).any(axis=0)).tolist()
        pairs = [(a, b) for a in before for b in np.flatnonzero(end).tolist()]
        share = sum(start[..., [a]] * end[b] * _along(self.curve(a, b), part) for a, b in pairs)
        mixed = start + (end - start) * np.clip(share, 0, 1)
        present = (start > 0) | (end > 0)
        for a, b in pairs:
            # Where only two stops are met, equal steps of the line between them.
            alone = present[..., [a]] & present[..., [b]] & (present.sum(-1, keepdims=True) == 2)
            if a == b or not alone.any():
                continue
            curve = self.curve(a, b)
            first, last = _part_of(curve, start[..., [b]]), _part_of(curve, end[b])
            line = np.zeros((*mixed.shape[:-1], len(end)))
            line[..., [b]] = _along(curve, first + (last - first) * part)
            line[..., [a]] = 1 - line[..., [b]]
            mixed = np.where(alone, line, mixed)
        return mixed

    def _index(self, name: str) -> int:
        if name not in self.names:
            known = ", ".join(self.names) or "none"
            raise ValueError(f"there is no stop '{name}'; there are {known}.")
        return self.names.index(name)


def _along(curve: np.ndarray, part: np.ndarray) -> np.ndarray:
    """How much a curve has mixed in so far along its way."""
    return np.interp(part, np.linspace(0, 1, len(curve)), curve)


NO_STOPS = StopBlend(())


def _part_of(curve: np.ndarray, share: float | np.ndarray) -> np.ndarray:
    """How far along its way a curve has mixed in so much."""
    return np.asarray(np.interp(share, curve, np.linspace(0, 1, len(curve))))


def encode_control(encoding: ControlEncoding, blend: StopBlend, control: Controls) -> np.ndarray:
    """(1, d) float32 Psi of a control, (A, d) where there is one an anchor.

    A blend is that of its stops' encodings.  A number goes into the encoding as it is outside of
    the outermost stops, where there are fewer than two, and where the blend is direct.
    """
    outside: np.ndarray | np.bool = np.False_
    if not isinstance(control, StopWeights) and np.ndim(control) < 2:
        outside = _is_outside(blend, np.asarray(control))
        if outside.all():
            return _encoded(encoding, control)
    psi = blend.weights(control) @ _stop_encodings(encoding, blend.stops)
    psi = np.atleast_2d(psi).astype(np.float32)
    if outside.any() and is_each(control):
        psi[outside] = _encoded(encoding, control[outside])
    return psi


def _is_outside(blend: StopBlend, x: np.ndarray) -> np.ndarray:
    """Whether numbers lie between no two stops that are to be blended; as many."""
    if blend.encodes_every_x:
        return np.ones(x.shape, bool)
    xs = [stop.x for stop in blend.stops]
    return ~((x >= min(xs)) & (x <= max(xs)))


@lru_cache(maxsize=64)
def _stop_encodings(encoding: ControlEncoding, stops: tuple[Stop, ...]) -> np.ndarray:
    """(S, d) Psi at every stop."""
    return np.stack([encoding.encode(stop.x) for stop in stops]).astype(np.float64)


def _encoded(encoding: ControlEncoding, x: float | np.ndarray) -> np.ndarray:
    """(n, d) float32 Psi of numbers."""
    return encode_rows(encoding, x) if is_each(x) else encoding.encode(float(x))[None]


def encode_rows(encoding: ControlEncoding, x: np.ndarray) -> np.ndarray:
    """(n, d) Psi of numbers x (n,), float32 throughout: faster than encoding.encode."""
    t = np.float32(np.arange(encoding.d) * encoding.spacing)
    away = t - np.asarray(x, np.float32)[:, None]
    away *= away
    away *= np.float32(-1 / (2 * encoding.sigma**2))
    return np.exp(away, out=away)


def same_controls(one: Controls, other: Controls) -> bool:
    """Whether two say the same in the same way."""
    if is_each(one) and is_each(other):
        return np.array_equal(one, other)
    return not is_each(one) and not is_each(other) and one == other


def check_control(control: Control, whose: str) -> None:
    """ValueError, naming the value, for a number that is not from 0 to 1, NaN too."""
    if not (isinstance(control, StopWeights) or 0 <= control <= 1):
        raise ValueError(f"{whose} has x = {control}; from 0 to 1 is wanted.")


def control_text(control: Control) -> str:
    """A control as `parse_control` reads it."""
    if isinstance(control, StopWeights):
        return ",".join(f"{name}:{weight:.6g}" for name, weight in control.parts)
    return f"{control:.6g}"


def parse_control(text: str, stops: Sequence[Stop], pace: tuple[Pace, ...] = ()) -> Control:
    """A control of a text: a stop's name in any case, a number from 0 to 1, a way or a blend.

    `RGB..Opened:0.5` is half of the way from one stop to another, at even pace where the scene
    has one; `RGB:0.5,Opened:0.5` are weights, of any sum.  ValueError, one sentence, for all else.
    """
    known = {stop.name.casefold(): stop for stop in stops}
    word = text.strip()
    if word.casefold() in known:
        return known[word.casefold()].x
    try:
        x = float(word)
    except ValueError:
        date = _parse_date(word, stops)
        if date is not None:
            return date
        blend = _parse_way(word, known, StopBlend(tuple(stops), pace)) or _parse_blend(word, known)
        if blend is None:
            raise ValueError(_wanted(word, stops)) from None
        return blend
    if not 0 <= x <= 1:
        raise ValueError(f"x is {word[:40]}, expected 0 to 1.")
    return x


def _parse_date(word: str, stops: Sequence[Stop]) -> float | None:
    """A date between the dated stops; None for what begins as none, or where no stop has one."""
    if not (word[:4].isdigit() and word[4:5] == "-" and any(stop.date for stop in stops)):
        return None
    return x_of_date(word, stops)


def _parse_way(word: str, known: dict[str, Stop], blend: StopBlend) -> Control | None:
    """A..B:part; None for what has not that form.  Names may hold dots and colons themselves."""
    ends, _, part = word.rpartition(":")
    lowered = ends.casefold()
    for a, b in combinations([*known, *known], 2):
        if lowered == f"{a}..{b}" and (share := _share(part)) is not None:
            return blend.between(known[a].x, known[b].x, share)
    return None


def _parse_blend(word: str, known: dict[str, Stop]) -> StopWeights | None:
    """A:weight,B:weight,...; None for what has not that form."""
    found: dict[str, float] = {}
    rest = word
    while rest:
        names = [n for n in known if rest.casefold().startswith(f"{n}:")]
        if not names:
            return None
        name = max(names, key=len)
        number, _, rest = rest[len(name) + 1 :].partition(",")
        weight = _share(number, np.inf)
        if weight is None or known[name].name in found:
            return None
        found[known[name].name] = weight
        rest = rest.lstrip()
    total = sum(found.values())
    if not 0 < total < np.inf:
        return None
    return StopWeights(tuple((name, weight / total) for name, weight in found.items()))


def _share(text: str, most: float = 1.0) -> float | None:
    """A number from 0 to `most`; None for anything else."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0 <= value <= most else None


def _wanted(word: str, stops: Sequence[Stop]) -> str:
    names = [stop.name for stop in stops]
    a, b = (names[0], names[-1]) if len(names) > 1 else ("A", "B")
    return (
        f"'{word[:60]}' is no x; a number from 0 to 1, a stop ({', '.join(names) or 'none'}), a "
        f"way such as {a}..{b}:0.5 or a blend such as {a}:0.5,{b}:0.5 is wanted."
    )
