"""The passes of a frame in numpy float64, slow and plain: the oracle of every drawing back end."""

import numpy as np

from renderer.settings import RenderSettings
from runtime_models.evaluate import evaluate
from runtime_models.model import Splats
from runtime_models.rotation import normalize, rotation_matrices
from scene.pose import View
from scene.scene import Scene, SceneObject

MAX_ALPHA = 0.99  # 3DGS: one splat never hides everything behind it
JACOBIAN_MARGIN = 1.3  # 3DGS: beyond 1.3 times the field of view the projection counts as flat


def reference_image(
    scene: Scene, view: View, settings: RenderSettings | None = None, eye: np.ndarray | None = None
) -> np.ndarray:
    """(H, W, 4) float64 premultiplied colour and coverage over nothing, row 0 on top.

    eye: (3,) world metres, where colours are looked at from if not from the view's own eye
    (stereo computes them once, for the centre of both).
    """
    settings = settings or RenderSettings()
    eye = view.world_from_eye.position if eye is None else eye
    parts = [project_object(o, view, settings, eye) for o in scene.objects if o.visible]
    if not parts:
        return np.zeros((view.size[1], view.size[0], 4))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.argsort(columns[0], kind="stable")
    return blend(*(column[order] for column in columns[1:]), view.size, settings.min_alpha)


def project_object(
    thing: SceneObject, view: View, settings: RenderSettings, eye: np.ndarray
) -> tuple:
    """depth (M,), mean_px (M, 2), covariance_px (M, 2, 2), opacity (M,), color (M, 3) of what is
    in front of the eye and passes the settings' limits.
    """
    world_from_object = thing.world_from_object.matrix()
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    camera_from_object = camera_from_world @ world_from_object
    object_from_world = np.linalg.inv(world_from_object)
    eye_object = object_from_world[:3, :3] @ eye + object_from_world[:3, 3]
    splats = _finite(evaluate(thing.model, thing.x, eye_object))

    mean = splats.means @ camera_from_object[:3, :3].T + camera_from_object[:3, 3]  # metres
    keep = (
        (mean[:, 2] > view.near)
        & (np.linalg.norm(mean, axis=1) <= settings.max_distance)
        & (splats.opacity >= settings.min_alpha)
    )
    mean, opacity, color = mean[keep], splats.opacity[keep], splats.color[keep]
    depth = mean[:, 2]
    axes = (
        rotation_matrices(normalize(splats.wxyz[keep])) * splats.scales[keep][:, None, :]
    )  # (M, 3, 3) metres

    left, right, down, up = (t * JACOBIAN_MARGIN for t in view.tangents)
    x, y = np.clip(mean[:, 0] / depth, left, right), np.clip(mean[:, 1] / depth, -up, -down)
    zero = np.zeros_like(depth)
    jacobian = np.stack(
        [
            np.stack([fx / depth, zero, -fx * x / depth], axis=1),
            np.stack([zero, fy / depth, -fy * y / depth], axis=1),
        ],
        axis=1,
    )  # (M, 2, 3) pixels per metre
    half = jacobian @ camera_from_object[:3, :3] @ axes
    covariance = half @ half.transpose(0, 2, 1) + settings.low_pass * np.eye(2)
    mean_px = np.stack([fx * mean[:, 0] / depth + cx, fy * mean[:, 1] / depth + cy], axis=1)
    small = largest_axis_px(covariance) <= settings.max_pixels
    return tuple(a[small] for a in (depth, mean_px, covariance, opacity, color))


def largest_axis_px(covariance: np.ndarray) -> np.ndarray:
    """(M,) one sigma along the longer axis of screen ellipses with covariance (M, 2, 2)."""
    a, b, c = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    return np.sqrt((a + c) / 2 + np.hypot((a - c) / 2, b))


def blend(
    mean_px: np.ndarray,
    covariance: np.ndarray,
    opacity: np.ndarray,
    color: np.ndarray,
    size: tuple[int, int],
    min_alpha: float,
) -> np.ndarray:
    """(H, W, 4): near to far, alpha = min(0.99, opacity exp(-r / 2)), dropped below min_alpha."""
    width, height = size
    image, through = np.zeros((height, width, 3)), np.ones((height, width))
    inverse = np.linalg.inv(covariance)
    radius = np.sqrt(np.maximum(2 * np.log(np.maximum(opacity, min_alpha) / min_alpha), 0))
    extent = radius[:, None] * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))  # pixels
    first = np.clip(np.floor(mean_px - extent - 0.5), 0, size).astype(int)
    after = np.clip(np.ceil(mean_px + extent + 0.5), 0, size).astype(int)
    for i in np.flatnonzero(np.all(after > first, axis=1)):
        (x0, y0), (x1, y1) = first[i], after[i]
        dx = np.arange(x0, x1) + 0.5 - mean_px[i, 0]
        dy = (np.arange(y0, y1) + 0.5 - mean_px[i, 1])[:, None]
        (a, b), (_, c) = inverse[i]
        alpha = np.minimum(
            MAX_ALPHA, opacity[i] * np.exp(-0.5 * (a * dx * dx + 2 * b * dx * dy + c * dy * dy))
        )
        alpha[~(alpha >= min_alpha)] = 0
        weight = alpha * through[y0:y1, x0:x1]
        image[y0:y1, x0:x1] += weight[..., None] * color[i]
        through[y0:y1, x0:x1] -= weight
    return np.concatenate([image, 1 - through[..., None]], axis=2)


def _finite(splats: Splats) -> Splats:
    """The splats of which every number is finite, in float64."""
    parts = [splats.means, splats.scales, splats.wxyz, splats.opacity[:, None], splats.color]
    good = np.isfinite(np.concatenate(parts, axis=1)).all(axis=1)
    return Splats(
        *(
            np.asarray(a, np.float64)[good]
            for a in (splats.means, splats.scales, splats.wxyz, splats.opacity, splats.color)
        )
    )
