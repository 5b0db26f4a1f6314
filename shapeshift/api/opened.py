"""A scene that was opened, as a library has it: what is in it, and other scenes made of it."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from shapeshift.api.arguments import DEFAULT_SIZE, X
from shapeshift.api.edit import changed, describe, regions_of, sections_from, stops_of
from shapeshift.api.objects import SceneObjects
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.model import Finding, Model, Stop
from shapeshift.runtime_models.stop_weights import Control, StopWeights
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.document import edits
from shapeshift.scene.scene import Scene as DrawnScene
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.sections.section import SceneSection
from shapeshift.scene.selectors.selector import Selector


class OpenedScene:
    """What is in a `Scene`, without what draws, writes and measures it: those read it."""

    def __init__(
        self, subject: Document, path: Path | None = None, *, up: str = "", flip: bool = False
    ) -> None:
        self._subject = subject
        self.turned = (up, flip)  # as `load` was given them: cameras of its world are, too
        self.path = path  # what it was read from; None: it was made

    def __repr__(self) -> str:
        names = ", ".join(stop.name for stop in self.stops)
        where = f" of {self.path.name}" if self.path else ""
        parts = f"{len(self.objects)} objects, " if len(self.objects) > 1 else ""
        return f"<Scene{where}: {parts}{self.splat_count:,} splats, stops {names or 'none'}>"

    # ---- what is in it

    @property
    def objects(self) -> SceneObjects[Self]:
        """A tuple of objects, each with name, model, world_from_object (Pose, metres), x, label,
        visible and selectors; by its name one that gives scenes in which it is elsewhere.

            [obj.name for obj in ss.load("room.scene.json").objects]
            scene.objects["mug"].move(by=(0, 0.2, 0)).render()
        """
        return SceneObjects.of(self, self._subject.scene.objects)

    @property
    def stops(self) -> tuple[Stop, ...]:
        """The named places on the slider, by x: name, x 0..1, kind, palette, value_range, unit.

        {stop.name: stop.x for stop in scene.stops}
        """
        return stops_of(self._subject)

    @property
    def x(self) -> Control | None:
        """Where the slider stands, 0..1, or a blend of stops; None where objects differ.

        scene.at(0.25).x == 0.25
        """
        return self._subject.x

    @property
    def model(self) -> Model:
        """The AnchorModel, SplatLayers or ScaffoldModel of a scene of one.  Raises UsageError.

        Its arrays are numpy's: copy what you change, and put it back by `with_model`.

            anchors = scene.model.anchors  # (A, 3) metres
        """
        models = self._subject.models
        if len(models) != 1:
            raise UsageError("this scene has several models; take scene.object(NAME).model.")
        return models[0]

    def object(self, name: str) -> SceneObject:
        """The object of that name.  Raises UsageError that lists those that there are.

        cup = ss.load("room.scene.json").object("cup")
        """
        for obj in self.objects:
            if obj.name == name:
                return obj
        names = ", ".join(obj.name for obj in self.objects)
        raise UsageError(f"there is no object '{name}'; there are {names}.")

    def _one(self, name: str | None) -> SceneObject:
        """The object of that name; without one the only object."""
        if name is None and len(self.objects) != 1:
            raise UsageError("this scene has several objects; say which one is meant: name=.")
        return self.objects[0] if name is None else self.object(name)

    @property
    def splat_count(self) -> int:
        """Of all objects, also of those that are absent at this x.

        ss.load("workshop.shift").splat_count
        """
        return self._subject.scene.splat_count

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was wrong with the files and what was done about it, as `lint` says it.

        for finding in scene.findings: print(finding.what, finding.done)
        """
        return tuple(found for model in self._subject.models for found in model.findings)

    @property
    def bounds(self) -> tuple[np.ndarray, float]:
        """Centre (3,) and radius in metres, world; a few far splats move neither.

        centre, radius = scene.bounds
        """
        return self._subject.bounds()

    @property
    def origin(self) -> np.ndarray:
        """(3,) float64 metres: where this scene's zero lies in the world of its file.

        Files far from zero are re-centred when they are opened; cameras of that world are moved
        with them, exports are put back.

        in_file = splats.means + scene.origin
        """
        return self._subject.origin

    @property
    def drawn(self) -> DrawnScene:
        """What `shapeshift.renderer.renderer.Renderer.update` takes: the objects alone.

        frames.update(scene.drawn)
        """
        return self._subject.scene

    @property
    def subject(self) -> Document:
        """The same scene as the commands have it, with its scene file if it came from one.

        scene.subject.file.gravity_m_s2
        """
        return self._subject

    def info(self) -> dict[str, Any]:
        """What `info` gives of it.

        scene.info()["format"]
        """
        return describe(self._subject, self.path)

    # ---- another scene

    def _with(self, subject: Document) -> Any:
        """The same kind of scene of something else."""
        up, flip = self.turned
        return OpenedScene(subject, self.path, up=up, flip=flip)

    def at(self, x: X | None) -> Self:
        """The scene with all sliders at x: a number from 0 to 1, a stop's name, a way between two
        stops ("RGB..Thermal:0.5"), or StopWeights.  None: as it is.

        In a scene of several objects those that have no such stop stay.  Raises UsageError that
        lists the stops, or says that a number is outside 0..1.

            thermal = scene.at("Thermal")
            halfway = scene.at("RGB..Thermal:0.5")
        """
        if x is None:
            return self
        if isinstance(x, str):
            return self._with(self._subject.placed(x, "x"))
        control = x if isinstance(x, StopWeights) else number_from_0_to_1(x)
        return self._with(replace(self._subject, scene=self._subject.at(control)))

    def with_model(self, model: Model, name: str | None = None) -> Self:
        """The scene with another model, at the same x: the way back for arrays that were edited.

        name: of the object, where there are several.  Raises UsageError where it is needed.

            lifted = replace(scene.model, anchors=scene.model.anchors + [0, 1, 0])
            scene.with_model(lifted).render()
        """
        old = self._one(name)
        made = tuple(replace(t, model=model) if t is old else t for t in self.objects)
        scene = self._with(replace(self._subject, scene=DrawnScene(made)))
        scene.path = None  # what lies there is another one
        return scene

    def with_object(
        self,
        name: str,
        *,
        position: Sequence[float] | None = None,
        wxyz: Sequence[float] | None = None,
        x: X | None = None,
        visible: bool | None = None,
        appearance: Appearance | None = None,
    ) -> Self:
        """The scene with an object elsewhere (metres, world), turned (quaternion, w first), at
        another x, shown or hidden, or with another Appearance; what is None stays.  Raises
        UsageError, ValueError.

            room.with_object("cup", position=(0.0, 1.2, 0.0), x="fire")
        """
        how = (position, wxyz, x, visible, appearance)
        return self._with(changed(self._subject, self.object(name), *how))

    def without(self, *names: str) -> Self:
        """The scene without these objects.  Raises UsageError for a name that none has.

        emptied = scene.without("mug", "can")
        """
        gone = {self.object(name).name for name in names}
        file = self._subject.file
        if file is not None:  # as a simulation takes it
            for name in gone:
                file = edits.remove(file, name)
        left = tuple(obj for obj in self.objects if obj.name not in gone)
        return self._with(Document(DrawnScene(left), file))

    def showing(self, show: str) -> Self:
        """The scene without its background, or without its objects: as `show` of `render`.

        Raises UsageError.

            scene.showing("isolated:mug").splats(0.0)
        """
        from shapeshift.app.decomposition.show_views import show_objects

        shown = show_objects(self._subject.scene, show, "show")
        return self._with(replace(self._subject, scene=shown))

    def with_regions(self, *regions: "str | Selector", name: str | None = None) -> Self:
        """The scene with parts that have an x of their own; none: without any.

        A region is a Sphere, Box, HalfSpace or Lens in metres of the object's frame, or a text such
        as "sphere:0,1,0:0.5:Thermal:0.1" (centre, radius, x, border).  A later one lies over an
        earlier one.  name: of the object, where there are several.  Raises UsageError.

            scene.with_regions(ss.Sphere(centre=(0, 0.4, 0), radius=0.3, x=1.0, border=0.1))
        """
        obj = self._one(name)
        chosen = regions_of(regions, obj.model, self._subject.view(DEFAULT_SIZE))
        objects = tuple(
            replace(each, selectors=chosen) if each is obj else each for each in self.objects
        )
        return self._with(replace(self._subject, scene=DrawnScene(objects)))

    def with_sections(self, *sections: "str | SceneSection", name: str | None = None) -> Self:
        """The scene cut by planes and boxes; none: by none.

        A section is a SceneSection, or a text: "plane:1,0,0,0.2:soft:0.05" (normal, metres along
        it, edge, width) or "box:0,0.4,0:0.5,0.3,0.5:beyond=Opened" (centre, half its sides,
        what is shown outside).  All of them hold.  name: of the object that they cut, where it is
        one alone; None: all.  Raises UsageError.

            scene.with_sections("plane:1,0,0,0")
            scene.with_sections(ss.SceneSection(shape=ss.PlaneShape((0, 1, 0), 0.5), beyond=1.0))
        """
        chosen = sections_from(sections, self._subject)
        cut = self.objects if name is None else (self._one(name),)
        objects = tuple(
            replace(each, sections=chosen) if any(each is one for one in cut) else each
            for each in self.objects
        )
        return self._with(replace(self._subject, scene=DrawnScene(objects)))


def number_from_0_to_1(x: object) -> float:
    """Raises UsageError."""
    try:
        number = float(x)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        number = math.nan
    if not 0 <= number <= 1:
        raise UsageError(f"x is {x!r}; a number from 0 to 1 or a stop's name is wanted.")
    return number
