"""What is open: one model, or the objects of a scene file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.command_line import nearest
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import ReadingOptions, open_model
from shapeshift.runtime_models.model import Model, Stop
from shapeshift.runtime_models.stop_weights import Control, Pace, StopWeights, parse_control
from shapeshift.scene.appearance import Background, Color, behind_of
from shapeshift.scene.cameras.framing import (
    default_background,
    default_view,
    frame_points,
    scene_points,
)
from shapeshift.scene.document.scene_file import SceneFile, first_view, is_scene_file, scene_of
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import IDENTITY, Scene, SceneObject
from shapeshift.scene.sections.section import carried_section
from shapeshift.scene.selectors.selector import carried

if TYPE_CHECKING:
    from shapeshift.scene.cameras.camera_list import CameraList


BLACK = (0.0, 0.0, 0.0)
DARK = (0.075, 0.078, 0.085)  # display sRGB: what the window and the headset have behind objects


@dataclass(frozen=True)
class Document:
    """A scene as it opened: objects with models, a first view, a background, bounds.

    Commands draw and measure it, the headset makes a world of it, the window edits its file.
    """

    scene: Scene  # each object at its own x
    file: SceneFile | None = None  # None: one model, where it is

    @staticmethod
    def of(model: Model, x: float | None = None) -> "Document":
        """One model at x; None: its first stop."""
        x = model.stops[0].x if x is None else x
        return Document(Scene((SceneObject("scene", model, x=x),)))

    @property
    def models(self) -> tuple[Model, ...]:
        """Each once, in the order of the objects."""
        return tuple({id(obj.model): obj.model for obj in self.scene.objects}.values())

    @property
    def stops(self) -> tuple[float, ...]:
        """Every x at which an object rests, rising."""
        xs = {stop.x for model in self.models for stop in model.stops}
        items = self.file.all_items if self.file else ()
        states = {s.x for i in items for s in i.states if not isinstance(s.x, StopWeights)}
        return tuple(sorted(xs | states))

    @property
    def x(self) -> Control | None:
        """The control value of all that shows; None where objects have several."""
        found = {obj.x for obj in self.scene.objects if obj.visible}
        return found.pop() if len(found) == 1 else None

    @property
    def origin(self) -> np.ndarray:
        """(3,) float64 metres: where zero lies in the world of the model's file and its cameras."""
        alone = None if self.file else self.scene.objects[0].model
        return np.array(getattr(alone, "origin", (0.0, 0.0, 0.0)), np.float64)

    @property
    def background(self) -> Background:
        """Behind everything: the sky, what the first model was trained before, else black."""
        return self.background_or(BLACK)

    def background_or(self, otherwise: Color) -> Background:
        """The same, else `otherwise`: display sRGB."""
        behind = behind_of(self.file.sky) if self.file else None
        if behind is not None or not self.scene.objects:
            return behind or otherwise
        return default_background(self.scene.objects[0].model, otherwise)

    @property
    def floor_y(self) -> float | None:
        """Metres, world; None: the scene says nothing about a floor."""
        return self.file.floor_y if self.file else None

    def at(self, x: Control | None, pose: Pose = IDENTITY) -> Scene:
        """All objects at x (None: each at its own), the world moved by a pose."""
        objects = self.scene.objects
        if x is not None:
            objects = tuple(replace(obj, x=x) for obj in objects)
        if pose is not IDENTITY:
            objects = tuple(moved_object(obj, pose) for obj in objects)
        return Scene(objects)

    def placed(self, text: str, said: str = "--x") -> "Document":
        """The same with all objects where `control_of_text` has their sliders; of a scene file,
        objects that have no such stop or state stay.  Raises UsageError.
        """
        items = self.file.all_items if self.file else ()
        states = {item.name: item.states for item in items}
        return replace(self, scene=Scene(placed(self.scene.objects, text, said, states)))

    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """World points (N, 3) and opacity (N,) that stand for what shows."""
        return scene_points(self.scene)

    def bounds(self) -> tuple[np.ndarray, float]:
        """Centre (3,) and radius, metres."""
        return frame_points(*self.points())

    def view(self, size: tuple[int, int]) -> View:
        """The first look at it."""
        if self.file:
            return first_view(self.file, self.scene, size)
        return default_view(self.scene.objects[0].model, size)

    def sees(self, cameras: "CameraList") -> "CameraList":
        """Cameras of the file's world where the scene is."""
        from shapeshift.scene.cameras.camera_list import moved

        return replace(cameras, views=tuple(moved(cameras.views, (-self.origin).tolist())))


