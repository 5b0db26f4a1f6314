"""Frame pacing: our own time against the runtime's period, and how many frames were dropped."""

from dataclasses import dataclass, field

import numpy as np

KEPT = 20_000  # frames whose times are kept: a few minutes


@dataclass
class Pace:
    """Takes times of frames; seconds in, milliseconds out."""

    frames: int = 0
    dropped: int = 0  # the runtime showed an older one in their place
    over: int = 0  # frames whose own time was longer than the period
    period_s: float = 0.0  # of the runtime, as told last
    own_ms: list[float] = field(default_factory=list)  # from the runtime's go to our hand-over
    wait_ms: list[float] = field(default_factory=list)  # the runtime let us wait
    _seen_s: float | None = None  # when the last frame was to be seen

    def start(self, seen_s: float, period_s: float, wait_s: float) -> None:
        """A frame begins that will be seen at `seen_s`."""
        if period_s > 0:
            self.period_s = period_s
            if self._seen_s is not None:
                self.dropped += max(round((seen_s - self._seen_s) / period_s) - 1, 0)
        self._seen_s = seen_s
        self.frames += 1
        _keep(self.wait_ms, wait_s * 1e3)

    def end(self, own_s: float) -> None:
        """It was handed over; `own_s` is what we took for it."""
        self.over += 0 < self.period_s < own_s
        _keep(self.own_ms, own_s * 1e3)

    def pause(self) -> None:
        """The session rests: the time until the next frame is nobody's fault."""
        self._seen_s = None

    def report(self) -> dict:
        """Counts, and medians and 95th percentiles in ms; {} of times where there are none."""
        return {
            "frames": self.frames,
            "dropped": self.dropped,
            "over_period": int(self.over),
            "period_ms": round(self.period_s * 1e3, 3),
            "own_ms": _percentiles(self.own_ms),
            "wait_ms": _percentiles(self.wait_ms),
        }


def _keep(times: list[float], ms: float) -> None:
    times.append(ms)
    if len(times) > KEPT:
        del times[: KEPT // 2]


def _percentiles(times: list[float]) -> dict:
    if not times:
        return {}
    p50, p95 = np.percentile(times, [50, 95])
    return {"p50": round(float(p50), 3), "p95": round(float(p95), 3)}
