"""A scene's frame in numpy float64, slow and plain: the oracle of every drawing back end.

Projection and blending are rasterizer/reference.py's; here are the scene, its gates, its colours.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.rasterizer.reference import blend, screen_covariance
from shapeshift.renderer import layout
from shapeshift.renderer.colors.false_colors import (
    BESIDE,
    PICTURE,
    SPLATS,
    FalseColors,
    Shade,
    false_colors,
    mixed_colors,
    split_colors,
)
from shapeshift.renderer.colors.palette import overlay_heat
from shapeshift.renderer.settings import CULL_REASONS, RenderSettings
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import is_antialiased
from shapeshift.runtime_models.rotation import normalize, rotation_matrices
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.control import control_of
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject

JACOBIAN_MARGIN = 1.3  # 3DGS: beyond 1.3 times the field of view the projection counts as flat;
#                        an off-centre view has that of the centred picture that it is a part of


@dataclass(frozen=True)
class ReferenceSplats:
    """All splats of an object as a view sees them; rows with a reason may hold anything."""

    reason: np.ndarray  # (N,) uint8: 0 drawn, else 1 + index into CULL_REASONS
    depth: np.ndarray  # (N,) metres along the view
    place: np.ndarray  # (N, 3) metres in the world
    mean_px: np.ndarray  # (N, 2) row 0 on top
    covariance: np.ndarray  # (N, 2, 2) px^2, low_pass included
    opacity: np.ndarray  # (N,) after the fade
    color: np.ndarray  # (N, 3), or (N, 5) with value and weight of the heat
    mean: np.ndarray  # (N, 3) metres in the camera, OpenCV axes
    axes: np.ndarray  # (N, 3, 3) metres in the camera: the columns are one sigma long


def reference_image(
    scene: Scene,
    view: View,
    settings: RenderSettings | None = None,
    eye: np.ndarray | None = None,
    middle: np.ndarray | None = None,
) -> np.ndarray:
    """(H, W, 4) float64 premultiplied colour and coverage over nothing, row 0 on top; at a pure
    value stop values.

    eye: (3,) world metres, where colours are looked at from, if not the view's own eye (shared
    colours of two eyes: the middle of both).  middle: where distances in the order "distance" are
    measured from, if not `eye` (one order for two eyes: the middle of both).
    """
    settings = settings or RenderSettings()
    eye = view.world_from_eye.position if eye is None else eye
    middle = eye if middle is None else middle
    objects, colors = shaded_objects(scene, view, settings, eye)
    if not objects:
        return np.zeros((view.size[1], view.size[0], 4))
    depth, place, mean_px, covariance, opacity, color = (
        np.concatenate([getattr(o, name)[o.reason == 0] for o in objects])
        for name in ("depth", "place", "mean_px", "covariance", "opacity", "color")
    )
    key = np.linalg.norm(place - middle, axis=1) if settings.order == "distance" else depth
    order = np.argsort(key, kind="stable")
    image = blended(
        mean_px[order], covariance[order], opacity[order], color[order], view.size,
        settings.min_alpha,
    )  # fmt: skip
    if colors.way != BESIDE:
        return image
    return overlay_heat(image[..., [0, 1, 2, 5]], image[..., 3:5], colors.palette)


def shaded_objects(
    scene: Scene, view: View, settings: RenderSettings, eye: np.ndarray
) -> tuple[list[ReferenceSplats], FalseColors]:
    """The visible objects; colours are (N, 3), or (N, 5) with the heat."""
    colors = false_colors(scene, [control_of(obj) for obj in scene.objects])
    found = [
        gate_object(obj, view, settings, eye, (colors.way, shade))
        for obj, shade in zip(scene.objects, colors.shades, strict=True)
        if obj.seen
    ]
    return found, colors


def gate_object(
    obj: SceneObject, view: View, settings: RenderSettings, eye: np.ndarray,
    shading: tuple[str, Shade] | None = None,
) -> ReferenceSplats:  # fmt: skip
    """Projects every splat and finds the first gate that it fails.

    shading: how the scene's heat is shown and what of the object is heat; None: none is.
    """
    world_from_object = obj.world_from_object.matrix()
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    camera_from_object = camera_from_world @ world_from_object
    object_from_world = np.linalg.inv(world_from_object)
    eye_object = object_from_world[:3, :3] @ eye + object_from_world[:3, 3]
    splats = evaluate(obj.model, control_of(obj), eye_object)
    means, scales, wxyz, opacity = (
        np.asarray(a, np.float64)
        for a in (splats.means, splats.scales, splats.wxyz, splats.opacity)
    )
    opacity = opacity * np.float32(obj.appearance.opacity)
    color = shaded_color(obj, splats.color, eye_object, shading)
    turned = np.isfinite(wxyz).all(axis=1, keepdims=True)  # (N, 1)
    scales = np.where(turned, scales, np.nan)
    if not obj.seen:
        means = np.full_like(means, np.nan)
    with np.errstate(all="ignore"):  # splats that are not finite, or level with or behind the eye
        mean = means @ camera_from_object[:3, :3].T + camera_from_object[:3, 3]  # metres
        depth = mean[:, 2]
        axes = rotation_matrices(normalize(wxyz)) * scales[:, None, :]  # (N, 3, 3) metres
        most_x, most_y = (t * JACOBIAN_MARGIN for t in view.widest_tangents())
        in_camera = camera_from_object[:3, :3] @ axes
        bare = screen_covariance(mean, in_camera, (fx, fy), (-most_x, most_x, -most_y, most_y))
        covariance = bare + settings.low_pass * np.eye(2)
        seen = (
            opacity * mip_compensation(bare, covariance) if is_antialiased(obj.model) else opacity
        )
        # The arena keeps covariances as float32: what is infinite there is so here.
        overflow: np.ndarray = np.asarray(
            np.square(axes).sum(axis=2).max(axis=1) > np.finfo(np.float32).max
        )
        covariance[overflow] = np.inf
        mean_px = np.stack([fx * mean[:, 0] / depth + cx, fy * mean[:, 1] / depth + cy], axis=1)
        reason, faded = gate(mean, mean_px, covariance, opacity, seen, color, view, settings)
        place = means @ world_from_object[:3, :3].T + world_from_object[:3, 3]
    return ReferenceSplats(reason, depth, place, mean_px, covariance, faded, color, mean, in_camera)


def shaded_color(
    obj: SceneObject, decoded: np.ndarray, eye: np.ndarray, shading: tuple[str, Shade] | None
) -> np.ndarray:
    """(N, 3) colours of splats towards an eye (3,) in the object's frame, or (N, 5) with heat."""
    way, shade = shading or ("", Shade(0.0))
    model, grade = obj.model, obj.appearance.graded

    def color_at(control: Controls) -> np.ndarray:
        return evaluate(model, control, eye).color.astype(np.float64)

    if way == BESIDE:
        return np.concatenate(split_colors(shade, model.splat_count, color_at, grade), axis=1)
    if way == SPLATS:
        return mixed_colors(shade, model.splat_count, color_at, grade)
    color = np.asarray(decoded, np.float64)
    return color if way == PICTURE else grade(color)


