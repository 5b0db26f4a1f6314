"""Whether the views of a frame get colours of their own: settings.stereo_colors."""

import math
from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.colors.color_bounds import color_slope
from shapeshift.runtime_models.evaluate import follows_eye
from shapeshift.runtime_models.model import Model, ScaffoldModel, SplatLayers
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene

# Shared colours are reckoned to be this good or better, dB.  Measured on captures with harmonics
# and on networks they were 5 to 14 dB better over the pixels that are covered (docs/vr.md); the 8
# bits of a headset's pictures cost 58.9 dB.
SHARED_DB = 55.0
SAME_PLACE_M = 1e-4  # views nearer to each other are one eye's, whose insets have its place
NEAREST = 1.0  # percent of the splats: how far these are is how near the object is
SAMPLE = 4096  # splats or anchors that tell


@dataclass(frozen=True)
class EyeColors:
    """What of a model tells how much two eyes differ in its colours."""

    places: np.ndarray  # (n, 3) metres, object frame: a sample of its splats or anchors
    slope: float  # color_slope; infinite where more than colours follows the eye

    @staticmethod
    def of(model: Model) -> "EyeColors":
        places = model.means[model.opacity > 0] if isinstance(model, SplatLayers) else model.anchors
        step = max(-(-len(places) // SAMPLE), 1)
        slope = math.inf if isinstance(model, ScaffoldModel) else color_slope(model)
        return EyeColors(np.array(places[::step], np.float64), slope)

    def shared_db(self, eyes: np.ndarray) -> float:
        """PSNR, dB, that colours for the middle of the eyes (E, 3), object frame, have at least.

        A splat d away is seen from the middle at an angle of apart / d from an eye's own.
        """
        middle = eyes.mean(axis=0)
        apart = float(np.linalg.norm(eyes - middle, axis=1).max())
        if not (apart > 0 and self.slope > 0 and len(self.places)):
            return math.inf
        away = np.percentile(np.linalg.norm(self.places - middle, axis=1), NEAREST)
        return 20 * math.log10(max(away / (self.slope * apart), 1e-30))


def shared_is_enough(scene: Scene, looks: list[EyeColors], views: list[View]) -> bool:
    """Whether nobody sees that colours are those of the middle of the eyes; a look an object."""
    eyes_world = np.array([view.world_from_eye.position for view in views])
    for obj, look in zip(scene.objects, looks, strict=True):
        if obj.seen:
            object_from_world = np.linalg.inv(obj.world_from_object.matrix())
            eyes = eyes_world @ object_from_world[:3, :3].T + object_from_world[:3, 3]
            if not look.shared_db(eyes) >= SHARED_DB:
                return False
    return True


def eyes_among(views: list[View]) -> list[int]:
    """Of each view the number of its eye: those from one place, a wide view and an inset in it,
    see the same colours.
    """
    places = np.array([view.world_from_eye.position for view in views])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    alike = apart <= SAME_PLACE_M
    first = np.argmax(alike, axis=1)  # of each view, the first one from its place
    return [int(np.flatnonzero(np.unique(first) == each)[0]) for each in first]


def by_eye(views: list[View], own: bool, most: int) -> tuple[list[int], list[list[View]]]:
    """Which set of colours each view has, and the views of each set: own: one an eye, where these
    are no more than `most`; else one for all.
    """
    eyes = eyes_among(views) if own else [0] * len(views)
    if max(eyes) >= most:
        eyes = [0] * len(views)
    groups: list[list[View]] = [[] for _ in range(max(eyes) + 1)]
    for eye, view in zip(eyes, views, strict=True):
        groups[eye].append(view)
    return eyes, groups


def drawn_together(scene: Scene, views: int, own_colors: bool) -> list[slice]:
    """Which views of a frame are decoded and drawn at once: all of them, but one by one where each
    eye is to see its own splats of a model whose shape follows the eye.
    """
    follows = any(obj.seen and follows_eye(obj.model) for obj in scene.objects)
    if own_colors and follows:
        return [slice(i, i + 1) for i in range(views)]
    return [slice(0, views)]
