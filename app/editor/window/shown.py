"""The picture of the scene in the window: drawn when something changed, sorted anew at rest."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import moderngl

from shapeshift.app.charts.comparison import Comparison, is_exact, measure_error, same_picture
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.renderer.colors.decode_colors import same_shape
from shapeshift.renderer.colors.palette import ALL_VALUES
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene

STALE_S = 1.0  # between two measurements of the error of a kept order: each draws a frame more


@dataclass(frozen=True)
class RightSide:
    """What is shown right of a line instead."""

    scene: Scene
    cut: int  # the first column that shows it
    renderer: Renderer  # that draws it where it is of another shape
    refuse: Callable[[BadFile], None]  # called where there is no room for that


@dataclass(frozen=True)
class FrameRequest:
    """What is to be on the screen."""

    scene: Scene
    view: View
    settings: RenderSettings
    moving: bool  # camera or control value: more frames will follow at once
    beside: RightSide | None = None  # None: the scene is shown in all of the window


class Shown:
    """Keeps the splats on the screen up to date, and measures what their setting costs."""

    def __init__(self, renderer: Renderer, readings: FrameStatsView) -> None:
        self._renderer, self._readings = renderer, readings
        self._comparison = Comparison()
        self._drawn: tuple | None = None  # what the splats on screen were drawn from
        self._kept: Scene | None = None  # whose id is part of that
        self._presented: tuple = ()  # how the splats were last put on the screen
        self._stale_when = 0.0

    def draw(
        self, request: FrameRequest, screen: moderngl.Framebuffer, force: bool,
        again: Callable[[], bool] = lambda: False,
    ) -> bool:  # fmt: skip
        """Fills the screen; True when the splats had to be drawn anew.

        again: fills it with the last picture, where that was kept, and says whether it did.
        """
        settings = request.settings if request.moving else rested(request.settings)
        wanted = picture_key(request.scene, request.view, settings)
        self._renderer.settings = settings
        if request.beside is not None:
            return self._draw_two(request, request.beside, wanted, screen, force, again)
        fresh = force or self._renderer.streaming.due or not same_picture(self._drawn, wanted)
        if fresh:
            self._renderer.update(request.scene)
            self._readings.stats = self._renderer.draw([request.view], screen)
            self._drawn = wanted
        elif not (self._presented == (settings, None) and again()):
            self._renderer.present(screen)
        self._presented = (settings, None)
        return fresh

    def _draw_two(
        self, request: FrameRequest, beside: RightSide, key: tuple, screen: moderngl.Framebuffer,
        force: bool, again: Callable[[], bool],
    ) -> bool:  # fmt: skip
        """Each side of the line in its part of the screen and no more of it; both from one sort
        where nothing but colours differs.
        """
        renderer, (width, height) = self._renderer, request.view.size
        parts = (
            request.view.part(0, 0, (beside.cut, height)),
            request.view.part(beside.cut, 0, (width - beside.cut, height)),
        )
        wanted = (*key, id(beside.scene), beside.cut)
        fresh = force or not same_picture(self._drawn, wanted)
        together = same_shape(request.scene, beside.scene)
        right = renderer if together else beside.renderer
        right.settings = renderer.settings
        if fresh:
            renderer.update(request.scene)
            if together:
                self._readings.stats = renderer.draw_two(parts, beside.scene)
            else:
                self._readings.stats = renderer.draw([parts[0]])
                try:
                    right.update(beside.scene)
                except BadFile as error:
                    beside.refuse(error)
                    return self.draw(replace(request, beside=None), screen, True)
                right.draw([parts[1]])
            self._drawn, self._kept = wanted, beside.scene
        presented = (renderer.settings, beside.cut)
        if not fresh and self._presented == presented and again():
            return False
        self._presented = presented
        whole = screen.viewport
        screen.viewport = (0, 0, beside.cut, height)
        renderer.present(screen, 0)
        screen.viewport = (beside.cut, 0, width - beside.cut, height)
        right.present(screen, int(together))
        screen.viewport = whole
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
    """What a picture depends on, the scene first; the background and the ends of a palette, which
    come in as it is presented, need no splats.
    """
    pose = view.world_from_eye
    quality = replace(settings, background=(0.0, 0.0, 0.0), heat_ends=ALL_VALUES)
    return (
        scene, pose.position.tobytes(), pose.wxyz.tobytes(), view.tangents, view.whole, view.size,
        quality,
    )  # fmt: skip


def comparison_key(request: FrameRequest) -> tuple:
    """The picture at rest, without its debug view."""
    return picture_key(request.scene, request.view, replace(rested(request.settings), debug=""))
