"""From where a new stop is looked at while it learns: a dome about the scene, or given cameras."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import AnchorModel
from shapeshift.scene.cameras.framing import (
    FOV_Y,
    default_view,
    fit_distance,
    frame_points,
    orbit_path,
    view_from,
)
from shapeshift.scene.pose import View

GOLDEN = 0.618034  # of a turn between two views: any number of them is spread evenly
LOW, HIGH = 0.05, 0.9  # sines of the dome's elevations: from level to 64 degrees
FAR, NEAR = 1.0, 0.7  # of the distance that shows the whole scene, in turns
ASIDE, ABOVE = 0.9, 0.35  # radians about a known first look, either way, where there is one


def dome_views(model: AnchorModel, count: int, size: tuple[int, int]) -> list[View]:
    """`count` views of the model, spread over a dome about its bounds.

    Of a model that knows a first look (a room, or one side of something) they are spread about it.
    """
    if "view" in model.provenance:
        return views_about(model, count, size)
    centre, radius = frame_points(model.anchors, np.ones(len(model.anchors), np.float32))
    whole = fit_distance(radius, size)
    out = []
    for i in range(count):
        height = LOW + (HIGH - LOW) * ((i + 0.5) * 2**0.5 % 1)
        away = whole * (FAR, NEAR)[i % 2]
        out += orbit_path(
            1, centre, radius, size, elevation=float(np.arcsin(height)), distance=away,
            start=2 * np.pi * (GOLDEN * i % 1),
        )  # fmt: skip
    return out


def views_about(model: AnchorModel, count: int, size: tuple[int, int]) -> list[View]:
    """Views on the target of the model's first look, from about where that one stands."""
    first = default_view(model, size)
    _, radius = frame_points(model.anchors, np.ones(len(model.anchors), np.float32))
    eye = np.array(model.provenance["view"]["eye"], float)
    target = np.array(model.provenance["view"]["target"], float)
    x, y, z = eye - target
    away = float(np.linalg.norm(eye - target))
    azimuth, elevation = np.arctan2(x, z), np.arcsin(np.clip(y / away, -1, 1))
    fov_y = float(model.provenance["view"].get("fov_y", FOV_Y))
    out = [first]
    for i in range(1, count):
        turn = azimuth + ASIDE * (2 * (GOLDEN * i % 1) - 1)
        up = np.clip(elevation + ABOVE * (2 * ((i + 0.5) * 2**0.5 % 1) - 1), -1.4, 1.4)
        direction = np.array([np.sin(turn) * np.cos(up), np.sin(up), np.cos(turn) * np.cos(up)])
        distance = away * (FAR, NEAR)[i % 2]
        out.append(view_from(target + distance * direction, target, radius, size, fov_y))
    return out


def resized_views(views: Sequence[View], longest: int) -> list[View]:
    """The same views in pictures whose longer side has at most so many pixels."""
    out = []
    for view in views:
        width, height = view.size
        factor = min(1.0, longest / max(width, height))
        size = max(round(width * factor), 1), max(round(height * factor), 1)
        out.append(view if size == view.size else view.resized(size))
    return [replace(view) for view in out]
