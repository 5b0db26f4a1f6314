"""How an object's control answers to what happens to it: declared as data, stepped as a pure
function.

A Machine is what a scene file declares, a ReactionState is where one object is in it.  `advance`
makes the next ReactionState of the one before, the time and what happened: no clock, no engine, no
state in addition to it, so the same events give the same x for ever.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.stop_weights import (
    NO_STOPS,
    Control,
    StopBlend,
    StopWeights,
    check_control,
)
from shapeshift.scene.control import EASES
from shapeshift.scene.selectors.selector import Box, Sphere

KINDS = ("collision", "grab", "ray", "enter")
NEXT = "next"  # as a goal: the state after this one, the first one after the last
SLACK_S = 1e-9  # of a time: steps of 1/90 s add up to a cooldown but for rounding


@dataclass(frozen=True)
class State:
    """A named control that an object rests at."""

    name: str
    x: Control

    def __post_init__(self) -> None:
        if not self.name or self.name == NEXT:
            raise ValueError(f"a state is called '{self.name}'; any name but '{NEXT}' is wanted.")
        check_control(self.x, f"state '{self.name}'")


@dataclass(frozen=True, kw_only=True)
class Reaction:
    """When what happens, x goes where and how."""

    on: str  # one of KINDS
    to: str | Control  # a state, NEXT, or a control
    after: tuple[str, ...] = ()  # states from which it goes there; none named: from all
    least_impulse_n_s: float = 0.0  # of a collision: from this one on
    region: Box | Sphere | None = None  # of an enter: world metres, the object's origin counts
    seconds: float = 0.5  # from here to there
    ease: str = "smooth"  # one of scene.control.EASES
    cooldown_s: float = 0.25  # so long nothing of the same kind is answered again

    def __post_init__(self) -> None:
        """Refuses what could never happen or never end: ValueError with a sentence."""
        _check(self, "on", self.on in KINDS, " or ".join(KINDS))
        fits = bool(self.to) if isinstance(self.to, str | StopWeights) else 0 <= self.to <= 1
        _check(self, "to", fits, "a state, 'next' or a number from 0 to 1")
        _check(self, "ease", self.ease in EASES, " or ".join(EASES))
        for name in ("seconds", "cooldown_s", "least_impulse_n_s"):
            unit = "N s" if name == "least_impulse_n_s" else "seconds"
            _check(self, name, 0 <= getattr(self, name) < math.inf, f"{unit}, 0 or more")
        of_collision = self.on == "collision" or self.least_impulse_n_s == 0
        _check(self, "least_impulse_n_s", of_collision, "a collision to have it")
        fits = (self.region is not None) == (self.on == "enter")
        _check(self, "region", fits, "a box or a sphere for 'enter', and for nothing else,")


@dataclass(frozen=True)
class Machine:
    """The states of one object and what moves it between them; earlier reactions come first."""

    states: tuple[State, ...] = ()
    reactions: tuple[Reaction, ...] = ()
    ring: bool = False  # x = 1 shows what x = 0 does: from above, the way to 0 is that to 1
    blend: StopBlend = NO_STOPS  # of the model: the ways between its stops

    def __post_init__(self) -> None:
        """Refuses goals that are no states: ValueError with a sentence."""
        names = [state.name for state in self.states]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two states are called '{twice[0]}'; each wants a name of its own.")
        known = ", ".join(names) or "none"
        for reaction in self.reactions:
            if reaction.to == NEXT and len(names) < 2:
                raise ValueError(f"'to' is '{NEXT}', but the states are {known}; two are needed.")
            wanted = reaction.after
            if isinstance(reaction.to, str) and reaction.to != NEXT:
                wanted = (*wanted, reaction.to)
            for name in wanted:
                if name not in names:
                    raise ValueError(f"'{name}' is no state; there are {known}.")
        for state in self.states:
            self.check(state.x, f"state '{state.name}'")
        for reaction in self.reactions:
            if not isinstance(reaction.to, str):
                self.check(reaction.to, "'to'")

    def check(self, control: Control, whose: str) -> None:
        """ValueError, one sentence, for a control that the object cannot have."""
        check_control(control, whose)
        if isinstance(control, StopWeights):
            self.blend.weights(control)  # knows every stop

    def nearest(self, control: Control) -> str:
        """The state that is nearest, the first of equals; "" where there is none."""
        if not self.states:
            return ""
        return min(self.states, key=lambda state: self._apart(state.x, control)).name

    def _apart(self, a: Control, b: Control) -> float:
        """By places on the slider; where one is a blend, by how much is to be mixed anew."""
        if isinstance(a, StopWeights) or isinstance(b, StopWeights):
            return float(np.abs(self.blend.weights(a) - self.blend.weights(b)).sum())
        return abs(a - b)

    def goes_over(self, start: Control, end: Control) -> bool:
        """Whether the way of a ring leads up past 1, or to 1 instead of 0."""
        if not self.ring or isinstance(end, StopWeights):
            return False
        if self.blend.encodes_every_x and not isinstance(start, StopWeights):
            return end < start
        return end == 0 < self.blend.slider_x(start)

    def goal(self, reaction: Reaction, state: str) -> State | Control:
        """Where the reaction leads from a state."""
        if not isinstance(reaction.to, str):
            same = [s for s in self.states if s.x == reaction.to]
            return same[0] if same else reaction.to
        names = [s.name for s in self.states]
        if reaction.to != NEXT:
            return self.states[names.index(reaction.to)]
        return self.states[(names.index(state) + 1) % len(names) if state in names else 0]


@dataclass(frozen=True)
class Event:
    """Something that happened to an object in this step."""

    kind: str  # one of KINDS but "enter", which `advance` finds itself
    impulse_n_s: float = 0.0  # of a collision
    before_n_s: float = 0.0  # the impulse between the same two in the step before

    def __post_init__(self) -> None:
        if self.kind not in KINDS or self.kind == "enter":
            raise ValueError(f"an event is '{self.kind}'; collision, grab or ray is wanted.")
        if not (0 <= self.impulse_n_s < math.inf and 0 <= self.before_n_s < math.inf):
            raise ValueError(
                f"a {self.kind} has the impulses {self.impulse_n_s} and {self.before_n_s}; N s, 0 "
                "or more, are wanted."
            )


@dataclass(frozen=True)
class Motion:
    """A control on its way."""

    start: Control
    end: Control
    began_s: float
    seconds: float
    ease: str
    over: bool = False  # of a ring: it goes up, past 1 and on from 0
    blend: StopBlend = NO_STOPS  # as of Machine

    def ends_by(self, time_s: float) -> bool:
        return time_s >= self.began_s + self.seconds - SLACK_S

    def x(self, time_s: float) -> Control:
        """The control at a time."""
        if self.ends_by(time_s):
            return self.end
        part = EASES[self.ease][0](max(time_s - self.began_s, 0.0) / self.seconds)
        start, end = self.start, self.end
        if self.over and self.blend.encodes_every_x:
            assert not isinstance(start, StopWeights) and not isinstance(end, StopWeights)
            value = start + (end + 1 - start) * part  # as Machine.goes_over has seen to
            return min(max(value - (value > 1), 0.0), 1.0)
        return self.blend.between(self.start, 1.0 if self.over else self.end, part)


@dataclass(frozen=True)
class ReactionState:
    """Where one object is: its control, the state it is in or on its way to, what it waits for."""

    x: Control
    state: str = ""  # "" = a control without a name
    motion: Motion | None = None
    quiet_until_s: tuple[float, ...] = (-math.inf,) * len(KINDS)  # one of each of KINDS
    inside: tuple[bool, ...] | None = None  # of each reaction's region; None before the first step
    time_s: float = -math.inf


@dataclass(frozen=True)
class Fired:
    """A reaction that was taken."""

    kind: str
    reaction: int  # its row in the machine
    before: str  # the state it was taken in
    after: str  # the state it leads to
    to_x: Control


def start(machine: Machine, x: Control) -> ReactionState:
    """An object at x, in the state that is nearest."""
    machine.check(x, "an object")
    return ReactionState(x, machine.nearest(x))


def steer(machine: Machine, current: ReactionState, x: Control) -> ReactionState:
    """The same after a hand has put x somewhere: no way goes on, no reaction waits longer."""
    machine.check(x, "an object")
    return replace(current, x=x, state=machine.nearest(x), motion=None)


def advance(
    machine: Machine,
    current: ReactionState,
    time_s: float,
    events: Sequence[Event] = (),
    place: np.ndarray | Sequence[float] | None = None,
) -> tuple[ReactionState, tuple[Fired, ...]]:
    """The state at a time, after what happened since the last one, in the order it happened.

    Each event takes the first reaction of its kind that may be taken and leads elsewhere; regions
    that `place` (3,) world metres has come into follow the events.  ValueError for a time before
    the last one and for what is no number.
    """
    if not current.time_s <= time_s < math.inf:
        raise ValueError(f"time {time_s} s follows {current.time_s} s; it must not go back.")
    current = replace(_moved(current, time_s), time_s=time_s)
    inside = current.inside if place is None else _inside(machine, place)
    entered = _entered(current.inside, inside)
    fired = []
    for kind, event, rows in [
        *((e.kind, e, range(len(machine.reactions))) for e in events),
        *(("enter", None, [row]) for row in entered),
    ]:
        current, taken = _answer(machine, current, kind, event, rows)
        fired += taken
    return replace(current, inside=inside), tuple(fired)


def _moved(current: ReactionState, time_s: float) -> ReactionState:
    motion = current.motion
    if motion is None:
        return current
    ended = motion.ends_by(time_s)
    return replace(current, x=motion.x(time_s), motion=None if ended else motion)


def _inside(machine: Machine, place: np.ndarray | Sequence[float]) -> tuple[bool, ...]:
    point = np.array(place, np.float64).reshape(1, 3)  # metres
    if not np.isfinite(point).all():
        raise ValueError(f"an object is at {place}; three finite numbers are wanted.")
    regions = [reaction.region for reaction in machine.reactions]
    return tuple(r is not None and bool(r.distance(point)[0] <= 0) for r in regions)


def _entered(before: tuple[bool, ...] | None, now: tuple[bool, ...] | None) -> list[int]:
    """Rows whose region was come into; where it stands at first it has not come."""
    if before is None or now is None:
        return []
    return [row for row, pair in enumerate(zip(before, now, strict=True)) if pair == (False, True)]


def _answer(
    machine: Machine,
    current: ReactionState,
    kind: str,
    event: Event | None,
    rows: Sequence[int],
) -> tuple[ReactionState, list[Fired]]:
    column = KINDS.index(kind)
    if current.time_s < current.quiet_until_s[column] - SLACK_S:
        return current, []
    for row in rows:
        reaction = machine.reactions[row]
        if reaction.on != kind or (reaction.after and current.state not in reaction.after):
            continue
        least = reaction.least_impulse_n_s
        hard = event is not None and event.impulse_n_s >= least and _rises(event, least)
        if kind == "collision" and not hard:
            continue
        goal = machine.goal(reaction, current.state)
        x, name = (goal.x, goal.name) if isinstance(goal, State) else (goal, "")
        heading = current.motion.end if current.motion else current.x
        if name == current.state and x == heading:
            continue
        quiet = list(current.quiet_until_s)
        quiet[column] = current.time_s + reaction.cooldown_s
        fired = Fired(kind, row, current.state, name, x)
        motion = Motion(
            current.x, x, current.time_s, reaction.seconds, reaction.ease,
            machine.goes_over(current.x, x), machine.blend,
        )  # fmt: skip
        current = replace(current, state=name, motion=motion, quiet_until_s=tuple(quiet))
        return _moved(current, current.time_s), [fired]
    return current, []


def _rises(event: Event, least_n_s: float) -> bool:
    """Whether the impulse comes to this strength now: what lies or leans has done so before."""
    return event.before_n_s < least_n_s or (event.before_n_s == 0 and event.impulse_n_s > 0)


@dataclass(frozen=True)
class TwoAxes:
    """Two dials to one x: balance leans to one of two sides, power says how far (ice and fire)."""

    below: float = 0.0  # x at balance -1 and power 1
    rest: float = 0.5  # x at power 0, and at balance 0
    above: float = 1.0  # x at balance 1 and power 1

    def __post_init__(self) -> None:
        for name in ("below", "rest", "above"):
            check_control(getattr(self, name), f"'{name}' of two axes")

    def x(self, balance: float, power: float, blend: StopBlend = NO_STOPS) -> Control:
        """Of balance -1..1 and power 0..1; ValueError beyond.  blend: the model's."""
        if not (-1 <= balance <= 1 and 0 <= power <= 1):
            raise ValueError(f"balance {balance} and power {power}; -1 to 1 and 0 to 1 are wanted.")
        side = self.above if balance > 0 else self.below
        return blend.between(self.rest, side, abs(balance) * power)


def _check(reaction: Reaction, field: str, fits: bool, wanted: str) -> None:
    if not fits:
        found = getattr(reaction, field)
        raise ValueError(f"'{field}' is {found!r:.60}; {wanted} is wanted.")
