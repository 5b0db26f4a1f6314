"""Which anchors get colours for a frame, those that a view sees; and whether each view its own."""

import math

import numpy as np

from shapeshift.renderer.colors.color_cache import (
    ColorCache,
    reach_of,
    reach_of_scaffold,
    visible_anchors,
)
from shapeshift.renderer.colors.eye_colors import EyeColors, shared_is_enough
from shapeshift.renderer.decoded_object import DecodedObject
from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import ScaffoldModel, SplatLayers
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject


def wanted_anchors(
    drawing: Drawing, settings: RenderSettings, i: int, obj: SceneObject, decoded: DecodedObject,
    colored: ColorCache, stale: bool, views: list[View],
) -> np.ndarray | None:  # fmt: skip
    """(A,) bool: the anchors that views see and whose colours are stale; None: all."""
    assert not isinstance(obj.model, SplatLayers), "splats are asked for by wanted_splats"
    if not settings.skip_unseen:
        return wanted_splats(colored, stale, None)
    if not stale and colored.anchors is None:
        return None
    reach_key = (decoded.version, settings.min_alpha)
    if colored.reach_key != reach_key:
        colored.reach, colored.reach_key = None, reach_key
        if stale:  # how far splats reach is worth knowing once x rests
            return None
    if colored.reach is None:
        mean_opacity, owner, covariance = drawing.splat_points()
        mine = owner == i
        k = math.sqrt(2 * math.log(1 / settings.min_alpha))
        parts = (obj.model.anchors, mean_opacity[mine], covariance[mine], k)
        colored.reach = reach_of(*parts)
    pose = obj.world_from_object.matrix()
    seen = visible_anchors(obj.model.anchors, colored.reach, pose, views, settings)
    return seen if stale or colored.anchors is None else seen & ~colored.anchors


def wanted_splats(colored: ColorCache, stale: bool, seen: np.ndarray | None) -> np.ndarray | None:
    """(n,) bool: which of those that are seen have stale colours, one a splat of layers or an
    anchor; None: all.  seen None: nobody knows who is.
    """
    if stale or colored.anchors is None:
        return seen if stale else None
    left = ~colored.anchors  # left out before
    return left if seen is None else left & seen


def wanted_of_follower(
    settings: RenderSettings, obj: SceneObject, colored: ColorCache, stale: bool, views: list[View]
) -> tuple[bool, np.ndarray | None]:
    """Whether a model that follows the eye is to be decoded, and (A,) which anchors; None: all.

    Where its splats can be is known beforehand, so only what views see needs to be decoded;
    for one eye as a whole, so what comes into view has the rest decoded, too.
    """
    model = obj.model
    assert isinstance(model, ScaffoldModel), "the one kind that follows the eye"
    if not settings.skip_unseen:
        return stale or colored.anchors is not None, None
    if colored.reach is None or colored.reach_key != settings.min_alpha:
        colored.reach = reach_of_scaffold(model, settings.min_alpha)
        colored.reach_key = settings.min_alpha
    pose = obj.world_from_object.matrix()
    seen = visible_anchors(model.anchors, colored.reach, pose, views, settings)
    new = colored.anchors is not None and (seen & ~colored.anchors).any()
    return stale or bool(new), None if seen.all() else seen


def own_colors(
    settings: RenderSettings, scene: Scene, decoded: list[DecodedObject], views: list[View]
) -> bool:
    """Whether each of the views gets colours of its own: settings.stereo_colors."""
    choice = "shared" if settings.debug or len(views) == 1 else settings.stereo_colors
    if choice != "auto":
        return choice == "each"
    for each in decoded:
        each.look = each.look or EyeColors.of(each.model)
    looks = [each.look for each in decoded if each.look is not None]
    return not shared_is_enough(scene, looks, views)
