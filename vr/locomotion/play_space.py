"""Where the room of a headset stands in the world, and how large the world is seen from it."""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import IDENTITY


@dataclass(frozen=True)
class PlaySpace:
    """world = position + scale * rotation @ play; scale 1 is the true one."""

    world_from_play: Pose = IDENTITY
    scale: float = 1.0  # metres of the world a metre of the room: 2 makes the world look half

    def pose(self, play_from_local: Pose) -> Pose:
        """World pose of something in the room."""
        matrix = self.world_from_play.matrix() @ play_from_local.matrix()
        away = self.world_from_play.matrix()[:3, :3] @ play_from_local.position * self.scale
        turned = Pose.from_matrix(matrix)
        return Pose(self.world_from_play.position + away, turned.wxyz)

    def point(self, play: np.ndarray) -> np.ndarray:
        """(3,) metres of the world of a point of the room."""
        return self.pose(Pose(np.asarray(play, np.float64), IDENTITY.wxyz)).position

    def view(self, play_view: View) -> View:
        """An eye of the room in the world; its near and far grow with the scale."""
        return replace(
            play_view,
            world_from_eye=self.pose(play_view.world_from_eye),
            near=play_view.near * self.scale,
            far=play_view.far * self.scale,
        )
