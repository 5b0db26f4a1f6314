"""Two eyes from one view."""

from dataclasses import replace

import numpy as np

from scene.pose import Pose, View


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
