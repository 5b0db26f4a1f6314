"""Splats as an object's sections and its opacity leave them, put into the arena.

It happens where a section, a pose or x has changed, on the splats that both drawings read then: a
frame of a cut scene runs the same passes as any other, over fewer splats.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.renderer.colors.color_cache import ColorCache, EyeColors, forget_colors
from shapeshift.renderer.colors.false_colors import Shade
from shapeshift.renderer.drawing import Drawing
from shapeshift.runtime_models.model import Model, SplatLayers
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.sections.cut import ObjectCut, cut_splats, cuts_of, moves_splats

# What of an object lies decoded in the arena; renderer.py keeps one an object.

BESIDE_SET = 2  # of colours, behind those of two eyes
NO_SHADE = Shade(None)  # nothing is decoded yet


@dataclass
class DecodedObject:
    """What of an object lies in the arena now."""

    model: Model
    colored: list[ColorCache]  # one for all views of a frame, or one a view
    key: tuple | None = None  # control_key of x; None: not decoded yet
    x: Controls = 0.0  # of its geometry
    version: int = 0  # goes up with every other x
    shade: Shade = NO_SHADE  # which colours are decoded
    grade: Appearance | None = None  # of its colours; None: they are as decoded
    second: tuple[Shade, Appearance | None] | None = None  # the same of a second set of colours
    opacity: float = 1.0  # times that of its splats
    beside: tuple[Shade, Appearance | None] | None = None  # of the one for `Renderer.draw_beside`
    own: tuple[np.ndarray, np.ndarray] | None = None  # mean_opacity (n, 4) and covariance (n, 8) as
    #                                                   decoded, while it is shown otherwise
    cuts: tuple[ObjectCut, ...] = ()  # what of `own` lies in the arena
    look: EyeColors | None = None  # made for the first pair of eyes

    def look_beside(self, look: tuple[Shade, Appearance | None]) -> None:
        """Forgets the colours of `draw_beside` where they are for another look."""
        while len(self.colored) <= BESIDE_SET:
            self.colored.append(ColorCache(self.colored[0].centre))
        before = self.beside
        if before is None or not before[0].same(look[0]) or before[1] != look[1]:
            forget_colors([self.colored[BESIDE_SET]])
        self.beside = look


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
