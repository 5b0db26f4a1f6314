"""Measures views in a session: values and depths, by a renderer of its own, made when first asked.

The eyes' renderer keeps what it has decoded; the measured stop takes its memory beside it.
"""

from dataclasses import dataclass

import moderngl
import numpy as np

from shapeshift.app.inspection.draw_values import ThermalScene, depth_picture, draw_values
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene
from shapeshift.vr.frame import FAR_M, NEAR_M
from shapeshift.vr.locomotion.play_space import PlaySpace

RAY_PX, RAY_TANGENT = 17, 0.012  # of the small picture around a ray: pixels of 1.4 mrad
WIDE_PX, WIDE_TANGENT = 480, 1.0  # of what the head sees: 90 degrees


@dataclass
class Probe:
    """Of one context; it draws as the eyes' renderer does."""

    ctx: moderngl.Context
    eyes: Renderer | None = None
    _renderer: Renderer | None = None

    def measure(self, thermal: ThermalScene | None, scene: Scene, view: View) -> ValuePicture:
        """Values and depths, or depths alone where nothing is thermal.  Raises BadFile where there
        is no room for it.
        """
        if self._renderer is None:
            drawing = self.eyes.backends["drawing"].split(" ")[0] if self.eyes else "auto"
            self._renderer = Renderer(self.ctx, drawing)
        bound = self.ctx.fbo
        try:
            if thermal is None:
                return depth_picture(self._renderer, scene, view)
            return draw_values(self._renderer, thermal, view)
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


def before_head(head: Pose, play_space: PlaySpace) -> View:
    """What a head of the room has before it."""
    tangents = (-WIDE_TANGENT, WIDE_TANGENT, -WIDE_TANGENT, WIDE_TANGENT)
    return play_space.view(View(head, tangents, NEAR_M, FAR_M, (WIDE_PX, WIDE_PX)))


def middle_of(picture: ValuePicture) -> tuple[float, float, np.ndarray]:
    """Value, metres along the ray and place (3,) of the world under the middle; NaN for nothing."""
    width, height = picture.view.size
    at = np.array([[width / 2, height / 2]])
    value, metres = (float(picture.at(f, at)[0]) for f in (picture.values, picture.depth_m))
    return value, metres, picture.pick((width / 2, height / 2))
