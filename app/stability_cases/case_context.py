"""Where the cases of `launch.py stability` take place: one scene, one renderer, and the moves."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace

import moderngl
import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.stability_cases.finding import Panel
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import IDENTITY, Scene

EMPTY = Scene(())


@dataclass
class CaseContext:
    """A scene in a renderer; cases draw with it and leave nothing behind but the last frame."""

    renderer: Renderer
    ctx: moderngl.Context | None  # None with tiles alone
    subject: Document
    size: tuple[int, int]
    reopen: Callable[[], AbstractContextManager]  # another context and renderer of this kind
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    steps: int = 24  # frames from stop to stop, and of the turn
    rounds: int = 50  # contexts made and closed
    stats: FrameStats = field(default_factory=FrameStats)  # of the last frame

    def scene(self, x: float | None = None, pose: Pose = IDENTITY) -> Scene:
        """All objects at x, None: each at its own; the world moved by a pose."""
        return self.subject.at(x, pose)

    def view(self) -> View:
        """The first look at the scene, as every mode takes it."""
        return self.subject.view(self.size)

    def bounds(self) -> tuple[np.ndarray, float]:
        """Centre (3,) and radius of the scene, metres."""
        return self.subject.bounds()

    def draw(self, scene: Scene, view: View | list[View], **settings) -> np.ndarray:
        """(H, W, 4) float32 premultiplied, a copy; of several views the first."""
        views = [view] if isinstance(view, View) else view
        self.renderer.settings = RenderSettings(background=self.background, **settings)
        self.renderer.update(scene)
        self.stats = self.renderer.draw(views)
        return np.array(self.renderer.image(0))

    def draw_all(self, scene: Scene, views: list[View], **settings) -> list[np.ndarray]:
        """The images of every view."""
        first = self.draw(scene, views, **settings)
        return [first, *(np.array(self.renderer.image(i)) for i in range(1, len(views)))]

    def shown(self) -> np.ndarray:
        """(H, W, 3) of the last frame as a person sees it: palette and background applied."""
        return np.array(self.renderer.resolved(0))

    def reference(self, scene: Scene, view: View, eye: np.ndarray | None = None) -> np.ndarray:
        """(H, W, 4) of the float64 oracle at the settings of the last frame."""
        return reference_image(scene, view, self.renderer.settings, eye)

    def panel(self, caption: str, image: np.ndarray) -> Panel:
        """A premultiplied picture over the background."""
        rgb = image[..., :3] + (1 - image[..., 3:]) * np.array(self.background, np.float32)
        return Panel(caption, rgb)

    def make_current(self) -> None:
        """Takes GL back after other contexts were made and closed."""
        if self.ctx is not None:
            self.ctx.__enter__()

    def cpu_ms(self, scene: Scene, view: View, count: int = 3) -> float:
        """Process time of a frame, the least of a few: other load on the machine only adds."""
        self.draw(scene, view)
        times = []
        for _ in range(count):
            start = time.process_time()
            self.renderer.draw([view])
            if self.ctx is not None:
                self.ctx.finish()
            times.append((time.process_time() - start) * 1e3)
        return min(times)


def turned_about(view: View, point: np.ndarray, degrees: float, axis: tuple = (0, 1, 0)) -> View:
    """The view carried around a point (3,) of the world, about an axis; left is positive."""
    half = np.radians(degrees) / 2
    turn = Pose(np.zeros(3), np.array([np.cos(half), *(np.sin(half) * np.asarray(axis, float))]))
    matrix = turn.matrix() @ view.world_from_eye.matrix()
    rotation = turn.matrix()[:3, :3]
    matrix[:3, 3] = point + rotation @ (np.asarray(view.world_from_eye.position) - point)
    return replace(view, world_from_eye=Pose.from_matrix(matrix))


def turned(view: View, degrees: float) -> View:
    """The same eye after its head has turned about the eye's own up."""
    up = view.world_from_eye.matrix()[:3, 1]
    return turned_about(view, np.asarray(view.world_from_eye.position), degrees, tuple(up))


def moved(view: View, by: np.ndarray) -> View:
    """The view shifted by (3,) metres of the world."""
    pose = view.world_from_eye
    return replace(view, world_from_eye=Pose(np.asarray(pose.position) + by, pose.wxyz))


def difference(a: np.ndarray, b: np.ndarray, gain: float = 8.0) -> np.ndarray:
    """(H, W, 3) of how two pictures differ, `gain` times as bright."""
    return np.clip(np.abs(np.asarray(a, np.float64)[..., :3] - b[..., :3]) * gain, 0, 1)
