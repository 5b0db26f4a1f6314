"""What is in the world: objects with a pose and a control value."""

from dataclasses import dataclass

import numpy as np

from runtime_models.model import AnchorModel, SplatLayers
from scene.pose import Pose

IDENTITY = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass(frozen=True)
class SceneObject:
    name: str
    model: AnchorModel | SplatLayers
    world_from_object: Pose = IDENTITY
    x: float = 0.0  # control value in [0, 1]
    label: int = 0  # 0 = background
    visible: bool = True


@dataclass(frozen=True)
class Scene:
    objects: tuple[SceneObject, ...]

    @property
    def splat_count(self) -> int:
        return sum(o.model.splat_count for o in self.objects)
