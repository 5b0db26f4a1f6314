"""Where to stand: robust bounds of splats, and the views that show them."""

from collections.abc import Sequence

import numpy as np

from shapeshift.runtime_models.model import Model, SplatLayers
from shapeshift.runtime_models.parts import (
    FALLBACK_RADIUS,
    PERCENTILES,
    frame_points,
    seen_points,
)
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.scene.scene import Scene

FOV_Y = 0.8  # radians, vertical
ELEVATION = 0.3  # radians above the horizon: slightly down
MARGIN = 1.08  # of the distance at which the bounding sphere just fits
ROUND_ENOUGH = 1.3  # length over depth below which no side is the long one
OUTLYING = 1.25  # times the distance for 98 % of the splats: more only floaters ask for
COMMON = 0.5  # mean length of the cameras' directions: of a full circle 0, of a half one 0.64
FAR_RADII = 200.0
NEAR_RADII = 0.01
MOMENTS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of what moves in time


def fit_distance(radius: float, size: tuple[int, int], fov_y: float = FOV_Y) -> float:
    """Metres from which a sphere of that radius fits the narrower side of a size (W, H)."""
    _, right, _, up = perspective(fov_y, size)
    return MARGIN * radius / float(np.sin(np.arctan(min(right, up))))


def fit_points(
    means: np.ndarray,
    opacity: np.ndarray,
    centre: np.ndarray,
    world_from_eye: np.ndarray,
    tangents: tuple[float, float, float, float],
) -> float:
    """Metres from the centre, seen along the axes of (4, 4), at which the splats fill the picture.

    Tighter than `fit_distance` for what is long or flat.  All splats are in the picture unless the
    last few would need a much larger distance: those are floaters.
    """
    points = seen_points(means, opacity)
    if not len(points):
        return MARGIN * FALLBACK_RADIUS / min(tangents[1], tangents[3])
    in_eye = (points - centre) @ world_from_eye[:3, :3]  # (P, 3) right, up, towards the eye
    half = np.minimum([tangents[1], tangents[3]], [-tangents[0], -tangents[2]])
    needed = in_eye[:, 2] + np.max(MARGIN * np.abs(in_eye[:, :2]) / half, axis=1)
    return float(min(needed.max(), OUTLYING * np.percentile(needed, PERCENTILES[1])))


def broadside(means: np.ndarray, opacity: np.ndarray) -> float:
    """Turn about +Y, radians from +Z, from which long content is seen from its long side.

    0 for what is about as deep as it is wide, else in -pi/2..pi/2: the side towards +Z.
    """
    points = seen_points(means, opacity)[:, [2, 0]]  # (P, 2) z, x
    if len(points) < 3:
        return 0.0
    square, axes = np.linalg.eigh(np.cov(points.T))
    if not square[1] > ROUND_ENOUGH**2 * square[0]:
        return 0.0
    z, x = axes[:, 0]  # the direction in which the content is thinnest
    return float(np.arctan2(x, z) if z > 0 else np.arctan2(-x, -z))


def view_from(
    eye: np.ndarray,
    target: np.ndarray,
    radius: float,
    size: tuple[int, int],
    fov_y: float = FOV_Y,
) -> View:
    """The view of an eye (3,) on a target (3,), depth range chosen for content of that radius."""
    near, far = NEAR_RADII * radius, FAR_RADII * radius
    return View(look_at(eye, target), perspective(fov_y, size), near, far, size)


def orbit_path(
    count: int,
    centre: np.ndarray,
    radius: float,
    size: tuple[int, int],
    fov_y: float = FOV_Y,
    elevation: float = ELEVATION,
    distance: float | None = None,
    start: float = 0.0,
) -> list[View]:
    """`count` views on a level circle about the centre, counter-clockwise seen from above.

    The first is `start` radians from +Z.  The distance in metres is the one that fits the sphere
    of `radius` unless it is given.
    """
    if distance is None:
        distance = fit_distance(radius, size, fov_y)
    turn = start + 2 * np.pi * np.arange(count) / max(count, 1)
    direction = np.stack(
        [
            np.sin(turn) * np.cos(elevation),
            np.full(count, np.sin(elevation)),
            np.cos(turn) * np.cos(elevation),
        ],
        axis=1,
    )  # (count, 3) unit, from the centre to the eye
    eyes = np.asarray(centre, np.float64) + distance * direction
    return [view_from(eye, centre, radius, size, fov_y) for eye in eyes]


