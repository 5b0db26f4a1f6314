"""Where a picture is drawn sharp: around what the eye looks at, out to an angle by level.

Beyond it every pixel is made of the samples of a quarter as many, with a soft seam between.
"""

import math
from collections.abc import Sequence

from shapeshift.rasterizer.fovea.fovea import Fovea
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View

RADIUS_DEGREES = {"low": 35.0, "medium": 25.0, "high": 15.0}
SEAM = 1.15  # radius where the seam ends, over that where it begins
WIDEST_DEGREES = 85.0  # from straight on: beyond, tangents say little


def foveas_of(views: Sequence[View], settings: RenderSettings) -> list[Fovea]:
    """Of every view; none where nothing would be coarse, and of debug pictures."""
    if settings.foveation == "off" or settings.debug:
        return []
    foveas = [fovea_of(view, settings.foveation) for view in views]
    pairs = zip(foveas, views, strict=True)
    return foveas if any(fovea.kinds_of_tiles(view.size).any() for fovea, view in pairs) else []


def fovea_of(view: View, level: str) -> Fovea:
    """The circle in tangents about the gaze; towards the edge of a view an angle is a longer way
    there, and the circle grows so that none is less than the level's.
    """
    left, right, down, up = view.tangents
    width, height = view.size
    x, y = view.gaze or (0.0, 0.0)
    aside, radius = math.atan(math.hypot(x, y)), math.radians(RADIUS_DEGREES[level])
    edge = min(aside + radius, math.radians(WIDEST_DEGREES))
    inner = math.tan(edge) - math.tan(edge - radius)
    unit = (right - left) / width, (up - down) / height
    return Fovea(((x - left) / unit[0], (up - y) / unit[1]), unit, inner, SEAM * inner)
