"""What of a scene lies under a ray: the depth at which its splats have taken half of the light."""

from dataclasses import dataclass, field

import numpy as np

from shapeshift.runtime_models.evaluate import Evaluator, follows_eye
from shapeshift.runtime_models.model import Model, SplatLayers
from shapeshift.runtime_models.rotation import rotation_matrices
from shapeshift.scene.control import control_of
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.sections.cut import cuts_of, inside_of

SIGMAS = 3.0  # farther from its mean a splat takes no light worth counting
MIN_ALPHA = 1 / 255  # as in the drawing rule
LEAST = 0.05  # of the light: a ray that loses less meets nothing


@dataclass(frozen=True)
class Hit:
    """Where a ray meets the scene."""

    point: np.ndarray  # (3,) metres, world
    index: int  # of the object whose splat is met first there
    depth: float  # metres along the ray
    splat: int = -1  # of the object's model


@dataclass
class _Decoded:
    """The splats of one object as they are at its present control value (and for one eye)."""

    key: tuple
    means: np.ndarray  # (N, 3) metres, object frame
    scales: np.ndarray  # (N, 3) metres
    axes_from_object: np.ndarray  # (N, 3, 3)
    opacity: np.ndarray  # (N,)


@dataclass
class Picker:
    """Finds points under rays; splats are decoded on the CPU once for each control value.

    It looks at splats, not at a picture, so that it needs no drawing back end and no frame.
    """

    _evaluators: dict[int, Evaluator] = field(default_factory=dict)
    _decoded: dict[int, _Decoded] = field(default_factory=dict)

    def under(
        self, scene: Scene, origin: np.ndarray, direction: np.ndarray, spread: float = 0.002
    ) -> Hit | None:
        """The point that a ray from `origin` (3,) along `direction` (3,) in the world meets.

        `spread` is the tangent of half the angle that the hand can mean, about a pixel: splats are
        widened by it, so that thin ones are met as well.
        """
        ray = np.asarray(direction, np.float64) / np.linalg.norm(direction)
        depths, alphas, owners = [np.zeros(0)], [np.zeros(0)], [np.zeros(0, int)]
        splats = [np.zeros(0, int)]
        for index, obj in enumerate(scene.objects):
            if not obj.seen:
                continue
            object_from_world = np.linalg.inv(obj.world_from_object.matrix())
            eye = object_from_world[:3, :3] @ origin + object_from_world[:3, 3]
            splats_now = self._splats(index, obj, eye)
            depth, alpha, met = along(splats_now, eye, object_from_world[:3, :3] @ ray, spread)
            for cut in cuts_of(obj.sections, obj.world_from_object):  # nobody meets what is cut
                there = inside_of(cut.half_spaces, splats_now.means[met]) >= 0
                depth, alpha, met = depth[there], alpha[there], met[there]
            depths.append(depth)
            alphas.append(alpha)
            owners.append(np.full(len(depth), index))
            splats.append(met)
        depth, alpha, owner, splat = map(np.concatenate, (depths, alphas, owners, splats))
        order = np.argsort(depth, kind="stable")
        taken = 1 - np.cumprod(1 - alpha[order])  # (P,) of the light, down to each splat
        if not len(taken) or not taken[-1] >= LEAST:
            return None
        first = order[np.searchsorted(taken, taken[-1] / 2)]
        point = np.asarray(origin, np.float64) + depth[first] * ray
        return Hit(point, int(owner[first]), float(depth[first]), int(splat[first]))

    def _splats(self, index: int, obj: SceneObject, eye: np.ndarray) -> _Decoded:
        model, x = obj.model, control_of(obj)
        place = tuple(eye) if follows_eye(model) else None
        key = (id(model), np.asarray(x).tobytes(), place)
        found = self._decoded.get(index)
        if found is None or found.key != key:
            evaluator = self._evaluators.get(index)
            if evaluator is None or evaluator.model is not model:
                evaluator = self._evaluators[index] = Evaluator(model)
            means, scales, wxyz, opacity = evaluator.geometry(x, eye=eye)
            axes = np.swapaxes(rotation_matrices(wxyz), 1, 2)
            found = self._decoded[index] = _Decoded(key, means, scales, axes, opacity)
        return found


def along(
    splats: _Decoded, eye: np.ndarray, ray: np.ndarray, spread: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth in metres, alpha and row of the splats that a ray meets, in the object's frame.

    A Gaussian is largest along the ray where the ray is nearest to its mean in its own metric;
    its alpha is what it has there.
    """
    to_mean = splats.means - eye  # (N, 3) metres
    depth = to_mean @ ray
    off = np.linalg.norm(to_mean - depth[:, None] * ray, axis=1)
    reach = SIGMAS * (splats.scales.max(axis=1) + spread * np.abs(depth))
    near = np.flatnonzero((off <= reach) & (splats.opacity >= MIN_ALPHA))
    wide = np.hypot(splats.scales[near], spread * depth[near, None])  # (P, 3) one sigma
    start = np.einsum("pij,pj->pi", splats.axes_from_object[near], -to_mean[near]) / wide
    step = np.einsum("pij,j->pi", splats.axes_from_object[near], ray) / wide
    depth = -np.einsum("pi,pi->p", start, step) / np.einsum("pi,pi->p", step, step)
    least = start + depth[:, None] * step  # (P, 3) sigmas from the mean, where that is least
    alpha = splats.opacity[near] * np.exp(-0.5 * np.einsum("pi,pi->p", least, least))
    met = (depth > 0) & (alpha >= MIN_ALPHA)
    return depth[met], np.minimum(alpha[met], 0.99), near[met]


def anchor_places(model: Model) -> np.ndarray:
    """(A, 3) metres in the object's frame: what one control value each can be painted on."""
    return model.means if isinstance(model, SplatLayers) else model.anchors
