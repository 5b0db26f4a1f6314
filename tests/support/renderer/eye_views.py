"""Two eyes in front of a scene: lenses, apart, canted."""

import numpy as np

from shapeshift.scene.pose import Pose, View

APART = 0.064  # metres between the eyes


def eyes(tangents: tuple, right_tangents: tuple | None = None, cant: float = 0.0) -> list[View]:
    """Two eyes at z = 2 that look along -z, each turned outwards by `cant` degrees."""
    pair = []
    for side, t in ((-1, tangents), (1, right_tangents or tangents)):
        half = np.radians(-side * cant) / 2
        pose = Pose(
            np.array([side * APART / 2, 0.0, 2.0]), np.array([np.cos(half), 0, np.sin(half), 0])
        )
        pair.append(View(pose, t, 0.05, 50.0, (320, 200)))
    return pair
