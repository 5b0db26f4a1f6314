"""What the viewer has measured, for showing: the last frame, and the frames of the last second."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median

from shapeshift.renderer.settings import FrameStats

SECOND = 1.0  # how far back the meter looks
FEWEST = 5  # frames that the median is taken of, even where they are older than a second


@dataclass(frozen=True)
class FrameTimes:
    """One frame with new splats."""

    when: float  # seconds, when it was shown
    ms: float  # whole: update to swap
    sorts: int
    geometry_runs: int
    color_runs: int


class Meter:
    """Frames of the last second; frames that only showed the same splats again do not count."""

    def __init__(self) -> None:
        self._frames: deque[FrameTimes] = deque()
        self.geometry_runs = self.color_runs = 0  # since the start

    def note(self, now: float, ms: float, stats: FrameStats) -> float:
        """Takes a frame in and forgets those that are too old.  Returns what it took: ms, or longer
        on a GPU, since nobody waits for one.
        """
        ms = max(ms, sum(stats.ms.values()))
        frame = FrameTimes(now, ms, stats.sorts, stats.geometry_runs, stats.color_runs)
        self._frames.append(frame)
        self.geometry_runs += stats.geometry_runs
        self.color_runs += stats.color_runs
        while len(self._frames) > FEWEST and self._frames[0].when < now - SECOND:
            self._frames.popleft()
        return ms

    @property
    def ms(self) -> float:
        """Median of the last second; 0 before the first frame."""
        return median(frame.ms for frame in self._frames) if self._frames else 0.0

    @property
    def slowest_ms(self) -> float:
        return max((frame.ms for frame in self._frames), default=0.0)

    def per_second(self, what: str, now: float) -> float:
        """How often `sorts`, `geometry_runs` or `color_runs` happened in the last second."""
        recent = [frame for frame in self._frames if frame.when > now - SECOND]
        return sum(getattr(frame, what) for frame in recent) / SECOND


@dataclass
class FrameStatsView:
    """What was measured, for showing."""

    stats: FrameStats = field(default_factory=FrameStats)
    meter: Meter = field(default_factory=Meter)
    now: float = 0.0  # seconds, of the frame that is being made
    machine: Mapping[str, str] = field(default_factory=dict)  # label -> driver or back end
    drawing: str = ""  # quads or tiles, with what they run on
    flying: bool = False
    idle: bool = False
    error_db: float | None = None  # of the picture as set against the exact one; None: not known
    error_is_old: bool = False  # view, x or setting have changed since
    stale_db: float | None = None  # of a kept order against a new one; None: the order is new
