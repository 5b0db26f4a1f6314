"""Scenes whose colours look at the eye, seen by two of them."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.pose import Pose, View, look_at, perspective, stereo_pair
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.splat_scenes import alone, one_splat, random_layers, random_model, shell

APART = 0.064  # metres between the eyes of a person
SIZE = (96, 80)
TURNED = Pose(np.array([0.2, -0.1, 0.1]), np.array([0.8, 0.0, 0.6, 0.0]))


def heat(count: int = 400) -> SplatLayers:
    """Harmonics of degree 3 with a thermal stop, so that a palette is laid over part of a scene."""
    layers = random_layers(count, seed=9, coefficients=16)
    return replace(layers, stops=(Stop("rgb", 0.0), Stop("heat", 1.0, "thermal", "ironbow")))


SCENES = {
    "harmonics": lambda: alone(shell(800, 16), world_from_object=TURNED),
    "networks": lambda: alone(random_model(120), x=0.3, world_from_object=TURNED),
    "both": lambda: Scene((
        SceneObject("shell", shell(500, 16)),
        SceneObject("networks", random_model(60), TURNED, 0.6),
        SceneObject("hidden", random_layers(100), visible=False),
    )),
    "tinted": lambda: Scene((
        SceneObject("heat", heat(), x=0.7), SceneObject("networks", random_model(60), TURNED, 0.6),
    )),
    "one splat": lambda: alone(one_splat(sh=np.full((1, 16, 3), 0.3))),
    "nothing": lambda: alone(random_layers(0)),
}  # fmt: skip


def eyes(apart: float = APART, away: float = 1.8, **lens) -> list[View]:
    pose = look_at((0.3, 0.4, away), (0, 0, 0), up=(0.2, 1.0, 0.0))  # a head askew
    return stereo_pair(View(pose, perspective(0.9, SIZE), 0.05, 50.0, SIZE, **lens), apart)