def placed(
    objects: Sequence[SceneObject], text: str, said: str = "--x",
    states: Mapping[str, Sequence] = MappingProxyType({}),
) -> tuple[SceneObject, ...]:  # fmt: skip
    """Objects with their sliders where a text says, those that have the stop that it names.

    states: of a scene file, by object.  Raises UsageError where no object has it.
    """
    stops = [
        [*obj.model.stops, *(Stop(s.name, s.x) for s in states.get(obj.name, ()))]
        for obj in objects
    ]
    known = {stop.name: stop for each in reversed(stops) for stop in reversed(each)}
    control_of_text(text, list(known.values())[::-1], said)  # one sentence for all of them
    out = []
    for obj, mine in zip(objects, stops, strict=True):
        try:
            out.append(replace(obj, x=control_of_text(text, mine, said, pace_of(obj.model))))
        except UsageError:  # a stop that others have
            out.append(obj)
    return tuple(out)


def file_at(file: SceneFile, models: dict[str, Model], text: str) -> SceneFile:
    """The file with each object's x where a text says, of those that have such a stop or state.

    Raises UsageError where none has.
    """
    from shapeshift.scene.document import edits

    states = {item.name: item.states for item in file.all_items}
    for obj in placed(scene_of(file, models).objects, text, states=states):
        file = edits.change(file, obj.name, x=obj.x)
    return file


def pace_of(model: Model) -> tuple[Pace, ...]:
    """How fast the model's stops are mixed into each other, where it says so."""
    return getattr(model, "pace", ())


def control_of_text(
    text: str, stops: Sequence[Stop], said: str = "--x", pace: tuple[Pace, ...] = ()
) -> Control:
    """What `parse_control` reads; of stops whose names differ in case alone, the one spelt so.

    Raises UsageError that begins with `said`.
    """
    word = text.strip()
    alike = {s.name: s for s in reversed(stops) if s.name.casefold() == word.casefold()}
    if len(alike) > 1 and word not in alike:
        raise UsageError(f"{said}: '{word}' may be {' or '.join(alike)}; spell it as it is.")
    if alike:
        return alike[word if word in alike else next(iter(alike))].x
    ends = [stop for stop in stops if not isinstance(stop.x, StopWeights)]  # of ways and blends
    try:
        return parse_control(word, ends, pace)
    except ValueError as error:
        dated = word[4:5] == "-" and any(stop.date for stop in ends)
        raise UsageError(f"{said}: {error if dated else no_control(word, stops)}") from None


def no_control(word: str, stops: Sequence[Stop]) -> str:
    """What is said of a text that `parse_control` does not read."""
    names = [stop.name for stop in stops]
    meant = nearest(word, names)
    way = f" or a way such as {names[0]}..{names[-1]}:0.5" if len(names) > 1 else ""
    return (
        f"'{word[:60]}' is no x of this scene; expected a number from 0 to 1, a stop "
        f"({', '.join(names) or 'it has none'}){way}{f'; did you mean {meant}?' if meant else '.'}"
    )


def moved_object(obj: SceneObject, world_from_before: Pose) -> SceneObject:
    """An object, with its parts, after its world is moved."""
    pose = Pose.from_matrix(world_from_before.matrix() @ obj.world_from_object.matrix())
    parts = tuple(carried(selector, world_from_before) for selector in obj.selectors)
    cuts = tuple(carried_section(one, world_from_before) for one in obj.sections)
    return replace(obj, world_from_object=pose, selectors=parts, sections=cuts)


def open_document(path: Path, options: ReadingOptions) -> Document:
    """A model or a scene file; progress and findings go to stderr.  Raises BadFile, UsageError."""
    if not is_scene_file(path):
        return Document.of(open_model(path, options))
    from shapeshift.app.scene_files import open_scene_file

    file, _, scene = open_scene_file(path, options)
    if not scene.objects:
        from shapeshift.runtime_models.model import BadFile

        raise BadFile(f"{path} has no object; nothing is there to be drawn.")
    return Document(scene, file)
