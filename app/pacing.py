"""Keeps the drawing of a headset's frames within the runtime's period: settings, then pixels."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from statistics import median

import numpy as np

from app.budget import EXACT, FLOOR_DB, Choice, choose, least_scale
from app.dial import LEAST_SCALE, SMALLEST_SCALE
from app.quick_chart import QUICK, QuickChart, QuickRow
from renderer.renderer import Renderer
from renderer.resolution import Resolution
from renderer.settings import RenderSettings
from scene.pose import Pose, View
from scene.scene import Scene

AUTO = "auto"
FIXED = {  # quality of the panel -> row of the quick chart that it always is
    "best": "",
    "balanced": "sort 4, colours 5°, 1 px",
    "fast": "the same at 50 %",
}
QUALITIES = (AUTO, *FIXED)
PART = 0.85  # of the period may be ours: the runtime wants the rest
SAME = 0.1  # of a period: how much another one may differ and ask for nothing new
TRIES = 4  # exact frames that say whether shortcuts are needed at all; one before them warms up


class Pacing:
    """Gives the settings of every frame of a headset and takes its time.

    AUTO measures once, before the first picture: shortcuts are chosen only where the exact
    picture takes longer than PART of the period, never below `floor_db`, and then fewer pixels
    are drawn while frames are late.  The other qualities stay as they are.
    """

    def __init__(
        self, background: tuple[float, float, float], quality: str = AUTO,
        floor_db: float = FLOOR_DB, target_ms: float | None = None,
    ) -> None:  # fmt: skip
        self.quality, self.floor_db, self.target_ms = quality, floor_db, target_ms
        self.choice: Choice | None = None  # of AUTO, where shortcuts were needed
        self.exact_ms = 0.0  # that the exact picture of both eyes took at first
        self._period_s = 0.0  # that was chosen for
        self._exact = RenderSettings(background=background)
        self._rows: tuple[QuickRow, ...] = ()
        self._resolution: Resolution | None = None

    @property
    def scale(self) -> float:
        """Of the width and height of an eye, that is drawn now."""
        return self.settings().render_scale

    def settings(self) -> RenderSettings:
        """Of the next frame."""
        if self.quality != AUTO:
            changes = QUICK.get(FIXED[self.quality], {})
            return replace(self._exact, **changes)
        chosen = self._exact if self.choice is None else self.choice.settings
        chosen = replace(chosen, background=self._exact.background)
        if self._resolution is None:
            return chosen
        scale = max(chosen.render_scale * self._resolution.scale, SMALLEST_SCALE)
        return replace(chosen, render_scale=scale)

    @property
    def chosen(self) -> str:
        """Name of the row of the quick chart that is in use."""
        if self.quality != AUTO:
            return FIXED[self.quality] or EXACT
        return self.choice.name if self.choice else EXACT

    def wants_measure(self, period_s: float) -> bool:
        """Whether nothing was chosen yet for a period like this."""
        if self.quality != AUTO or not period_s > 0:
            return False
        return not abs(period_s - self._period_s) <= SAME * self._period_s

    def measure(self, chart: "StereoChart", period_s: float) -> None:
        """Chooses for a period; says on stderr what it chose where the exact picture is too slow.

        What was measured once is not measured again.
        """
        self._period_s = period_s
        target = self.target_ms or PART * period_s * 1e3
        self.exact_ms = self.exact_ms or chart.exact_ms()
        self.choice = None
        if self.exact_ms > target:
            self._rows = self._rows or chart.rows()
            self.choice = choose(self._rows, target, self.floor_db)
            print(self.choice.sentence, file=sys.stderr)
        # A scale that was priced below the floor is not gone to; unpriced, half is.
        least = least_scale(self._rows, self.floor_db) if self._rows else LEAST_SCALE
        self._resolution = Resolution(target, least)

    def seen(self, own_ms: float) -> None:
        """Takes the time of a frame that was drawn."""
        if self.quality == AUTO and self._resolution is not None:
            self._resolution.seen(own_ms)

    def report(self) -> dict:
        return {
            "quality": self.quality,
            "exact_ms": round(self.exact_ms, 3),
            "chosen": self.chosen,
            "scale": self.scale,
        }


class StereoChart:
    """Prices the quick settings with both eyes, before anything is shown."""

    def __init__(
        self, renderer: Renderer, scene: Scene, views: Sequence[View], centre: np.ndarray,
        finish: Callable[[], None],
    ) -> None:  # fmt: skip
        left, right = views
        apart = np.linalg.inv(left.world_from_eye.matrix()) @ right.world_from_eye.matrix()
        self._renderer = renderer

        def eyes(view: View) -> list[View]:
            pose = Pose.from_matrix(view.world_from_eye.matrix() @ apart)
            return [view, replace(right, world_from_eye=pose)]

        self._chart = QuickChart(renderer, scene, left, centre, finish, eyes)

    def exact_ms(self) -> float:
        """Median of a few exact frames of both eyes."""
        return median([self._chart.time_exact(i) for i in range(TRIES + 1)][1:])

    def rows(self) -> tuple[QuickRow, ...]:
        """All of them; takes seconds where there is no GPU."""
        kept = self._renderer.settings
        try:
            while not self._chart.done:
                self._chart.step()
        finally:
            self._renderer.settings = kept
        return tuple(self._chart.rows)