def model_points(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) and opacity (N,) that stand for a model without decoding it."""
    if isinstance(model, SplatLayers) and model.motion is not None:
        given = model.means, model.wxyz, model.opacity
        moments = [model.motion.at(*given, time) for time in MOMENTS]
        return np.concatenate([m[0] for m in moments]), np.concatenate([m[2] for m in moments])
    if isinstance(model, SplatLayers):
        return model.means, model.opacity
    return model.anchors, np.ones(len(model.anchors), np.float32)


def scene_points(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """World points (N, 3) and opacity (N,) of the visible objects of a scene."""
    means, opacities = [np.zeros((0, 3))], [np.zeros(0)]
    for item in scene.objects:
        if item.visible:
            points, opacity = model_points(item.model)
            world_from_object = item.world_from_object.matrix()
            means.append(points @ world_from_object[:3, :3].T + world_from_object[:3, 3])
            opacities.append(opacity)
    return np.concatenate(means), np.concatenate(opacities)


def distances_from(points: tuple[np.ndarray, np.ndarray], view: View) -> np.ndarray:
    """(n,) metres from an eye to the splats that are there; points: means (N, 3) and opacities."""
    means, opacity = points
    there = means[np.isfinite(means).all(axis=1) & (opacity > 0)]
    return np.linalg.norm(there - view.world_from_eye.position, axis=1)


def common_side(views: Sequence[View]) -> float | None:
    """The side from which cameras look, radians about +Y from +Z; None where they look from all.

    The mean of their directions over the ground, where it is longer than COMMON: photos of one
    side of an object say which side is its front.
    """
    ahead = np.array([-view.world_from_eye.matrix()[:3, 2] for view in views]).reshape(-1, 3)
    level = ahead[:, [0, 2]]  # (V, 2) x, z
    length = np.linalg.norm(level, axis=1)
    level = level[length > 1e-6] / length[length > 1e-6, None]
    if not len(level):
        return None
    x, z = -level.mean(axis=0)
    return float(np.arctan2(x, z)) if np.hypot(x, z) > COMMON else None


def framing_view(
    means: np.ndarray, opacity: np.ndarray, size: tuple[int, int], start: float | None = None
) -> View:
    """The view that shows splats whole and slightly from above.

    From `start`, radians about +Y from +Z; where nobody knows, from their long side.
    """
    centre, radius = frame_points(means, opacity)
    start = broadside(means, opacity) if start is None else start
    view = orbit_path(1, centre, radius, size, start=start)[0]
    axes = view.world_from_eye.matrix()
    distance = fit_points(means, opacity, centre, axes, view.tangents)
    if not distance > NEAR_RADII * radius:  # all in one place
        distance = fit_distance(radius, size)
    return orbit_path(1, centre, radius, size, distance=distance, start=start)[0]


def default_view(model: Model, size: tuple[int, int]) -> View:
    """The first look at a model: provenance["view"] where it has one, else `framing_view`.

    provenance["view"] is {"eye": [x, y, z], "target": [x, y, z], "fov_y": radians}, metres in the
    object frame, fov_y optional.
    """
    stated = model.provenance.get("view")
    if stated:
        _, radius = frame_points(*model_points(model))
        eye, target = np.asarray(stated["eye"], float), np.asarray(stated["target"], float)
        return view_from(eye, target, radius, size, float(stated.get("fov_y", FOV_Y)))
    return framing_view(*model_points(model), size)


def default_background(
    model: Model, otherwise: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Display sRGB of provenance["background"], what the photos stood before, or `otherwise`."""
    found = model.provenance.get("background")
    if not (isinstance(found, list | tuple) and len(found) == 3):
        return otherwise
    if not all(isinstance(c, int | float) and 0 <= c <= 1 for c in found):
        return otherwise
    return three(found)
