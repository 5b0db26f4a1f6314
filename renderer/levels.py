"""Which level of detail each object is drawn at: by the pixels that its bounds have on screen."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from operator import is_

import numpy as np

from shapeshift.renderer.colors.color_cache import ColorCache, centre_of
from shapeshift.renderer.decoded_object import DecodedObject
from shapeshift.renderer.drawing import Drawing
from shapeshift.runtime_models.model import AnchorModel, Model
from shapeshift.scene.cameras.framing import frame_points
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import Painted

HYSTERESIS = 1.15  # times the size from which a level is drawn: larger, it is left again

Bounds = tuple[np.ndarray, float]  # centre (3,) and radius, metres


class LevelChoice:
    """The levels of the objects of one scene, kept from frame to frame."""

    def __init__(self) -> None:
        self._models: list[Model] = []  # of the objects that the levels are of
        self._whole = False  # all is drawn at level 0
        self._bounds: list[Bounds | None] = []  # of each; None: it has no levels
        self.levels: tuple[int, ...] = ()  # of each the one that it is drawn at; 0: all there is

    def begin(self, scene: Scene) -> None:
        """A scene to be drawn next.  What comes new begins at its coarsest level, until `choose`
        knows the views.
        """
        models = [obj.model for obj in scene.objects]
        if len(models) == len(self._models) and all(map(is_, models, self._models)):
            return
        known = zip(self._models, self.levels, self._bounds, strict=True)
        before = {id(model): (level, bounds) for model, level, bounds in known}
        for model in models:
            if id(model) not in before:
                before[id(model)] = (len(levels_of(model)) - 1, bounds_of(model))
        self.levels = tuple(before[id(model)][0] for model in models)
        self._bounds = [before[id(model)][1] for model in models]
        self._models = models

    def shown(self, scene: Scene) -> Scene:
        """The scene that `begin` was given, or one of the same models, each object at its level."""
        if self._whole or not any(self._bounds):
            return scene
        pairs = zip(scene.objects, self.levels, strict=False)
        return Scene(tuple(at_level(obj, level) for obj, level in pairs))

    @contextmanager
    def all_whole(self) -> Iterator[None]:
        """Within it all is drawn at level 0, from the next `update` on: for who measures."""
        self._whole = True
        try:
            yield
        finally:
            self._whole = False

    def choose(self, scene: Scene, views: list[View]) -> bool:
        """Looks at the same scene from all eyes of a frame; whether an object is to be drawn at
        another level than before.
        """
        if self._whole:
            return False
        before = self.levels
        rows = zip(scene.objects, self._bounds, before, strict=True)
        self.levels = tuple(
            choose_level(obj.model, object_pixels(obj, bounds, views), level)
            if bounds is not None and obj.seen
            else level
            for obj, bounds, level in rows
        )
        return self.levels != before


def exchange_levels(
    drawing: Drawing, before: list[DecodedObject], scene: Scene
) -> list[DecodedObject]:
    """The objects of a scene of which some have another level; the others stay decoded."""
    models = [obj.model for obj in scene.objects]
    try:
        kept = drawing.exchange(models)
    except ValueError:  # a finer level does not fit
        drawing.allocate([])
        raise
    fresh = decoded_objects(models)
    return [before[i] if kept[i] else fresh[i] for i in range(len(models))]


def decoded_objects(models: list[Model]) -> list[DecodedObject]:
    """Of each model one that is not decoded yet."""
    return [DecodedObject(model, [ColorCache(centre_of(model))]) for model in models]


def has_levels(model: Model) -> bool:
    return isinstance(model, AnchorModel) and bool(model.coarser)


def levels_of(model: Model) -> tuple[Model, ...]:
    return model.levels if isinstance(model, AnchorModel) else (model,)


def at_level(obj: SceneObject, level: int) -> SceneObject:
    """The object as it is drawn; whole where anchors of it are marked or painted one by one."""
    if not level or not has_levels(obj.model) or is_marked(obj):
        return obj
    return replace(obj, model=levels_of(obj.model)[level])


def is_marked(obj: SceneObject) -> bool:
    """Whether something of it has a number for each of its anchors."""
    tint = obj.tint
    tinted = tint is not None and (np.ndim(tint.color) > 1 or np.ndim(tint.strength) > 0)
    return tinted or any(isinstance(selector, Painted) for selector in obj.selectors)


def choose_level(model: Model, pixels: float, now: int) -> int:
    """The coarsest level that is good for an object of so many pixels.

    A finer one than `now` only where the object is larger by HYSTERESIS than what `now` is for.
    """
    assert isinstance(model, AnchorModel), "only packages have levels"
    level = 0
    for number, coarser in enumerate(model.coarser, 1):
        slack = HYSTERESIS if number <= now else 1.0
        if pixels <= coarser.from_pixels * slack:  # NaN keeps what is finer
            level = number
    return level


def object_pixels(obj: SceneObject, bounds: Bounds, views: list[View]) -> float:
    """The diameter of an object's bounds in the view that has it largest, pixels; inf from within.

    Towards the edges perspective draws what is as far away larger; here it counts as in the middle.
    """
    centre, radius = bounds
    pose = obj.world_from_object.matrix()
    place, most = pose[:3, :3] @ centre + pose[:3, 3], 0.0
    for view in views:
        away = math.dist(place, view.world_from_eye.position)
        if not away > radius:
            return math.inf
        left, right, down, up = view.tangents
        a_tangent = max(view.size[0] / (right - left), view.size[1] / (up - down))
        most = max(most, 2 * radius / away * a_tangent)
    return most


def bounds_of(model: Model) -> Bounds | None:
    """Centre (3,) and radius of a package with levels, metres in its frame."""
    if not has_levels(model):
        return None
    assert isinstance(model, AnchorModel), "no other has levels"
    return frame_points(model.anchors, np.ones(len(model.anchors), np.float32))
