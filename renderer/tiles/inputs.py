"""Views, limits and backgrounds as rasterizer/ takes them."""

from shapeshift.rasterizer.project import Camera
from shapeshift.rasterizer.project_arena import Limits
from shapeshift.rasterizer.resolve import Behind
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import Background, Color, Sky, up_of_eye
from shapeshift.scene.pose import View


def behind(background: Background, view: View) -> Behind | Color:
    """One colour, or a sky as a view sees it."""
    if not isinstance(background, Sky):
        return background
    colors = (background.zenith, background.horizon, background.ground)
    return Behind(colors, up_of_eye(view), view.tangents)


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
