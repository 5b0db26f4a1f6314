"""Two eyes from one view."""

from dataclasses import replace

import numpy as np

from shapeshift.scene.pose import Pose, View

PUPILS_M = 0.064  # metres between the eyes of a person
LOOKED_FROM_M = 1.8  # metres: from where a person looks at an object


def eyes_apart(distances: np.ndarray) -> float:
    """How far apart the eyes of a person are in a scene whose scale nobody knows: the middle one of
    the distances (n,) to its splats is taken for LOOKED_FROM_M; in the scene's own unit.
    """
    middle = float(np.median(distances)) if len(distances) else LOOKED_FROM_M
    return PUPILS_M / LOOKED_FROM_M * middle


def stereo_pair(view: View, distance: float) -> list[View]:
    """Left and right eye, `distance` metres apart, parallel, about the place of `view`."""
    right = view.world_from_eye.matrix()[:3, 0]
    return [
        replace(
            view,
            world_from_eye=Pose(
                np.asarray(view.world_from_eye.position) + side * distance / 2 * right,
                view.world_from_eye.wxyz,
            ),
        )
        for side in (-1, 1)
    ]
