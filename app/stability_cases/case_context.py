"""Where the cases of `launch.py stability` take place (one scene, one renderer, and the moves), and
what they find.
"""

import math
import time
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import moderngl
import numpy as np

from shapeshift.app.document import Document
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import IDENTITY, Scene

EMPTY = Scene(())


# What a case finds: figures with their bounds, and panels to look at.

MOST_DB = 200.0  # for pictures that are equal: a table has no infinity
ALPHA_SLACK = 2e-3  # of a coverage summed in half floats: two steps of theirs below 1


@dataclass(frozen=True)
class CaseFinding:
    """One row of the table."""

    figure: str  # what was measured, with its unit
    measured: float
    bound: str  # ">= 40", "<= 2"; "" where the case says nothing about this scene
    holds: bool
    reason: str  # why the bound is where it is

    @property
    def verdict(self) -> str:
        if not self.bound:
            return "does not apply"
        return "holds" if self.holds else "FAILS"

    @property
    def headroom(self) -> float:
        """How far inside its bound, as a part of it; below 0 where it fails, NaN the furthest."""
        if not self.bound:
            return math.inf
        sign, limit = self.bound.split()
        inside = (self.measured - float(limit)) * (1 if sign == ">=" else -1)
        return -math.inf if math.isnan(inside) else inside / max(abs(float(limit)), 1e-9)


@dataclass(frozen=True)
class Panel:
    """A picture with its caption; the first of a case is its worst frame."""

    caption: str
    image: np.ndarray  # (H, W, 3) display sRGB


class ComparedPicture(NamedTuple):
    """A picture and what it was held against; a case shows its worst one."""

    db: float
    what: str
    image: np.ndarray  # (H, W, 4)
    wanted: np.ndarray  # (H, W, 4)


def worst_of(comparisons: Iterable[ComparedPicture]) -> ComparedPicture:
    """The one of the fewest decibels; of equal ones the first."""
    return min(comparisons, key=lambda comparison: comparison.db)


@dataclass(frozen=True)
class Result:
    findings: list[CaseFinding]
    panels: list[Panel]


def at_least(figure: str, measured: float, least: float, reason: str) -> CaseFinding:
    return CaseFinding(figure, float(measured), f">= {least:.4g}", bool(measured >= least), reason)


def at_most(figure: str, measured: float, most: float, reason: str) -> CaseFinding:
    return CaseFinding(figure, float(measured), f"<= {most:.4g}", bool(measured <= most), reason)


def not_here(figure: str, reason: str) -> CaseFinding:
    """The row of a figure that this scene or this machine does not have."""
    return CaseFinding(figure, math.nan, "", True, reason)


def decibels(image: np.ndarray, reference: np.ndarray) -> float:
    """PSNR against a peak of 1, MOST_DB where both are equal; NaN in a picture gives NaN."""
    error = float(np.mean((np.asarray(image, np.float64) - reference) ** 2))
    return MOST_DB if error == 0 else min(-10 * math.log10(error), MOST_DB)


def broken_pixels(*images: np.ndarray) -> int:
    """How many pixels of (H, W, 4) images hold NaN, Inf, or a coverage that is none."""
    return sum(
        int(np.count_nonzero(~(np.isfinite(image).all(axis=2) & covered(image[..., 3]))))
        for image in images
    )


def covered(alpha: np.ndarray) -> np.ndarray:
    return (alpha >= 0) & (alpha <= 1 + ALPHA_SLACK)


def clean(*images: np.ndarray) -> CaseFinding:
    """No pixel that is no colour; every case asks for it."""
    return at_most(
        "broken pixels (not finite, or not covered 0 to 1)", broken_pixels(*images), 0,
        "a NaN stays in a float target for good, and coverage is 0 to 1 (half floats: +0.002)",
    )  # fmt: skip


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
