"""Which level of detail each object is drawn at, by the pixels that its bounds have on screen, and
what a stream of splats brings into the arena."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from operator import is_

import numpy as np

from shapeshift.rasterizer.pages import PAGE
from shapeshift.renderer.colors.color_cache import ColorCache, centre_of, forget_colors
from shapeshift.renderer.decoded_object import DecodedObject, place_splats
from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.settings import StreamStats
from shapeshift.renderer.streaming.stream import Stream, has_leaves
from shapeshift.renderer.timing import PassTimer
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


# A stream's splats into the arena, and what a look, a cut or a tint makes of them again.


class Streaming:
    """The part of a renderer that deals with models in levels of detail; idle without any."""

    def __init__(self, drawing: Drawing) -> None:
        self._drawing = drawing
        self.stream: Stream | None = None
        self.converges = True  # a frame waits for all that it wants; False: it is one of many
        self.reads = True  # levels that are not at hand; False: the coarsest, and what is at hand

    def allocate(self, models: list[Model], budget: int) -> None:
        """Room for these objects in the drawing, none where they do not fit.  budget: 0 for the
        models' own.

        Raises ValueError, as BadFile where the budget leaves nothing for levels of detail.
        """
        self.close()
        try:
            if any(map(has_leaves, models)):
                self.stream = Stream(self._drawing, models, budget)
            else:
                self._drawing.allocate(models)
        except ValueError:
            self._drawing.allocate([])
            raise

    def differs(self, budget: int) -> bool:
        """Whether room was made for another budget."""
        return self.stream is not None and budget not in (0, self.stream.budget)

    @property
    def stats(self) -> StreamStats | None:
        """Of the last frame."""
        return self.stream.stats if self.stream is not None else None

    @property
    def due(self) -> bool:
        """Whether another frame of the same views would show more."""
        return self.stream is not None and self.stream.due

    def follow(
        self, scene: Scene, poses: np.ndarray, decoded: Sequence[DecodedObject],
        views: Sequence[View], timer: PassTimer,
    ) -> None:  # fmt: skip
        """What the views want is there afterwards, or on its way.  Raises BadFile.

        poses: (O, 4, 4) world_from_object of all objects, hidden ones, too.
        """
        if self.stream is not None:
            self.stream.converges = self.converges and self.reads
            self.stream.reads = self.reads
            with timer.time("stream", on_gpu=False):
                follow(self._drawing, self.stream, scene, poses, decoded, views)

    def close(self) -> None:
        if self.stream is not None:
            self.stream.close()
        self.stream = None


def follow(
    drawing: Drawing, stream: Stream, scene: Scene, poses: np.ndarray,
    decoded: Sequence[DecodedObject], views: Sequence[View],
) -> None:  # fmt: skip
    """Asks the stream, and gives what changed the look that its object has."""
    cut = [i for i in stream.objects if decoded[i].own is not None]
    before = {i: drawing.pages_of(i) for i in cut}
    stream.edit(cut)
    for i in stream.follow(scene, poses, views):
        obj, each = scene.objects[i], decoded[i]
        if i in before:
            keep_own(drawing, i, each, before[i], stream.placed)
            place_splats(drawing, i, obj, each)
        tinted = any(colored.untinted for colored in each.colored)
        if stream.follows_eye or each.grade is not None or tinted or obj.tint is not None:
            for colored in each.colored:
                colored.tint, colored.untinted = None, ()  # what lay under it lies elsewhere now
            forget_colors(each.colored)


def keep_own(
    drawing: Drawing, i: int, decoded: DecodedObject, before: np.ndarray, placed: np.ndarray
) -> None:
    """Makes `decoded.own` that of the pages which object i has now.

    before: the pages that it had; placed: those that were filled since, with splats as decoded.
    """
    assert decoded.own is not None
    pages = drawing.pages_of(i)
    own = drawing.read_splats(i)
    stay = np.isin(pages, before) & ~np.isin(pages, placed)
    at = np.searchsorted(before, pages[stay])
    for now, old in zip(own, decoded.own, strict=True):
        shape = (-1, PAGE, now.shape[1])
        now.reshape(shape)[stay] = old.reshape(shape)[at]
    decoded.own, decoded.cuts, decoded.opacity = own, (), 1.0
