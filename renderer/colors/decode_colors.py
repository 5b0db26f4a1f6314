"""Runs one set of colours of all objects, where an eye moved or another look is asked for."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from shapeshift.renderer.colors.color_cache import (
    ColorCache,
    EyeColors,
    color_key,
    forget_colors,
    reach_of,
    reach_of_scaffold,
    shared_is_enough,
    visible_anchors,
)
from shapeshift.renderer.colors.false_colors import (
    BESIDE,
    PICTURE,
    FalseColors,
    Shade,
    false_colors,
)
from shapeshift.renderer.decoded_object import DecodedObject, place_splats, restore_shapes
from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.evaluate import follows_eye, shape_follows_control
from shapeshift.runtime_models.model import ScaffoldModel, SplatLayers
from shapeshift.runtime_models.stop_weights import same_controls
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.control import control_of
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject, Tint
from shapeshift.scene.sections.cut import cuts_of

# Two scenes that differ in their colours alone: drawn from one projection and one sort.

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


def decode_colors(
    drawing: Drawing, settings: RenderSettings, objects: list[DecodedObject], which: int,
    views: list[View], scene: Scene, looks: list[Look], at_once: bool,
) -> tuple[int, int]:  # fmt: skip
    """Set `which`, that the drawing decodes into, for the middle of some eyes, where it moved.

    And the geometry of those that follow the eye: as often.  Returns how often geometry and colours
    ran.
    """
    eye_world = np.mean([v.world_from_eye.position for v in views], axis=0)
    degrees, ran = settings.recolor_degrees, [0, 0]
    for i, (obj, decoded) in enumerate(zip(scene.objects, objects, strict=True)):
        if not obj.seen:
            continue
        colored = decoded.colored[which]
        if colored.is_done and obj.tint is colored.tint:
            continue  # a thousand copies are asked every frame
        object_from_world = np.linalg.inv(obj.world_from_object.matrix())
        eye = object_from_world[:3, :3] @ eye_world + object_from_world[:3, 3]
        key = color_key(obj.model, decoded.version, eye)
        stale = colored.is_stale(key, degrees, nearer=follows_eye(obj.model))
        follows = follows_eye(obj.model)
        if follows:
            due, wanted = wanted_of_follower(settings, obj, colored, stale, views)
            if due:
                colored.key, colored.anchors = key, wanted
        else:
            if isinstance(obj.model, SplatLayers):
                looked = looks[i][0].heats or looks[i][1] or obj.tint or colored.tint
                asked = not looked and (stale or colored.anchors is not None)
                seen = drawing.seen_splats(i, views, settings) if asked else None
                wanted = wanted_splats(colored, stale, seen)
            else:
                wanted = wanted_anchors(drawing, settings, i, obj, decoded, colored, stale, views)
            due = colored.mark_colored(key, wanted, stale)  # else all seen have their colours
        if not due and obj.tint is colored.tint:
            continue
        with tinted(drawing, i, obj, colored):
            if due and follows:
                restore_shapes(drawing, i, decoded)
                drawing.decode_geometry(i, decoded.x, eye, wanted)
                ran[0] += 1
                place_splats(drawing, i, obj, decoded)
            if due:
                shade, grade = looks[i]
                drawing.decode_color(i, shade, eye, wanted, at_once, grade)
                ran[1] += 1
    return ran[0], ran[1]


# Which anchors get colours for a frame, those that a view sees; and whether each view its own.


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


# tint: a colour over the decoded ones, row by row, which come back when it goes.
#
# No network runs for it: what lies under a tint is kept, and mixed anew when the tint changes.


@contextmanager
def tinted(drawing: Drawing, i: int, obj: SceneObject, colored: ColorCache) -> Iterator[None]:
    """In the body the colours of object i, in the set in use, are its own; after it with its tint.

    The body decodes them, or does nothing where only the tint is another one.
    """
    lift(drawing, i, colored)
    yield
    if obj.tint is not None:
        lay(drawing, i, obj.tint, colored)


def lift(drawing: Drawing, i: int, colored: ColorCache) -> None:
    """Gives the rows under the tint their own colours back."""
    if colored.untinted:
        rows, own_color, own_heat = colored.untinted
        color, heat = drawing.read_colors(i)
        color[rows] = own_color
        if heat is not None and own_heat is not None:
            heat[rows] = own_heat
        drawing.replace_colors(i, color, heat)
    colored.tint, colored.untinted = None, ()


def lay(drawing: Drawing, i: int, tint: Tint, colored: ColorCache) -> None:
    """Mixes the tint in, and keeps what lies under it; heat fades as the colour beside it does."""
    color, heat = drawing.read_colors(i)
    strength = per_splat(np.atleast_1d(tint.strength), len(color))  # (n,)
    rows = np.flatnonzero(strength > 0)
    colored.tint = tint
    if not len(rows):
        return
    own_heat = None if heat is None else heat[rows]
    colored.untinted = (rows, color[rows], own_heat)
    color, heat = mixed(color, heat, rows, strength[rows, None], tint)
    drawing.replace_colors(i, color, heat)


def mixed(
    color: np.ndarray, heat: np.ndarray | None, rows: np.ndarray, share: np.ndarray, tint: Tint
) -> tuple[np.ndarray, np.ndarray | None]:
    """color (n, 3) and heat (n, 4) with the rows (m,) mixed with the tint by their share (m, 1)."""
    over = per_splat(np.atleast_2d(np.asarray(tint.color, np.float32)), len(color))[rows]
    color = color.copy()
    color[rows] = (1 - share) * color[rows] + share * over
    if heat is not None:
        heat = heat.copy()
        heat[rows] *= 1 - share
    return color, heat


def per_splat(values: np.ndarray, count: int) -> np.ndarray:
    """(count, ...) float32 of values one an anchor, or of one for all."""
    values = values.astype(np.float32)
    return np.repeat(values, -(-count // len(values)), axis=0)[:count] if len(values) else values
