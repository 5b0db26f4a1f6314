"""What is in the world: objects with a pose and a control value."""

import math
from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.model import Model, SplatLayers
from shapeshift.runtime_models.stop_weights import Control, StopWeights, check_control
from shapeshift.scene.appearance import NEUTRAL, Appearance
from shapeshift.scene.pose import UNIT_SLACK, Pose
from shapeshift.scene.sections.section import SceneSection
from shapeshift.scene.selectors.selector import Selector

IDENTITY = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass(frozen=True, eq=False)  # the same only where it is the very same: arrays are large
class Tint:
    """A colour over an object's own, at every x and through every palette: it marks, it is no look.

    Shown is (1 - strength) times the object's own colour, plus strength times this one.
    """

    color: np.ndarray | tuple[float, float, float]  # (3,) display sRGB, or (A, 3) one an anchor
    strength: np.ndarray | float  # 0..1, or (A,) one an anchor (of SplatLayers: a splat)


@dataclass(frozen=True)
class SceneObject:
    name: str
    model: Model
    world_from_object: Pose = IDENTITY
    x: Control = 0.0  # a place on the slider, 0 to 1, or a blend of the model's stops
    label: int = 0  # 0 = background
    visible: bool = True
    selectors: tuple[Selector, ...] = ()  # parts with an x of their own; a later one lies above
    tint: Tint | None = None  # no look of its own: which object it is, what of it is chosen
    appearance: Appearance = NEUTRAL  # what of its own look is shown how
    sections: tuple[SceneSection, ...] = ()  # what of it is cut away, or at another x

    @property
    def seen(self) -> bool:
        """Whether anything of it is drawn."""
        return self.visible and self.appearance.opacity > 0

    @property
    def slider_x(self) -> float:
        """Where the knob of its slider is."""
        return self.model.blend.slider_x(self.x)

    def __post_init__(self) -> None:
        """Refuses a place or an x that is none: ValueError with a sentence."""
        pose = self.world_from_object
        length = math.hypot(*pose.wxyz)
        if not (all(map(math.isfinite, pose.position)) and abs(length - 1) <= UNIT_SLACK):
            raise ValueError(
                f"object '{self.name}' stands at {_numbers_text(pose.position)} with a quaternion "
                f"{_numbers_text(pose.wxyz)}; finite metres and a quaternion of length 1 "
                "are wanted."
            )
        beyond = (one.beyond for one in self.sections if one.beyond is not None)
        for control in (self.x, *(selector.x for selector in self.selectors), *beyond):
            check_control(control, f"object '{self.name}'")
            if isinstance(control, StopWeights):
                self.model.blend.weights(control)  # knows every stop


def _numbers_text(numbers: np.ndarray) -> str:
    return "(" + ", ".join(f"{number:.6g}" for number in numbers) + ")"


@dataclass(frozen=True)
class Scene:
    objects: tuple[SceneObject, ...]

    @property
    def splat_count(self) -> int:
        """Of what is drawn by a budget all that there are, at their finest level."""
        return sum(count_splats(o.model) for o in self.objects)


def count_splats(model: Model) -> int:
    """All splats of a model, whose own may be the coarsest level of its leaves."""
    leaves = model.leaves if isinstance(model, SplatLayers) else None
    return model.splat_count if leaves is None else int(leaves.levels.finest_counts.sum())
