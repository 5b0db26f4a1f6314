"""Small scenes that try what a page can show."""

from dataclasses import replace

import numpy as np

from shapeshift.app.document import Document
from shapeshift.runtime_models.model import AnchorFrames, AnchorModel, SplatLayers, Stop
from shapeshift.runtime_models.rotation import normalize
from shapeshift.runtime_models.stop_weights import Pace, StopWeights
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import make_random_model

STOPS = (
    Stop("RGB", 0.0),
    Stop("Thermal", 0.4, "thermal", "ironbow", (15.0, 95.0), "°C"),
    Stop("Opened", 1.0, "layer"),
)
PACE = (Pace("RGB", "Thermal", (0.0, 0.1, 0.45, 1.0)), Pace("RGB", "Opened", (0.0, 0.7, 1.0)))


def paced_model(anchors: int = 300, framed: bool = True, **more) -> AnchorModel:
    """Three stops, paces, and anchors with their own sizes and axes."""
    rng = np.random.default_rng(anchors)
    model = make_random_model(anchors, **more)
    frames = AnchorFrames(
        rng.uniform(0.5, 2.5, (anchors, 3)).astype(np.float32),
        normalize(rng.normal(size=(anchors, 4))).astype(np.float32),
    )
    return replace(model, stops=STOPS, pace=PACE, frames=frames if framed else None)


def plain_splats(
    count: int = 800, degree: int = 3, antialiased: bool = False, mode: str = "exclusive",
    thermal: bool = False,
) -> SplatLayers:  # fmt: skip
    """Two layers of random splats, with harmonics."""
    rng = np.random.default_rng(degree)
    kind = ("thermal", "turbo") if thermal else ("layer", "")
    return SplatLayers(
        rng.normal(0, 0.4, (count, 3)).astype(np.float32),
        rng.uniform(0.002, 0.06, (count, 3)).astype(np.float32),
        normalize(rng.normal(size=(count, 4))).astype(np.float32),
        rng.uniform(0.05, 1, count).astype(np.float32),
        rng.normal(0, 0.25, (count, (degree + 1) ** 2, 3)).astype(np.float32),
        rng.integers(0, 2, count).astype(np.int32),
        (Stop("A", 0.0), Stop("B", 1.0, *kind)),
        mode,
        antialiased=antialiased,
    )


def several_objects() -> Document:
    """Posed objects of different models, each at its own x; one model twice; one hidden."""
    turned = np.array([0.8, 0.0, 0.6, 0.0])
    paced, plain = paced_model(120), plain_splats(300, 1, mode="cumulative")
    blend = StopWeights((("RGB", 0.5), ("Opened", 0.5)))
    one = Pose(np.array([-0.8, 0.1, 0.0]), turned)
    other = Pose(np.array([0.7, -0.2, 0.3]), np.array([0.5, 0.5, -0.5, 0.5]))
    plain_pose = Pose(np.array([0.1, 0.5, -0.6]), turned)
    return Document(
        Scene(
            (
                SceneObject("room", paced, x=0.0),
                SceneObject("<b>same model</b>", paced, one, blend),
                SceneObject("plain", plain, plain_pose, 0.6),
                SceneObject("hidden", plain, other, 0.2, visible=False),
            )
        )
    )
