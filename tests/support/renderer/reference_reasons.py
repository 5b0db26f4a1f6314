"""Which gate stops each splat, and what is drawn of an object, by the numpy reference."""

import numpy as np

from shapeshift.renderer.reference import gate_object
from shapeshift.renderer.settings import CULL_REASONS, RenderSettings
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject


def reference_reasons(
    scene: Scene, view: View, settings: RenderSettings | None = None
) -> np.ndarray:
    """(N,) uint8 of all splats in the scene's order: 0 drawn, else 1 + index into CULL_REASONS.

    Splats of hidden objects are nowhere: "distance", if not "opacity".
    """
    settings = settings or RenderSettings()
    eye = view.world_from_eye.position
    parts = [gate_object(o, view, settings, eye).reason for o in scene.objects]
    return np.concatenate([np.zeros(0, np.uint8), *parts])


def reference_counts(
    scene: Scene, view: View, settings: RenderSettings | None = None
) -> dict[str, int]:
    """{drawn, *CULL_REASONS} of `reference_reasons`, as the drawings count them."""
    numbers = np.bincount(reference_reasons(scene, view, settings), minlength=7)
    return dict(zip(("drawn", *CULL_REASONS), numbers.tolist(), strict=True))


def project_object(
    obj: SceneObject, view: View, settings: RenderSettings, eye: np.ndarray
) -> tuple:
    """depth (M,), mean_px (M, 2), covariance_px (M, 2, 2), opacity (M,), color (M, 3) of what is
    drawn.
    """
    all_ = gate_object(obj, view, settings, eye)
    names = ("depth", "mean_px", "covariance", "opacity", "color")
    return tuple(getattr(all_, name)[all_.reason == 0] for name in names)
