"""Frame pacing: our own time against the runtime's period, and how many frames were dropped."""

from array import array
from collections import deque
from collections.abc import MutableSequence
from dataclasses import dataclass, field

import numpy as np

KEPT = 120_000  # frames whose times are kept: sixteen minutes of 120 a second, a megabyte each
SETTLED = 10  # frames after which what the runtime tells of its period is believed
RECOVER = 4  # frames
RECENT = 30  # frames: the shortest of their periods is the display's


Times = MutableSequence[float]


def no_times() -> Times:
    return array("d")  # eight bytes each: a list of ten minutes would be seen to grow


@dataclass
class FramePace:
    """Takes times of frames; seconds in, milliseconds out.

    `display_s` is the display's own period where the runtime tells it.  What it predicts with a
    frame is no more than a hint: some begin with a guess, and double it for who is slow.
    """

    display_s: float = 0.0
    frames: int = 0
    dropped: int = 0  # the runtime showed an older one in their place
    over: int = 0  # frames whose own time was longer than the period
    late: int = 0  # frames that were seen more than a period after the one before
    own_ms: Times = field(default_factory=no_times)  # from the runtime's go to our hand-over
    drawing_ms: Times = field(default_factory=no_times)  # of own_ms, the splats of both eyes
    wait_ms: Times = field(default_factory=no_times)  # the runtime let us wait
    shown_ms: Times = field(default_factory=no_times)  # from a frame that is seen to the next
    _periods: deque[float] = field(default_factory=lambda: deque(maxlen=RECENT))  # periods, seconds
    _seen_s: float | None = None  # when the last frame was to be seen
    _beyond_ms: float = 0.0  # of the frame under way, on a GPU that nobody waits for
    _unfair: int = 0  # frames whose times and gaps do not count

    @property
    def period_s(self) -> float:
        """Of the display; 0 while nothing is known."""
        return self.display_s or min(self._periods, default=0.0)

    @property
    def settled(self) -> bool:
        """Whether the period can be relied upon."""
        return self.display_s > 0 or self.frames > SETTLED

    def start(self, seen_s: float, period_s: float, wait_s: float) -> None:
        """A frame begins that will be seen at `seen_s`; the runtime tells `period_s` with it."""
        if self.frames == SETTLED:
            self._periods.clear()  # the first were guesses
        if period_s > 0:
            self._periods.append(period_s)
        if self._seen_s is not None and self.period_s > 0 and self.settled and not self._unfair:
            missed = max(round((seen_s - self._seen_s) / self.period_s) - 1, 0)
            self.dropped += missed
            self.late += missed > 0
            _keep(self.shown_ms, (seen_s - self._seen_s) * 1e3)
        self._seen_s = seen_s
        self.frames += 1
        _keep(self.wait_ms, wait_s * 1e3)

    def drew(self, drawing_ms: float, beyond_ms: float = 0.0) -> None:
        """Before the end: how long the splats of both eyes took; beyond_ms of it on a GPU, after
        the time that `end` is told of.
        """
        self._beyond_ms = beyond_ms
        if not self._unfair:
            _keep(self.drawing_ms, drawing_ms)

    def end(self, own_s: float) -> None:
        """It was handed over; `own_s` is what we took for it."""
        own_s += self._beyond_ms / 1e3
        self._beyond_ms = 0.0
        if self._unfair:
            self._unfair -= 1
            return
        self.over += self.settled and 0 < self.period_s < own_s
        _keep(self.own_ms, own_s * 1e3)

    def restart(self) -> None:
        """The frame under way took long for a reason of its own: it does not count, nor do
        those that runtimes need to find their pace again.
        """
        self._unfair = RECOVER

    @property
    def last_ms(self) -> float:
        """Our own time of the last frame; 0 where it does not count."""
        return 0.0 if self._unfair or not self.own_ms else self.own_ms[-1]

    def pause(self) -> None:
        """The session rests: the time until the next frame is nobody's fault."""
        self._seen_s = None

    def report(self) -> dict:
        """Counts, and percentiles and worst in ms; {} of times where there are none."""
        return {
            "frames": self.frames,
            "dropped": self.dropped,
            "in_time": round(1 - self.late / len(self.shown_ms), 5) if self.shown_ms else None,
            "over_period": int(self.over),
            "period_ms": round(self.period_s * 1e3, 3),
            "own_ms": _percentiles(self.own_ms),
            "drawing_ms": _percentiles(self.drawing_ms),
            "wait_ms": _percentiles(self.wait_ms),
            "shown_ms": _percentiles(self.shown_ms),
        }


def _keep(times: Times, ms: float) -> None:
    times.append(ms)
    if len(times) > KEPT:
        del times[: KEPT // 2]


def _percentiles(times: Times) -> dict:
    if not times:
        return {}
    found = np.percentile(times, [50, 95, 99, 100])
    names = ("p50", "p95", "p99", "worst")
    return {name: round(float(ms), 3) for name, ms in zip(names, found, strict=True)}
