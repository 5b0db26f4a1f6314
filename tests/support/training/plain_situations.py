"""A training step of plain splats held still, whose gradients are checked."""

import numpy as np

from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.baselines.plain_step import REST

SIZE = (21, 18)  # neither a multiple of a tile nor of a vector


def situation(seed: int, degree: int, count: int = 7):
    """(parameters, view, rgba): a few large splats of strong harmonics, some colours below zero."""
    rng = np.random.default_rng(seed)
    parameters = {
        "means": rng.uniform(-0.6, 0.6, (count, 3)),
        "scales": np.log(rng.uniform(0.1, 0.3, (count, 3))),
        "wxyz": rng.normal(size=(count, 4)),
        "opacity": rng.normal(size=count),
        "base": 2 * rng.normal(size=(count, 3)),
        "rest": 0.6 * rng.normal(size=(count, REST[degree], 3)),
    }
    parameters = {name: values.astype(np.float32) for name, values in parameters.items()}
    eye = look_at(np.array([0.5, 0.7, 3.0]), np.zeros(3))
    view = View(eye, perspective(np.deg2rad(40), SIZE), 0.05, 100.0, SIZE)
    rgba = rng.integers(0, 256, (SIZE[1], SIZE[0], 4)).astype(np.uint8)
    rgba[..., 3] = 255
    return parameters, view, rgba
