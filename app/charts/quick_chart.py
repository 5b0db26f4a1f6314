"""A chart in seconds, in the window: named settings timed and compared frame by frame."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import numpy as np

from shapeshift.app.charts.budget import EXACT
from shapeshift.app.charts.comparison import MOST_DB, exact
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene

FRAMES = 5  # of each setting that count, along the turn; one before them does not
BETWEEN = 3  # exact frames that count between two settings, again after one that does not
STEP = np.radians(2.0)  # of the turn about the scene's centre between two frames
# Two eyes are off by less than that when one set of colours is right for both of them.
RECOLORED: dict[str, Any] = {"recolor_degrees": 5.0, "stereo_colors": "shared"}
LATER: dict[str, Any] = {"resort_frames": 4, **RECOLORED}
# Name -> what differs from exact; pairs come from what pays most on its own.
QUICK: dict[str, dict[str, Any]] = {
    "16-bit keys": {"key_bits": 16},
    "sort every 4": {"resort_frames": 4},
    "sort every 8": {"resort_frames": 8},
    "colours after 5\u00b0": RECOLORED,
    "0.5 px footprint": {"min_pixels": 0.5},
    "1 px footprint": {"min_pixels": 1.0},
    "2 px footprint": {"min_pixels": 2.0, "fade": 0.2},
    "64 px splats": {"max_pixels": 64.0, "fade": 0.2},
    "stop at 1/256": {"min_transmittance": 1 / 256},
    "75 % scale": {"render_scale": 0.75},
    "50 % scale": {"render_scale": 0.5},
    "sort 4, colours 5\u00b0, 1 px": {**LATER, "min_pixels": 1.0},
    "the same at 75 %": {**LATER, "min_pixels": 1.0, "render_scale": 0.75},
    "the same at 50 %": {**LATER, "min_pixels": 1.0, "render_scale": 0.5},
}


@dataclass(frozen=True)
class QuickRow:
    """One setting of the chart."""

    name: str
    settings: RenderSettings
    ms: float  # median frame, of frames that turn
    db: float  # PSNR against exact, worst of the frames


def turned(view: View, centre: np.ndarray, angle: float) -> View:
    """The view after a turn about the vertical axis through `centre` (3,)."""
    about = np.eye(4)
    about[:3, :3] = Pose(np.zeros(3), np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0])
                         ).matrix()[:3, :3]  # fmt: skip
    about[:3, 3] = centre - about[:3, :3] @ centre
    return replace(view, world_from_eye=Pose.from_matrix(about @ view.world_from_eye.matrix()))


def frames_for(settings: Mapping) -> int:
    """How many frames a chart of these takes."""
    return (FRAMES + 1) + len(settings) * (FRAMES + BETWEEN + 2)


class QuickChart:
    """Measures exact and every quick setting on a small turn around what is seen now.

    `step` draws one frame; `rows` is complete once `done`.  The exact setting is timed again
    before each other one, so that a machine that slows down slows both.  `eyes` gives the views
    that are drawn together with one; errors are the worst of those that are `judged`, by number.
    """

    def __init__(
        self, renderer: Renderer, scene: Scene, view: View, centre: np.ndarray,
        finish: Callable[[], None], eyes: Callable[[View], list[View]] = lambda view: [view],
        judged: Sequence[int] = (0,),
    ) -> None:  # fmt: skip
        self._judged = tuple(judged)
        self._renderer, self._scene, self._finish, self._eyes = renderer, scene, finish, eyes
        self._views = [turned(view, centre, STEP * i) for i in range(FRAMES + 1)]
        drawing = renderer.backends["drawing"]
        self._exact = exact(renderer.settings, drawing)
        self._settings = {
            name: replace(RenderSettings(background=self._exact.background), **changes)
            for name, changes in QUICK.items()
            if "min_transmittance" not in changes or not drawing.startswith("quads")
        }
        self._pictures: list[list[np.ndarray]] = []  # of each frame those that are judged
        self._exact_ms: list[float] = []
        self.rows: list[QuickRow] = []
        self.frame, self.frames = 0, frames_for(self._settings)
        self._work = self._measure()
        self.done = False

    def only(self, names: Sequence[str]) -> None:
        """Leaves the others out, and takes these in their order; before the first step."""
        self._settings = {name: self._settings[name] for name in names if name in self._settings}
        self.frames = frames_for(self._settings)

    def time_exact(self, number: int) -> float:
        """Milliseconds of one exact frame of the turn, measured with the chart."""
        return self._draw(self._exact, self._views[number % len(self._views)])

    def step(self) -> None:
        """Draws and times one frame more."""
        self.done = next(self._work, None) is None
        self.frame += 1

    def _measure(self) -> Iterator[bool]:
        """Yields after every frame."""
        for number, view in enumerate(self._views):
            ms = self._draw(self._exact, view)
            self._pictures.append(self._seen())
            if number:
                self._exact_ms.append(ms)
            yield True
        base = median(self._exact_ms)
        self.rows.append(QuickRow(EXACT, self._exact, base, MOST_DB))
        for name, settings in self._settings.items():
            now = []
            for view in self._views[: BETWEEN + 1]:
                now.append(self._draw(self._exact, view))
                yield True
            times, errors = [], []
            for number, view in enumerate(self._views):
                ms = self._draw(settings, view)
                if number:
                    times.append(ms)
                    pairs = zip(self._seen(), self._pictures[number], strict=True)
                    errors.append(min(psnr(*pair) for pair in pairs))
                yield True
            ms = median(times) / median(now[1:]) * base
            self.rows.append(QuickRow(name, settings, ms, float(np.min([*errors, MOST_DB]))))

    def _seen(self) -> list[np.ndarray]:
        return [self._renderer.resolved(i) for i in self._judged]

    def _draw(self, settings: RenderSettings, view: View) -> float:
        """Milliseconds of a whole frame, decoding of colours included."""
        self._renderer.settings = settings
        start = time.perf_counter()
        self._renderer.update(self._scene)
        self._renderer.draw(self._eyes(view))
        self._finish()
        return (time.perf_counter() - start) * 1e3
