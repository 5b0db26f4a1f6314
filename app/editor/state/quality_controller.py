"""The budget dial: milliseconds wanted, likeness kept; measures once, then chooses at once."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.app.charts.budget import Choice, choose, least_scale
from shapeshift.app.charts.quick_chart import QuickChart, QuickRow
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.resolution import Resolution
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene

STEP_S = 0.04  # of measuring between two frames of the window; one measured frame at least
LEAST_SCALE = 0.5  # while moving, where no chart says how far down the floor allows
SMALLEST_SCALE = 1 / 16  # that the renderer takes
TARGET_MS, FLOOR_DB = 33.0, 35.0  # where the dial stands at first


@dataclass
class QualityController:
    """What is wanted, what was measured, what was chosen."""

    target_ms: float = TARGET_MS
    floor_db: float = FLOOR_DB
    wanted: bool = False  # start measuring in the next frame
    rows: tuple[QuickRow, ...] = ()
    choice: Choice | None = None
    dynamic: bool = False  # fewer pixels while something moves, where frames are too slow
    _chart: QuickChart | None = None
    _resolution: Resolution | None = None
    _wanted: tuple[float, float] = (0.0, 0.0)  # target and least scale that it was made for

    @property
    def measuring(self) -> bool:
        return self._chart is not None

    @property
    def progress(self) -> float:
        """0..1 of the frames that are to be measured."""
        return self._chart.frame / self._chart.frames if self._chart else 0.0

    def start(
        self, renderer: Renderer, scene: Scene, view: View, centre: np.ndarray,
        finish: Callable[[], None],
    ) -> None:  # fmt: skip
        """Begins to measure `scene` around `view`; `finish` waits until a frame is drawn."""
        self.wanted = False
        self._chart = QuickChart(renderer, scene, view, centre, finish)

    def cancel(self) -> None:
        """Stops measuring; what was measured before stays."""
        self._chart = None

    def forget(self) -> None:
        """Another scene: what was measured says nothing about it."""
        self._chart, self.rows, self.choice = None, (), None

    def scene_changed(self) -> None:
        """Another number of splats is drawn: what was measured once is measured again."""
        self.wanted = self.wanted or self.measuring or self.choice is not None
        self.forget()

    def step(self) -> bool:
        """Measures for a moment; True once it is complete and a choice was made."""
        chart, until = self._chart, time.perf_counter() + STEP_S
        if chart is None:
            return False
        while not chart.done:
            chart.step()
            if time.perf_counter() >= until:
                return False
        self.rows, self._chart = tuple(chart.rows), None
        self.choose()
        return True

    def choose(self) -> None:
        """Chooses again from what was measured, for another target or floor."""
        if self.rows:
            self.choice = choose(self.rows, self.target_ms, self.floor_db)

    def while_moving(self, settings: RenderSettings) -> RenderSettings:
        """`settings` with as many pixels as the target leaves time for; at rest all are drawn."""
        if not self.dynamic:
            self._resolution = None
            return settings
        least = least_scale(self.rows, self.floor_db) if self.rows else LEAST_SCALE
        wanted = (self.target_ms, least)
        if self._resolution is None or self._wanted != wanted:
            self._resolution, self._wanted = Resolution(*wanted), wanted
        # What was chosen may draw fewer pixels already: both together go no further than the floor.
        chosen = settings.render_scale
        lowest = max(min(chosen, least), SMALLEST_SCALE)
        return replace(settings, render_scale=max(chosen * self._resolution.scale, lowest))

    def seen(self, frame_ms: float, moving: bool) -> None:
        """Takes the time of a frame that was drawn while something moved."""
        if self._resolution is not None and moving and not self.measuring:
            self._resolution.seen(frame_ms)

    def applied(self, settings: RenderSettings) -> RenderSettings:
        """The chosen setting over the background, and in the debug view, that `settings` has."""
        if self.choice is None:
            return settings
        return replace(self.choice.settings, background=settings.background, debug=settings.debug)
