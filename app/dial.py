"""The budget dial: milliseconds wanted, likeness kept; measures once, then chooses at once."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from app.budget import Choice, choose
from app.quick_chart import QuickChart, QuickRow
from renderer.renderer import Renderer
from renderer.settings import RenderSettings
from scene.pose import View
from scene.scene import Scene

STEP_S = 0.04  # of measuring between two frames of the window; one measured frame at least
TARGET_MS, FLOOR_DB = 33.0, 35.0  # where the dial stands at first


@dataclass
class Dial:
    """What is wanted, what was measured, what was chosen."""

    target_ms: float = TARGET_MS
    floor_db: float = FLOOR_DB
    wanted: bool = False  # start measuring in the next frame
    rows: tuple[QuickRow, ...] = ()
    choice: Choice | None = None
    _chart: QuickChart | None = None

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

    def step(self) -> bool:
        """Measures for a moment; True once it is complete and a choice was made."""
        until = time.perf_counter() + STEP_S
        while not self._chart.done:
            self._chart.step()
            if time.perf_counter() >= until:
                return False
        self.rows, self._chart = tuple(self._chart.rows), None
        self.choose()
        return True

    def choose(self) -> None:
        """Chooses again from what was measured, for another target or floor."""
        if self.rows:
            self.choice = choose(self.rows, self.target_ms, self.floor_db)

    def applied(self, settings: RenderSettings) -> RenderSettings:
        """The chosen setting over the background, and in the debug view, that `settings` has."""
        chosen = self.choice.settings
        return replace(chosen, background=settings.background, debug=settings.debug)
