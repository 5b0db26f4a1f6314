"""Measures views in a session: values and depths, by a renderer of its own, made when first asked.

The eyes' renderer keeps what it has decoded; the measured stop takes its memory beside it.
"""

from dataclasses import dataclass

import moderngl
import numpy as np

from shapeshift.app.document import DARK, Document
from shapeshift.app.inspection.draw_values import MeasuredScene, depth_picture, draw_values
from shapeshift.app.inspection.inspect_view import InspectedView, first_photo, inspect_view
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene
from shapeshift.vr.frame import FAR_M, NEAR_M
from shapeshift.vr.play_space import PlaySpace

RAY_PX, RAY_TANGENT = 17, 0.012  # of the small picture around a ray: pixels of 1.4 mrad
WIDE_PX, WIDE_TANGENT = 480, 1.0  # of what the head sees: 90 degrees
REPORT_PX = 1024  # of a report's pictures


@dataclass
class Probe:
    """Of one context; it draws as the eyes' renderer does."""

    ctx: moderngl.Context
    eyes: Renderer | None = None
    _renderer: Renderer | None = None

    def inspect(self, document: Document, measured: MeasuredScene, view: View) -> InspectedView:
        """A view for a report: values, and the first stop that is not thermal beside them.  Raises
        BadFile where there is no room for it.
        """
        renderer, bound = self._opened(), self.ctx.fbo
        before = renderer.settings
        try:
            renderer.settings = RenderSettings(background=document.background_or(DARK))
            return inspect_view(renderer, document, measured, first_photo(document, measured), view)
        finally:
            renderer.settings = before
            if bound is not None:
                bound.use()

    def _opened(self) -> Renderer:
        if self._renderer is None:
            drawing = self.eyes.backends["drawing"].split(" ")[0] if self.eyes else "auto"
            self._renderer = Renderer(self.ctx, drawing)
        return self._renderer

    def measure(self, measured: MeasuredScene | None, scene: Scene, view: View) -> ValuePicture:
        """Values and depths, or depths alone where nothing is thermal.  Raises BadFile where there
        is no room for it.
        """
        renderer, bound = self._opened(), self.ctx.fbo
        try:
            if measured is None:
                return depth_picture(renderer, scene, view)
            return draw_values(renderer, measured, view)
        finally:
            if bound is not None:
                bound.use()

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def along_ray(aim: Pose, play_space: PlaySpace) -> View:
    """The view around a ray of the room; its middle pixel is the ray's."""
    tangents = (-RAY_TANGENT, RAY_TANGENT, -RAY_TANGENT, RAY_TANGENT)
    return play_space.view(View(aim, tangents, NEAR_M, FAR_M, (RAY_PX, RAY_PX)))


def before_head(head: Pose, play_space: PlaySpace, side_px: int = WIDE_PX) -> View:
    """What a head of the room has before it."""
    tangents = (-WIDE_TANGENT, WIDE_TANGENT, -WIDE_TANGENT, WIDE_TANGENT)
    return play_space.view(View(head, tangents, NEAR_M, FAR_M, (side_px, side_px)))


def middle_of(picture: ValuePicture) -> tuple[float, float, np.ndarray]:
    """Value, metres along the ray and place (3,) of the world under the middle; NaN for nothing."""
    width, height = picture.view.size
    at = np.array([[width / 2, height / 2]])
    value, metres = (float(picture.at(f, at)[0]) for f in (picture.values, picture.depth_m))
    return value, metres, picture.pick((width / 2, height / 2))
