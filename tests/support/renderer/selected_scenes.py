"""A scene with regions that follow their own x."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import Stop
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import Box, Lens, Sphere
from tests.support.splat_scenes import front_view, random_layers, random_model

VIEW = front_view((160, 120))
BALL = Sphere(centre=(0.2, 0, 0), radius=0.5, x=1.0, border=0.4)
ASIDE = Pose(np.array([0.4, 0.1, 0]), np.array([0.8, 0, 0.6, 0]))
STOPS = (Stop("RGB", 0.0), Stop("Hot", 0.5, "thermal", "ironbow"), Stop("Open", 1.0))


def thermal(model):
    return replace(model, stops=STOPS)


def selected_scene() -> Scene:
    """Two thermal objects with several selectors, one of them in the world, and plain layers."""
    selectors = (
        replace(BALL, x=0.5, space="world"),
        Box(centre=(-0.4, 0, 0), half=(0.3, 0.5, 0.4), wxyz=(0.8, 0, 0.6, 0), x=1.0, border=0.1),
        Lens(position=(0, 0, 4), wxyz=(1, 0, 0, 0), half_angle=0.06, x=0.25, border=0.2),
    )
    return Scene((
        SceneObject("a", thermal(random_model(150)), ASIDE, 0.1, selectors=selectors),
        SceneObject("b", thermal(random_model(80, seed=1)), x=0.6),
        SceneObject("c", random_layers(100, layers=2), x=0.2, selectors=selectors[1:]),
    ))  # fmt: skip