def mip_compensation(bare: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(N,) sqrt(det / det with the low pass): how much fainter an antialiased splat becomes."""
    kept = np.sqrt(np.maximum(np.linalg.det(bare), 0) / np.linalg.det(covariance))
    return np.fmin(kept, 1)  # 1 where the quotient is no number


def gate(
    mean: np.ndarray,
    mean_px: np.ndarray,
    covariance: np.ndarray,
    opacity: np.ndarray,
    seen: np.ndarray,
    color: np.ndarray,
    view: View,
    settings: RenderSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """(N,) reasons and faded opacities; mean (N, 3) metres in the camera; as ReferenceSplats.

    seen: (N,) opacity on the screen, of antialiased splats less than the model's.
    """
    # The kernels get limits as float32: a splat that meets one exactly must meet it here.
    least, largest, farthest, smallest, near = (
        float(np.float32(min(limit, layout.HUGE)))
        for limit in (
            settings.min_alpha, settings.max_pixels, settings.max_distance, settings.min_pixels,
            view.near,
        )
    )  # fmt: skip
    distance = np.linalg.norm(mean, axis=1)
    # Alpha is `least` so many sigmas from the mean.
    cutoff_sigmas = np.sqrt(np.maximum(2 * np.log(seen / least), 0))
    extent = cutoff_sigmas[:, None] * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    inside = np.all((mean_px - extent < view.size) & (mean_px + extent > 0), axis=1)
    shaped = np.isfinite(covariance).all(axis=(1, 2)) & np.isfinite(mean_px).all(axis=1)
    shaped &= opacity / least < np.finfo(np.float32).max  # else the cutoff is infinite there
    sigma = largest_axis_px(covariance)
    flat = np.linalg.det(np.where(shaped[:, None, None], covariance, 0)) <= 0
    colored = (np.abs(color) <= layout.HALF_MAX).all(axis=1)
    reach = cutoff_sigmas * sigma  # pixels
    faded = seen * ramp(largest - sigma, settings.fade, settings.max_pixels)
    faded = faded * ramp(farthest - distance, settings.fade, settings.max_distance)
    faded = faded * ramp(reach - smallest, settings.fade, settings.min_pixels)
    passes = {
        "opacity": np.isfinite(opacity) & (opacity >= least),
        "distance": distance <= farthest,
        "frustum": (mean[:, 2] > near) & (inside | ~shaped),
        "size": shaped & ~flat & colored & (sigma <= largest),
        "footprint": reach >= smallest,
        "faded": faded >= least,
    }
    failed = np.stack([~passes[name] for name in CULL_REASONS])
    reason = np.where(failed.any(axis=0), 1 + failed.argmax(axis=0), 0).astype(np.uint8)
    return reason, faded


def ramp(within: np.ndarray, fade: float, limit: float) -> np.ndarray | float:
    """0 at a limit, 1 from `fade` times the limit within it; 1 where nothing is to fade."""
    if not (fade > 0 and 0 < limit < layout.HUGE):
        return 1.0
    return np.clip(within / (fade * limit), 0, 1)


def largest_axis_px(covariance: np.ndarray) -> np.ndarray:
    """(M,) one sigma along the longer axis of screen ellipses with covariance (M, 2, 2)."""
    a, b, c = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    return np.sqrt((a + c) / 2 + np.hypot((a - c) / 2, b))


def blended(
    mean_px: np.ndarray,
    covariance: np.ndarray,
    opacity: np.ndarray,
    color: np.ndarray,
    size: tuple[int, int],
    min_alpha: float,
) -> np.ndarray:
    """(H, W, C + 1) of colours (N, C), near to far, and coverage; alpha below min_alpha is none."""
    conics = np.linalg.inv(covariance)[:, (0, 0, 1), (0, 1, 1)]
    thresholds = 2 * np.log(np.maximum(opacity, min_alpha) / min_alpha)
    extents = np.sqrt(thresholds[:, None] * np.diagonal(covariance, axis1=1, axis2=2))  # pixels
    image, transmittance = blend(mean_px, conics, thresholds, extents, opacity, color, size)
    return np.concatenate([image, 1 - transmittance[..., None]], axis=2)
