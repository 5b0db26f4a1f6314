"""What is behind everything, as rasterizer/ takes it."""

from shapeshift.rasterizer.resolve import Behind
from shapeshift.scene.appearance import Background, Color, Sky, up_of_eye
from shapeshift.scene.pose import View


def behind(background: Background, view: View) -> Behind | Color:
    """One colour, or a sky as a view sees it."""
    if not isinstance(background, Sky):
        return background
    colors = (background.zenith, background.horizon, background.ground)
    return Behind(colors, up_of_eye(view), view.tangents)
