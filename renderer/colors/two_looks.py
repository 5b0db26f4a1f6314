"""Two scenes that differ in their colours alone: drawn from one projection and one sort."""

from dataclasses import replace

import numpy as np

from shapeshift.renderer.colors.color_cache import ColorCache, forget_colors
from shapeshift.renderer.colors.false_colors import (
    BESIDE,
    PICTURE,
    FalseColors,
    Shade,
    false_colors,
)
from shapeshift.renderer.decoded_object import DecodedObject
from shapeshift.runtime_models.evaluate import follows_eye, shape_follows_control
from shapeshift.runtime_models.stop_weights import same_controls
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.control import control_of
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.sections.cut import cuts_of

Look = tuple[Shade, Appearance | None]  # which colours are decoded, and how they are graded


def same_shape(one: Scene, other: Scene) -> bool:
    """Whether splats are in the same places, as large and as opaque, in both scenes."""
    pairs = zip(one.objects, other.objects, strict=False)
    return len(one.objects) == len(other.objects) and all(_alike(a, b) for a, b in pairs)


def _alike(a: SceneObject, b: SceneObject) -> bool:
    if a.model is not b.model or a.seen != b.seen or follows_eye(a.model):
        return False
    matrices = (a.world_from_object.matrix(), b.world_from_object.matrix())
    if a.appearance.opacity != b.appearance.opacity or not np.array_equal(*matrices):
        return False
    if cuts_of(a.sections, a.world_from_object) != cuts_of(b.sections, b.world_from_object):
        return False
    return not shape_follows_control(a.model) or same_controls(control_of(a), control_of(b))


def two_false_colors(one: Scene, other: Scene) -> list[FalseColors]:
    """How the colours of each come about: in one frame, where heat is drawn beside all or none."""
    pairs = [(scene, [control_of(obj) for obj in scene.objects]) for scene in (one, other)]
    found = [false_colors(*pair) for pair in pairs]
    if {BESIDE, PICTURE} <= {colors.way for colors in found}:
        found = [false_colors(*pair, as_picture=False) for pair in pairs]
    return found


def grade_of(obj: SceneObject, colors: FalseColors) -> Appearance | None:
    """What is done to an object's colours; None: nothing.  A palette is laid over values as they
    were measured.
    """
    if obj.appearance.keeps_colors or colors.way == PICTURE:
        return None
    return replace(obj.appearance, opacity=1.0)


def looks_of(scene: Scene, colors: FalseColors) -> list[Look]:
    """Of each object."""
    pairs = zip(scene.objects, colors.shades, strict=True)
    return [(shade, grade_of(obj, colors)) for obj, shade in pairs]


def prepare_two(decoded: list[DecodedObject], looks: tuple[list[Look], list[Look]]) -> None:
    """Two sets of colours an object; those that are for another look are forgotten."""
    for i, each in enumerate(decoded):
        each.colored = [*each.colored[:2]]
        if len(each.colored) < 2:
            each.colored.append(ColorCache(each.colored[0].centre))
        befores = ((each.shade, each.grade), each.second)
        for which, before in enumerate(befores):
            now = looks[which][i]
            if before is None or not before[0].same(now[0]) or before[1] != now[1]:
                forget_colors([each.colored[which]])
        (each.shade, each.grade), each.second = looks[0][i], looks[1][i]


def take_looks(
    decoded: list[DecodedObject], scene: Scene, colors: FalseColors, same_way: bool
) -> None:
    """Which colours each object is decoded in; those that are for another look are forgotten.

    same_way: whether heat came about as it does now.
    """
    for each, shade, obj in zip(decoded, colors.shades, scene.objects, strict=True):
        grade = grade_of(obj, colors)
        if not (same_way and shade.same(each.shade) and grade == each.grade):
            each.shade, each.grade = shade, grade
            forget_colors(each.colored)
