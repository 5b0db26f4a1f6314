"""Where a picture is drawn sharp: around what the eye looks at, out to an angle by level.

Beyond it every pixel is made of the samples of a quarter as many, with a soft seam between.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from shapeshift.rasterizer.foveate import Fovea
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import HiddenMesh, View
from shapeshift.scene.scene import IDENTITY

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


# Where nobody looks: pixels of a headset's eye that its lens does not show, and tiles of them.


def hidden_pixels(view: View) -> np.ndarray:
    """(H, W) bool, row 0 on top: pixels whose centre lies in a triangle of the view's mesh."""
    width, height = view.size
    found = np.zeros((height, width), bool)
    if view.hidden is None:
        return found
    left, right, down, up = view.tangents
    across, along = (right - left) / width, (up - down) / height  # tangents a pixel
    corners = (view.hidden.triangles - (left, up)) / (across, -along)  # (T, 3, 2) pixels
    for triangle in corners:
        low = np.floor(np.clip(triangle.min(0), 0, view.size)).astype(int)
        high = np.ceil(np.clip(triangle.max(0), 0, view.size)).astype(int)
        x = np.arange(low[0], high[0])[None] + 0.5
        y = np.arange(low[1], high[1])[:, None] + 0.5
        sides = [
            (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
            for a, b in zip(triangle, np.roll(triangle, -1, 0), strict=True)
        ]
        within = np.all([side >= 0 for side in sides], 0) | np.all([s <= 0 for s in sides], 0)
        found[low[1] : high[1], low[0] : high[0]] |= within
    return found


def hidden_tiles(view: View, side: int) -> np.ndarray | None:
    """(rows, columns) bool of the tiles, `side` pixels long, all of whose pixels are hidden; None
    where none is.
    """
    return None if view.hidden is None else _tiles(view.hidden, view.tangents, view.size, side)


@lru_cache(maxsize=16)
def _tiles(
    mesh: HiddenMesh, tangents: tuple[float, float, float, float], size: tuple[int, int], side: int
) -> np.ndarray | None:
    """Of a view that is told by these alone: a mesh is itself, and stays for a session."""
    view = View(IDENTITY, tangents, 0.1, 1.0, size, hidden=mesh)
    hidden = hidden_pixels(view)
    rows, columns = (-(-n // side) for n in hidden.shape)
    padded = np.ones((rows * side, columns * side), bool)
    padded[: hidden.shape[0], : hidden.shape[1]] = hidden
    tiles: np.ndarray = np.all(padded.reshape(rows, side, columns, side), axis=(1, 3))
    return tiles if tiles.any() else None
