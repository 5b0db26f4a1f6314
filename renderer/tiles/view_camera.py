"""A view, and the culls of the settings, as the passes of rasterizer/ have them."""

from shapeshift.rasterizer.project import Camera
from shapeshift.rasterizer.project_arena import Limits
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View


def camera_of(view: View) -> Camera:
    """The view as rasterizer/ takes it."""
    return Camera(*view.pinhole(), view.size, view.near, view.widest_tangents())


def limits_of(settings: RenderSettings) -> Limits:
    """The culls of the settings as projection takes them."""
    return Limits(
        settings.min_alpha,
        settings.max_pixels,
        settings.max_distance,
        settings.min_pixels,
        settings.fade,
        settings.low_pass,
    )
