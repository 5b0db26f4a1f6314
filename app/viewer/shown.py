"""The picture of the scene in the window: drawn when something changed, sorted anew at rest."""

from dataclasses import dataclass, replace

import moderngl

from shapeshift.app.charts.comparison import Comparison, is_exact, measure_error, same_picture
from shapeshift.app.viewer.readings import Readings
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene

STALE_S = 1.0  # between two measurements of the error of a kept order: each draws a frame more


@dataclass(frozen=True)
class Wish:
    """What is to be on the screen."""

    scene: Scene
    view: View
    settings: RenderSettings
    moving: bool  # camera or control value: more frames will follow at once


class Shown:
    """Keeps the splats on the screen up to date, and measures what their setting costs."""

    def __init__(self, renderer: Renderer, readings: Readings) -> None:
        self._renderer, self._readings = renderer, readings
        self._comparison = Comparison()
        self._drawn: tuple | None = None  # what the splats on screen were drawn from
        self._stale_when = 0.0

    def draw(self, wish: Wish, screen: moderngl.Framebuffer, force: bool) -> bool:
        """Fills the screen; True when the splats had to be drawn anew."""
        settings = wish.settings if wish.moving else rested(wish.settings)
        wanted = picture_key(wish.scene, wish.view, settings)
        self._renderer.settings = settings
        fresh = force or not same_picture(self._drawn, wanted)
        if fresh:
            self._renderer.update(wish.scene)
            self._readings.stats = self._renderer.draw([wish.view], screen)
            self._drawn = wanted
        else:
            self._renderer.present(screen)
        return fresh

    def forget(self) -> None:
        """The renderer has drawn something else meanwhile."""
        self._drawn = None

    def due(self, wish: Wish, now: float) -> bool:
        """Whether the picture has rested long enough to be compared with the exact one."""
        if is_exact(wish.settings, self._readings.drawing):
            return False
        return self._comparison.due(comparison_key(wish), now, wish.moving)

    def measure(self, wish: Wish) -> None:
        """Compares with the exact picture now, in two frames that are not shown."""
        self._renderer.update(wish.scene)
        db = measure_error(self._renderer, wish.view, rested(wish.settings))
        self._comparison.measured(comparison_key(wish), db)
        self.forget()

    def read(self, wish: Wish, now: float) -> None:
        """Puts into the readings what is known about the picture on the screen."""
        readings = self._readings
        readings.error_db = self._comparison.db
        readings.error_is_old = self._comparison.is_old(comparison_key(wish))
        if not keeps_order(wish.settings):
            readings.stale_db = None
        elif readings.stats.order_age and now - self._stale_when >= STALE_S:
            readings.stale_db = self._renderer.stale_order_db([wish.view])
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


def comparison_key(wish: Wish) -> tuple:
    """The picture at rest, without its debug view."""
    return picture_key(wish.scene, wish.view, replace(rested(wish.settings), debug=""))
