"""Scenes with thermal stops, and which picture they must give."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import Sphere
from tests.support.models import make_random_model, without_control
from tests.support.splat_scenes import front_view

VIEW = front_view((96, 72), distance=3.0)
STOPS = (
    Stop("RGB", 0.0), Stop("Hot", 0.5, "thermal", "ironbow"), Stop("Open", 0.8),
    Stop("Hotter", 1.0, "thermal", "turbo"),
)  # fmt: skip
BEHIND = (0.2, 0.1, 0.05)


def model(count: int = 60, *names: str, **changes):
    """Of networks; those named do not see the control."""
    return replace(without_control(make_random_model(count, k=3), *names), stops=STOPS, **changes)


def scene_of(model, **changes) -> Scene:
    return Scene((SceneObject("thing", model, **changes),))


def decoded(count: int, seed: int = 0) -> np.ndarray:
    color = np.random.default_rng(seed).uniform(-0.1, 1.3, (count, 3))
    color[0, 1] = np.nan
    return color.astype(np.float32)


CASES = {
    "a way": {"x": 0.2}, "near its end": {"x": 0.49}, "two palettes": {"x": 0.9},
    "three stops": {"x": StopWeights((("RGB", 0.3), ("Hot", 0.3), ("Open", 0.4)))},
    "three stops, two palettes": {
        "x": StopWeights((("RGB", 0.3), ("Hot", 0.3), ("Hotter", 0.4))),
    },
    "a region": {"selectors": (Sphere(centre=(0, 0, 0), radius=0.5, border=0.3, x=0.5),)},
    "a region of two": {
        "x": 0.5, "selectors": (Sphere(centre=(0, 0, 0), radius=0.5, border=0.3, x=1.0),),
    },
}  # fmt: skip
