"""What the tests of the window share: a ball to look at and a renderer that counts."""

import os
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import moderngl
import numpy as np

from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.runtime_models.model import BadFile, SplatLayers, Stop
from shapeshift.scene.appearance import plain_color

STOPS = (
    Stop("photo", 0.0),
    Stop("thermal", 1.0, "thermal", "ironbow", (18.0, 84.0), "°C"),
)


def ball(count: int = 2000) -> SplatLayers:
    """A green ball that is there at every stop."""
    rng = np.random.default_rng(0)
    means = rng.normal(size=(count, 3))
    means /= np.linalg.norm(means, axis=1, keepdims=True)
    green = np.tile(np.array([-1.0, 1.5, -1.0]), (count, 1, 1))
    return SplatLayers(
        means.astype(np.float32),
        np.full((count, 3), 0.04, np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
        np.full(count, 0.95, np.float32),
        green.astype(np.float32),
        np.zeros(count, np.int32),
        STOPS,
    )


class PlainRenderer:
    """Counts what is asked of it and fills the window with one colour."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.settings = RenderSettings()
        self.backends = {"drawing": "none", "mlps": "none", "sort": "none"}
        self.drawing = SimpleNamespace(draws_heat=False)
        self.streaming = SimpleNamespace(due=False, stats=None, converges=True)
        self.levels = SimpleNamespace(all_whole=nullcontext)
        self.updates = self.draws = self.presents = 0
        self.view, self.drawn_at, self.taker = None, self.settings, None

    def update(self, scene) -> None:
        self.updates += 1

    def draw(self, views, target=None) -> FrameStats:
        self.draws += 1
        if target is not None:
            self.present(target)
        self.view, self.drawn_at = views[0], self.settings
        culled = {"opacity": 5, "frustum": 7}
        return FrameStats(ms={"project": 1.0, "splat": 2.0}, splats=12, drawn=8, culled=culled)

    def resolved(self, i: int) -> np.ndarray:
        """Gray, and less exact with every pixel of the smallest footprint."""
        width, height = self.view.size
        picture = np.full((height, width, 3), 0.5, np.float32)
        picture[::2] += 0.01 * self.drawn_at.min_pixels
        return picture

    def image(self, i: int = 0) -> np.ndarray:
        """Nothing is covered, so nothing is measured."""
        width, height = self.view.size
        return np.zeros((height, width, 4), np.float32)

    def surface(self, view) -> SimpleNamespace:
        return SimpleNamespace(depth=lambda least: np.full(view.size[::-1], np.inf))

    def stale_order_db(self, views) -> float:
        return 51.0

    def present(self, framebuffer, i: int = 0) -> None:
        self.presents += 1
        color = plain_color(self.settings.background)
        framebuffer.clear(*color, viewport=framebuffer.viewport)


def read_stub(path: Path):
    if path.name == "bad.shift":
        raise BadFile("bad.shift is truncated: 300 bytes found, 500 wanted; copy it again.")
    return ball()


def until_opened(viewer) -> None:
    """Frames until the thread that opens files has done so, and what it found is shown."""
    end = time.monotonic() + 20
    while viewer.files.busy and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.005)
    run_frames(viewer, 2)


def run_frames(viewer, count: int, seconds: float = 0.02) -> None:
    for _ in range(count):
        viewer.window.wait(0)
        viewer.frame(seconds)


ROOT = Path(__file__).resolve().parents[3]


def start(display: str | None, *arguments, code: str | None = None) -> subprocess.CompletedProcess:
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    if display:
        environment["DISPLAY"] = display
    program = ["-c", code] if code else ["-m", "shapeshift"]
    return subprocess.run(
        [sys.executable, *program, *map(str, arguments)],
        env=environment,
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=120,
    )
