"""Splats as an object's sections and its opacity leave them, put into the arena.

It happens where a section, a pose or x has changed, on the splats that both drawings read then: a
frame of a cut scene runs the same passes as any other, over fewer splats.
"""

import numpy as np

from shapeshift.renderer.colors.color_cache import forget_colors
from shapeshift.renderer.decoded_object import DecodedObject
from shapeshift.renderer.drawing import Drawing
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.sections.cut import ObjectCut, cut_splats, cuts_of, moves_splats


def restore_shapes(drawing: Drawing, i: int, decoded: DecodedObject) -> None:
    """Before its geometry is decoded anew: places and shapes that a cut has changed come back,
    which decoding of plain splats leaves alone.
    """
    if decoded.own is not None and moves_splats(decoded.cuts):
        drawing.write_splats(i, *decoded.own)
        forget_colors(decoded.colored)
    decoded.own, decoded.cuts, decoded.opacity = None, (), 1.0


def place_splats(drawing: Drawing, i: int, obj: SceneObject, decoded: DecodedObject) -> None:
    """Its splats as opaque as its appearance says, cut by its sections; nothing where they are."""
    opacity, cuts = obj.appearance.opacity, cuts_of(obj.sections, obj.world_from_object)
    if (decoded.opacity, decoded.cuts) == (opacity, cuts):
        return
    if decoded.own is None:
        decoded.own = drawing.read_splats(i)
    mean_opacity, covariance = cut_splats(*decoded.own, cuts)
    if opacity != 1:
        mean_opacity[:, 3] *= np.float32(opacity)
    shapes_differ = moves_splats((*cuts, *decoded.cuts))
    drawing.write_splats(i, mean_opacity, covariance if shapes_differ else None)
    if cuts != decoded.cuts:
        recolor(obj, decoded, cuts)
    decoded.opacity, decoded.cuts = opacity, cuts
    if not cuts and opacity == 1:
        decoded.own = None


def recolor(obj: SceneObject, decoded: DecodedObject, cuts: tuple[ObjectCut, ...]) -> None:
    """Which anchors can be seen is another question now; harmonics are seen along other lines where
    means have moved.
    """
    for colored in decoded.colored:
        colored.reach = colored.reach_key = None
    moved = moves_splats((*cuts, *decoded.cuts))
    if moved and isinstance(obj.model, SplatLayers) and obj.model.sh.shape[1] > 1:
        forget_colors(decoded.colored)
