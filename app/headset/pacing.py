"""Keeps the drawing of a headset's frames within the runtime's period: settings, then pixels."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from statistics import median

import numpy as np

from shapeshift.app.charts.budget import EXACT, FLOOR_DB, Choice, choose, least_scale
from shapeshift.app.charts.quick_chart import QUICK, QuickChart, QuickRow
from shapeshift.app.document import Document
from shapeshift.app.terminal import say
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.resolution import Resolution
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import Background
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene
from shapeshift.vr.frame import SIDES
from shapeshift.vr.pace import FramePace

AUTO = "auto"
FIXED: dict[str, str] = {  # quality of the panel -> row of the quick chart that it always is
    "best": "",
    "balanced": "sort 4, colours 5°, 1 px",
    "fast": "the same at 50 %",
}
# Of the quick chart, what pays most first, since there may not be the time for all.
PRICED = (
    "75 % scale", "50 % scale", "sort 4, colours 5°, 1 px", "the same at 75 %",
    "the same at 50 %", "1 px footprint", "sort every 4",
)  # fmt: skip
PATIENCE_S = 4.0
QUALITIES = (AUTO, *FIXED)
PART = 0.85  # of the period may be ours: the runtime wants the rest
SAME = 0.1  # of a period: how much another one may differ and ask for nothing new
LEAST = 0.25  # of the own part is for splats, however long all else takes
EASY = 0.6  # of the own part: what takes the exact picture no longer needs no chart
OVER, LATE = 1.05, 24  # times the own part, as the median of so many frames, is late
TRIES = 4  # exact frames that say whether shortcuts are needed at all; one before them warms up


class Pacing:
    """Gives the settings of every frame of a headset and takes its time.

    AUTO draws the exact picture where it is far from taking PART of the period.  Else the quick
    chart is measured, once, and the best of it chosen that is fast enough; while frames are late
    fewer pixels are drawn, as long as they are priced at `floor_db` or better.  The other
    qualities stay as they are.
    """

    def __init__(
        self, background: Background, quality: str = AUTO,
        floor_db: float = FLOOR_DB, target_ms: float | None = None, stereo_colors: str = AUTO,
    ) -> None:  # fmt: skip
        self.quality, self.floor_db, self._fixed_ms = quality, floor_db, target_ms
        self._stereo_colors = stereo_colors  # AUTO: as the quality has it
        self.choice: Choice | None = None  # of AUTO, where the chart was measured
        self.exact_ms = 0.0  # that the exact picture of both eyes took at first
        self._period_s = 0.0  # that was chosen for
        self._exact = RenderSettings(background=background)
        self._rows: tuple[QuickRow, ...] = ()
        self._resolution: Resolution | None = None
        self._times: deque[float] = deque(maxlen=LATE)  # ms of drawing, since that was chosen
        self._rest: deque[float] = deque(maxlen=LATE)  # ms of all else: world, hands, panel

    def for_scene(self, background: Background) -> "Pacing":
        """The same for another scene, of which nothing is measured yet."""
        return Pacing(background, self.quality, self.floor_db, self._fixed_ms, self._stereo_colors)

    def settings(self) -> RenderSettings:
        """Of the next frame."""
        if self.quality != AUTO:
            settings = replace(self._exact, **QUICK.get(FIXED[self.quality], {}))
        elif self.choice is None or self._resolution is None:
            settings = self._exact
        else:
            scale, background = self._resolution.scale, self._exact.background
            settings = replace(self.choice.settings, background=background, render_scale=scale)
        if self._stereo_colors == AUTO:
            return settings
        return replace(settings, stereo_colors=self._stereo_colors)

    @property
    def chosen(self) -> str:
        """Name of the row of the quick chart that is in use."""
        if self.quality != AUTO:
            return FIXED[self.quality] or EXACT
        return self.choice.name if self.choice else EXACT

    @property
    def target_ms(self) -> float:
        """What is left for drawing the splats: fewer of them make nothing else quicker."""
        whole = self._fixed_ms or PART * self._period_s * 1e3
        return max(whole - median(self._rest or (0.0,)), LEAST * whole)

    def wants_measure(self, period_s: float) -> bool:
        """Whether nothing was chosen yet for a period like this, or what was proves too slow."""
        if self.quality != AUTO or not period_s > 0:
            return False
        late = len(self._times) == LATE and median(self._times) > OVER * self.target_ms
        another = not abs(period_s - self._period_s) <= SAME * self._period_s
        return another or (late and not self._rows)

    def measure(self, chart: "StereoChart", period_s: float) -> None:
        """Chooses for a period; says on stderr what it chose instead of the exact picture.

        What was measured once is not measured again.
        """
        late = bool(self.exact_ms)
        self._times.clear()
        self._period_s = period_s
        target_ms = self.target_ms
        self.exact_ms = self.exact_ms or chart.exact_ms()
        if not self._rows and not late and self.exact_ms <= EASY * target_ms:
            return
        self._rows = self._rows or chart.rows()
        self._use_row(choose(self._rows, target_ms, self.floor_db))

    def _use_row(self, choice: Choice) -> None:
        """Draws with a row of the chart from the next frame on."""
        self.choice, target_ms = choice, self.target_ms
        if choice.name != EXACT:
            say(choice.sentence)
        # Fewer pixels are priced alone: on top of other shortcuts nobody knows what they cost.
        chosen = choice.settings
        priced = least_scale(self._rows, self.floor_db)
        plain = RenderSettings()
        alone = replace(chosen, render_scale=1.0, target=plain.target, background=plain.background)
        scale = chosen.render_scale
        least = min(priced, scale) if alone == plain else scale
        self._resolution = Resolution(target_ms, least, scale)

    def seen(self, drawing_ms: float, own_ms: float) -> None:
        """Takes the time of a frame, of its splats and of all of it; 0: it does not count."""
        if not 0 < drawing_ms <= own_ms:
            return
        self._rest.append(own_ms - drawing_ms)
        if self.quality != AUTO:
            return
        self._times.append(drawing_ms)
        if self._resolution is not None:
            self._resolution.target_ms = self.target_ms
            self._resolution.seen(drawing_ms)
            self._choose_again()

    def _choose_again(self) -> None:
        """Where frames stay late though all was measured: another place is dearer than the one of
        the chart, and fewer pixels do not make up for it.  The prices are taken for as much
        dearer as the frames are, and a quicker row for the one in use.
        """
        if self.choice is None or len(self._times) < LATE:
            return
        now_ms = median(self._times)
        if not now_ms > OVER * self.target_ms:
            return
        dearer = max(now_ms / self.choice.ms, 1.0)
        quicker = choose(self._rows, self.target_ms / dearer, self.floor_db)
        if quicker.ms < self.choice.ms:
            self._times.clear()
            self._use_row(quicker)

    @property
    def _chosen_db(self) -> float | None:
        """What the worst view was priced at with what was chosen, or the fewest pixels that may
        follow; None for the exact picture, and where nothing was measured.
        """
        if self.choice is None or self._resolution is None:
            return None
        fewest = [r.db for r in self._rows if r.settings.render_scale == self._resolution.least]
        shown = [self.choice.db, *(fewest if self.settings().render_scale < 1 else [])]
        least = min(db for db in shown if db >= self.floor_db or db == self.choice.db)
        return round(least, 2) if least < np.inf else None

    def report(self) -> dict:
        return {
            "quality": self.quality,
            "exact_ms": round(self.exact_ms, 3),
            "chosen": self.chosen,
            "chosen_db": self._chosen_db,
            "scale": self.settings().render_scale,
            "stereo_colors": self.settings().stereo_colors,
        }


class StereoChart:
    """Prices the quick settings with all views of a frame, before anything is shown; dB are those
    of the left eye, of its inset where that is worse.
    """

    def __init__(
        self, renderer: Renderer, scene: Scene, views: Sequence[View], centre: np.ndarray,
        finish: Callable[[], None],
    ) -> None:  # fmt: skip
        left, *others = views
        left_from_world = np.linalg.inv(left.world_from_eye.matrix())
        apart = [left_from_world @ view.world_from_eye.matrix() for view in others]
        self._renderer = renderer

        def eyes(view: View) -> list[View]:
            moved = [Pose.from_matrix(view.world_from_eye.matrix() @ each) for each in apart]
            pairs = zip(others, moved, strict=True)
            return [view, *(replace(other, world_from_eye=pose) for other, pose in pairs)]

        judged = range(0, len(views), len(SIDES))  # the left eye's
        self._chart = QuickChart(renderer, scene, left, centre, finish, eyes, judged)

    def exact_ms(self) -> float:
        """Median of a few exact frames of both eyes."""
        return median([self._chart.time_exact(i) for i in range(TRIES + 1)][1:])

    def rows(self) -> tuple[QuickRow, ...]:
        """Those of PRICED that PATIENCE_S is enough for; nobody sees a picture meanwhile."""
        kept, until = self._renderer.settings, time.perf_counter() + PATIENCE_S
        self._chart.only(PRICED)
        try:
            while not self._chart.done and (
                time.perf_counter() < until or not self._chart.rows  # the exact one at least
            ):
                self._chart.step()
        finally:
            self._renderer.settings = kept
        return tuple(self._chart.rows)


def choose_quality(
    pacing: Pacing, pace: FramePace, renderer: Renderer, scene: Scene, views: Sequence[View],
    finish: Callable[[], None],
) -> None:  # fmt: skip
    """What of the picture can be had within the display's period: once that is known, and when it
    is another one.
    """
    if not (pace.settled and pacing.wants_measure(pace.period_s)):
        return
    centre, _ = Document(scene).bounds()
    pacing.measure(StereoChart(renderer, scene, views, centre, finish), pace.period_s)
    pace.restart()
