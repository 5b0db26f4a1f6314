"""Scenes, limits and thresholds of the culls, for either drawing."""

from dataclasses import replace

import numpy as np

from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene
from tests.support.models import make_random_model
from tests.support.splat_scenes import (
    alone,
    one_splat,
    random_layers,
    two_objects,
)

FRONT = View(Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), (-1, 1, -0.5, 0.5), 0.1, 100, (200, 100))
SHARP = RenderSettings(low_pass=0.0)
LIMITS = {
    "none": RenderSettings(),
    "distance": RenderSettings(max_distance=4.0),
    "size": RenderSettings(max_pixels=4.0),
    "footprint": RenderSettings(min_pixels=3.0),
    "all hard": RenderSettings(max_pixels=6.0, max_distance=4.4, min_pixels=2.0, min_alpha=0.05),
    "all soft": RenderSettings(
        max_pixels=6.0, max_distance=4.4, min_pixels=2.0, min_alpha=0.05, fade=0.4
    ),
    "soft without limits": RenderSettings(fade=0.5),
    "nothing": RenderSettings(max_pixels=0.0, max_distance=0.0),
}
SCENES = {
    "cloud": lambda: alone(random_layers(3000, seed=1)),
    "two objects": lambda: two_objects(2400),
    "anchors": lambda: alone(make_random_model(200, k=5), x=0.4),
    "one hidden": lambda: Scene((replace(two_objects(900).objects[0], visible=False),
                                 two_objects(900).objects[1])),
    "empty": lambda: Scene(()),
}  # fmt: skip


def around(value: float) -> np.ndarray:
    """The float32 below, at and above a value."""
    at = np.float32(value)
    return np.array([np.nextafter(at, -np.inf), at, np.nextafter(at, np.inf)], np.float32)


def row_of(places: np.ndarray, scales: np.ndarray | float, opacity: np.ndarray | float):
    n = len(places)
    return one_splat(
        means=places, scales=np.broadcast_to(np.reshape(scales, (-1, 1)), (n, 3)),
        wxyz=np.tile([1, 0, 0, 0], (n, 1)), opacity=np.broadcast_to(opacity, n),
        sh=np.zeros((n, 1, 3)),
    )  # fmt: skip


AHEAD = np.tile([0.0, 0.0, -2.0], (3, 1))  # one metre is 50 pixels there
THRESHOLDS = {
    # name: (layers below, at and above the limit; settings; reasons wanted)
    "opacity 1/255": (row_of(AHEAD, 0.01, around(1 / 255)), RenderSettings(),
                      "opacity drawn drawn"),
    "opacity 0.7": (
        row_of(AHEAD, 0.01, around(0.7)), RenderSettings(min_alpha=0.7), "opacity drawn drawn",
    ),
    "distance": (
        row_of(np.outer(around(4.0), [0, 0, -1]), 0.01, 0.5), RenderSettings(max_distance=4),
        "drawn drawn distance",
    ),
    "distance aside": (  # 3, 4 and 5: exact
        row_of(np.outer(around(1.0), [3, 0, -4]), 0.01, 0.5), RenderSettings(max_distance=5),
        "drawn drawn distance",
    ),
    "near": (row_of(np.outer(around(0.1), [0, 0, -1]), 1e-4, 0.5), RenderSettings(),
             "frustum frustum drawn"),
    "size": (row_of(AHEAD, around(0.125), 0.5), replace(SHARP, max_pixels=6.25),
             "drawn drawn size"),
    "footprint of nothing": (row_of(AHEAD, 0.01, 1 / 255), RenderSettings(min_pixels=0.0),
                             "drawn drawn drawn"),
    "faded at its end": (row_of(AHEAD, around(0.125), 0.5),
                         replace(SHARP, max_pixels=6.25, fade=0.5), "faded faded size"),
}  # fmt: skip
