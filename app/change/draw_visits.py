"""Two visits, each drawn from where it was photographed: colours, depths, degrees."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.draw_values import (
    MeasuredScene,
    ValueChoice,
    draw_values,
    measured_scene,
)
from shapeshift.renderer.surface import SOLID
from shapeshift.runtime_models.eyes import eyes_of, looks_of
from shapeshift.runtime_models.model import Model, Stop
from shapeshift.scene.cameras.framing import fit_distance, view_from
from shapeshift.scene.cameras.own_cameras import FAR, NEAR
from shapeshift.scene.change.places import LEAST_VIEWS
from shapeshift.scene.change.seen import SeenSide, SeenVisit
from shapeshift.scene.change.similarity import Similarity
from shapeshift.scene.pose import MOST_SIDE, Pose, View
from shapeshift.scene.scene import Scene

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

Progress = Callable[[str, float], None]  # what is done, part 0..1
FOV_Y = 0.75  # radians
# Elevations in degrees, and cameras around at each: as things are photographed that stand.
MOST_VIEWS = 32  # of the photos' places: more say little that is new
SAME_EYE = 1e-3  # of the way between the farthest cameras: so near, it is the same one
RINGS = ((12.0, 10), (34.0, 10), (60.0, 6))


@dataclass(frozen=True, eq=False)
class Visit:
    """One scene that is compared."""

    document: Document
    photo: Stop | None  # that its colours and shapes are drawn at; None: it has values alone
    measured: MeasuredScene | None  # None: no value stop

    @property
    def shape(self) -> Scene:
        """What depths are drawn of."""
        if self.photo is not None:
            return self.document.placed(self.photo.name).scene
        assert self.measured is not None
        return self.measured.scene


def visit_of(
    document: Document, name: str, stop: str = "", value_range=None, values: str = ""
) -> Visit:
    """A scene with the stops that are compared.  stop: the one of colours; "": the first that is
    not measured.  value_range: of the value stop, where the scene has none.
    values: the stop whose values are; "": the first thermal one, else the first of others.  Raises
    UsageError.
    """
    if document.file is not None:
        raise UsageError(f"{name} is a scene file of objects; change compares two models.")
    stops = document.models[0].stops
    photos = [each for each in stops if not each.is_measured]
    if stop:
        photos = [each for each in stops if each.name.casefold() == stop.casefold()]
        if not photos:
            names = ", ".join(each.name for each in stops)
            raise UsageError(f"{name} has no stop '{stop}'; it has {names}.")
    measured = None
    hot = sorted((s for s in stops if s.has_false_colors), key=lambda s: not s.is_heat)
    if values:
        hot = [each for each in hot if each.name.casefold() == values.casefold()]
        if not hot:
            raise UsageError(f"{name} has no stop '{values}' of values with a palette.")
    if hot:
        if hot[0].value_range is None and value_range is None:
            raise UsageError(
                f"the stop '{hot[0].name}' of {name} does not say which values black and white "
                "stand for; say it: --range LOW HIGH."
            )
        measured = measured_scene(document, ValueChoice(hot[0].name, value_range))
    if not photos and measured is None:
        raise UsageError(f"{name} has no stop whose values or colours could be compared.")
    return Visit(document, photos[0] if photos else None, measured)


def rings_around(centre: np.ndarray, radius: float, size: tuple[int, int]) -> list[View]:
    """Views from above the horizon all around, each of the whole."""
    views, distance = [], fit_distance(radius, size, FOV_Y)
    for number, (degrees, count) in enumerate(RINGS):
        level, height = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        for i in range(count):
            turn = 2 * np.pi * (i + number / len(RINGS)) / count
            way = np.array([level * np.sin(turn), height, level * np.cos(turn)])
            views.append(view_from(centre + distance * way, centre, radius, size, FOV_Y))
    return views


def photographed_views(model: Model, size: tuple[int, int]) -> list[View]:
    """From where a model's photos were taken, at most MOST_VIEWS, far from one another, with as
    many pixels as a size (W, H); none: it does not say.
    """
    views = []
    for eye, look in list(zip(eyes_of(model), looks_of(model), strict=False))[:MOST_VIEWS]:
        left, right, down, up = map(float, look[4:])
        width = np.sqrt(size[0] * size[1] * (right - left) / (up - down))
        sides = (max(round(width), 1), max(round(size[0] * size[1] / width), 1))
        if max(sides) > MOST_SIDE:
            continue  # a slit
        pose = Pose(eye, look[:4] / np.linalg.norm(look[:4]))
        views.append(View(pose, (left, right, down, up), NEAR, FAR, sides))
    return views


def own_views(
    visit: Visit, given: list[View] | None, size: tuple[int, int]
) -> tuple[list[View], bool]:
    """From where to look at a visit, in its own world, and whether its photos were taken from
    there: what it says itself, those of the given where it was photographed, all given, or rings.
    """
    model = visit.document.models[0]
    if views := photographed_views(model, size):
        return views, True
    if given is None:
        return rings_around(*visit.document.bounds(), size), False
    eyes, at = eyes_of(model), np.array([view.world_from_eye.position for view in given])
    if len(eyes):
        off = np.linalg.norm(at[:, None] - eyes, axis=2).min(axis=1)
        own = np.flatnonzero(off <= SAME_EYE * np.ptp(eyes, axis=0).max())
        if len(own) >= LEAST_VIEWS:
            return [given[i] for i in own[:MOST_VIEWS]], True
    return given, False


def see(
    renderer: "Renderer", visit: Visit, views: tuple[list[View], bool], a_from_own: Similarity,
    heat: bool, what: str, progress: Progress,
) -> SeenVisit:  # fmt: skip
    """A visit drawn in views of its own world; heat: with its values.  what: it is called to
    progress.
    """
    sides = []
    shape = visit.shape
    for i, view in enumerate(views[0]):
        progress(f"drawing {what}", i / len(views[0]))
        renderer.update(shape)
        renderer.draw([view])
        rgba = renderer.image(0).astype(np.float64)
        color = rgba[..., :3] / np.maximum(rgba[..., 3:], 1e-6)
        depth = renderer.surface(view).depth(SOLID).astype(np.float64)
        sides.append(SeenSide(np.clip(color, 0, 1), rgba[..., 3], depth))
    if heat and visit.measured is not None:
        for i, view in enumerate(views[0]):
            progress(f"drawing the heat of {what}", i / len(views[0]))
            seen = draw_values(renderer, visit.measured, view)
            sides[i] = replace(sides[i], value=seen.values)
    return SeenVisit(views[0], sides, a_from_own, views[1])
