"""Depth, normals and coverage in numpy float64: the oracle of `surface` in every drawing."""

import numpy as np

from shapeshift.rasterizer.reference import MAX_ALPHA
from shapeshift.rasterizer.surface_reference import midpoint
from shapeshift.renderer.reference.reference import ReferenceSplats, gate_object
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.surface import Surface
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene


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
