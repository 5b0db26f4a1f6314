"""The picture of the scene in the window: drawn when something changed, sorted anew at rest."""

from dataclasses import dataclass, replace

import moderngl

from shapeshift.app.charts.comparison import Comparison, is_exact, measure_error, same_picture
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene

STALE_S = 1.0  # between two measurements of the error of a kept order: each draws a frame more


@dataclass(frozen=True)
class FrameRequest:
    """What is to be on the screen."""

    scene: Scene
    view: View
    settings: RenderSettings
    moving: bool  # camera or control value: more frames will follow at once


class Shown:
    """Keeps the splats on the screen up to date, and measures what their setting costs."""

    def __init__(self, renderer: Renderer, readings: FrameStatsView) -> None:
        self._renderer, self._readings = renderer, readings
        self._comparison = Comparison()
        self._drawn: tuple | None = None  # what the splats on screen were drawn from
        self._stale_when = 0.0

    def draw(self, request: FrameRequest, screen: moderngl.Framebuffer, force: bool) -> bool:
        """Fills the screen; True when the splats had to be drawn anew."""
        settings = request.settings if request.moving else rested(request.settings)
        wanted = picture_key(request.scene, request.view, settings)
        self._renderer.settings = settings
        fresh = force or not same_picture(self._drawn, wanted)
        if fresh:
            self._renderer.update(request.scene)
            self._readings.stats = self._renderer.draw([request.view], screen)
            self._drawn = wanted
        else:
            self._renderer.present(screen)
        return fresh

    def forget(self) -> None:
        """The renderer has drawn something else meanwhile."""
        self._drawn = None

    def upload(self, scene: Scene) -> None:
        """Gives the device a scene that is to be shown.  Raises BadFile where it does not fit."""
        try:
            self._renderer.update(scene)
        except BadFile:
            self.forget()
            raise

    def due(self, request: FrameRequest, now: float) -> bool:
        """Whether the picture has rested long enough to be compared with the exact one."""
        if is_exact(request.settings, self._readings.drawing):
            return False
        return self._comparison.due(comparison_key(request), now, request.moving)

    def measure(self, request: FrameRequest) -> None:
        """Compares with the exact picture now, in two frames that are not shown."""
        self._renderer.update(request.scene)
        db = measure_error(self._renderer, request.view, rested(request.settings))
        self._comparison.measured(comparison_key(request), db)
        self.forget()

    def read(self, request: FrameRequest, now: float) -> None:
        """Puts into the readings what is known about the picture on the screen."""
        readings = self._readings
        readings.error_db = self._comparison.db
        readings.error_is_old = self._comparison.is_old(comparison_key(request))
        if not keeps_order(request.settings):
            readings.stale_db = None
        elif readings.stats.order_age and now - self._stale_when >= STALE_S:
            readings.stale_db = self._renderer.stale_order_db([request.view])
            self._stale_when = now


def rested(settings: RenderSettings) -> RenderSettings:
    """What is drawn once all is still: nothing is kept that only saves time while moving."""
    return replace(settings, resort_frames=1, resort_degrees=0.0, recolor_degrees=0.0)


def keeps_order(settings: RenderSettings) -> bool:
    return settings.resort_frames != 1


def picture_key(scene: Scene, view: View, settings: RenderSettings) -> tuple:
    """What a picture depends on, the scene first; the background needs no splats."""
    pose = view.world_from_eye
    quality = replace(settings, background=(0.0, 0.0, 0.0))
    return (
        scene, pose.position.tobytes(), pose.wxyz.tobytes(), view.tangents, view.whole, view.size,
        quality,
    )  # fmt: skip


def comparison_key(request: FrameRequest) -> tuple:
    """The picture at rest, without its debug view."""
    return picture_key(request.scene, request.view, replace(rested(request.settings), debug=""))
