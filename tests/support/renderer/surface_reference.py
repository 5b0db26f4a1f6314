"""Depth, normals and coverage in plain numpy float64, by rays through ellipsoids: the oracle of
`surface` in every drawing.
"""

import numpy as np

from shapeshift.rasterizer.project import Camera
from shapeshift.rasterizer.reference import MAX_ALPHA, rotations
from shapeshift.renderer.reference import ReferenceSplats, gate_object
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.surface import Surface
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene
from tests.support.renderer.rasterizer_reference import Splats, project_reference

REACH = 6.0  # sigmas along the view within which a splat's depth is held


def midpoint(
    mean: np.ndarray, axes: np.ndarray, rays: np.ndarray, near: float
) -> tuple[np.ndarray, np.ndarray]:
    """Metres (...,) where rays (..., 3), z = 1, are halfway through an ellipsoid, by its inverse;
    and (3,) the inverse times the mean: what the surface there faces away from.

    mean (3,), axes (3, 3), columns one sigma long: in the camera, z forward.
    """
    inverse = axes / np.square(axes).sum(axis=0)  # columns: directions over sigmas
    inverse = inverse @ inverse.T
    depth = (rays @ inverse @ mean) / np.einsum("...i,ij,...j->...", rays, inverse, rays)
    reach = REACH * np.linalg.norm(axes[2])
    return np.clip(depth, max(mean[2] - reach, near), mean[2] + reach), inverse @ mean


def render_depth_reference(
    splats: Splats, camera: Camera, background=(0.0, 0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image (3, H, W), transmittance and metres (H, W) of (means, scales, wxyz, opacity, color)."""
    means, scales, wxyz = splats[:3]
    record, depth = project_reference(*splats, camera)
    camera_from_world = np.asarray(camera.camera_from_world, np.float64)
    places = means @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    axes = camera_from_world[:3, :3] @ rotations(wxyz) * scales[:, None, :]
    width, height = camera.size
    x, y = np.arange(width) + 0.5, np.arange(height)[:, None] + 0.5
    x, y = (np.broadcast_to(a, (height, width)) for a in (x, y))
    rays = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)], -1)
    image, transmittance = np.zeros((3, height, width)), np.ones((height, width))
    metres = np.zeros((height, width))
    for i in np.argsort(depth, kind="stable"):
        mean_x, mean_y, a, b, c, opacity, *rgb, extent_x, _, power_threshold = record[i]
        if not extent_x > 0:
            continue
        dx, dy = x - mean_x, y - mean_y
        r = a * dx * dx + 2 * b * dx * dy + c * dy * dy
        alpha = np.where(r <= power_threshold, np.minimum(MAX_ALPHA, opacity * np.exp(-r / 2)), 0)
        weight = alpha * transmittance
        drawn = weight > 0
        held, _ = midpoint(places[i], axes[i], rays[drawn], camera.near)
        metres[drawn] += weight[drawn] * held
        image += np.multiply.outer(rgb, weight)
        transmittance = transmittance - weight
    return image + transmittance * np.asarray(background)[:, None, None], transmittance, metres


def reference_surface(scene: Scene, view: View, settings: RenderSettings | None = None) -> Surface:
    """The Surface of a view, float64: rays through ellipsoids by their inverses."""
    settings = settings or RenderSettings()
    eye = view.world_from_eye.position
    found = [gate_object(o, view, settings, eye) for o in scene.objects if o.seen]
    width, height = view.size
    metres, transmittance = np.zeros((height, width)), np.ones((height, width))
    normal = np.zeros((height, width, 3))
    _, fx, fy, cx, cy = view.pinhole()
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], axis=-1)
    splats = _drawn(found)
    key = np.linalg.norm(splats.mean, axis=1) if settings.order == "distance" else splats.depth
    for i in np.argsort(key, kind="stable"):
        d = np.stack([x, y], axis=-1) - splats.mean_px[i]
        r = np.einsum("hwi,ij,hwj->hw", d, np.linalg.inv(splats.covariance[i]), d)
        alpha = np.minimum(MAX_ALPHA, splats.opacity[i] * np.exp(-r / 2))
        weight = np.where(alpha >= settings.min_alpha, alpha, 0) * transmittance
        depth, away = midpoint(splats.mean[i], splats.axes[i], rays, view.near)
        facing = away * [-1, 1, 1]  # from the camera's axes to the eye's, towards it
        metres += weight * depth
        normal += weight[..., None] * (facing / np.linalg.norm(facing))
        transmittance -= weight
    return Surface(metres, normal, 1 - transmittance)


def _drawn(found: list[ReferenceSplats]) -> ReferenceSplats:
    """What passes every gate, of all objects."""
    if not found:
        return ReferenceSplats(*(np.zeros((0, *shape)) for shape in SHAPES))
    rows = [f.reason == 0 for f in found]
    columns = {
        name: np.concatenate([getattr(f, name)[row] for f, row in zip(found, rows, strict=True)])
        for name in ReferenceSplats.__dataclass_fields__
    }
    return ReferenceSplats(**columns)


SHAPES = ((), (), (3,), (2,), (2, 2), (), (3,), (3,), (3, 3))  # of ReferenceSplats
