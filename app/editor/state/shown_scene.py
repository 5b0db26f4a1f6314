"""The scene as it is looked at: with its regions, in one of four views, what is chosen lit up."""

from dataclasses import dataclass, field, replace

import numpy as np

from shapeshift.app.editor.state.regions import Regions, farthest_stop
from shapeshift.renderer.colors.palette import value_weights
from shapeshift.runtime_models.model import Model, Stop
from shapeshift.runtime_models.parts import BACKGROUND
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.control import Shift
from shapeshift.scene.document.scene_file import BACKGROUND as ITS_NAME
from shapeshift.scene.film.style_path import AutoSlide
from shapeshift.scene.four_views import FOUR_VIEWS, FULL, parts_of, shown_as, with_rows
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject, Tint


class ShownScene:
    """Looks at a scene change nothing of it: none is an edit, and none is saved."""

    def __init__(self) -> None:
        self.show = FULL  # one of FOUR_VIEWS
        self.lit: tuple[str, Tint] | None = None  # name of an object, and what lies over it
        self._made: tuple = ((), Scene(()))  # what the last one was made of, and it
        self._rows: dict[tuple, tuple[Model, Model]] = {}  # of models opened as a whole

    def next_view(self, step: int) -> str:
        """The next of the four, or the one before; its name."""
        number = (FOUR_VIEWS.index(self.show) + step) % len(FOUR_VIEWS)
        self.show = FOUR_VIEWS[number]
        return self.show

    def forget(self) -> None:
        """Another scene."""
        self.show, self.lit = FULL, None
        self._made = ((), Scene(()))
        self._rows.clear()

    def of(self, scene: Scene, regions: Regions, chosen: str, view: View) -> Scene:
        """What is drawn; the same object until something of it changes.

        chosen: name of the object that is edited, which is isolated alone where it is one.
        """
        if not regions.items and self.lit is None and self.show == FULL:
            return scene
        pose = view.world_from_eye
        eye = (pose.position.tobytes(), pose.wxyz.tobytes()) if regions.follow_the_eye else ()
        name = isolated_name(scene, chosen)
        made_of = (id(scene), regions.version, eye, self.show, name, id(self.lit))
        if self._made[0][:-1] != made_of:
            self._made = ((*made_of, (scene, self.lit)), self._make(scene, regions, name, view))
        return self._made[1]

    def _make(self, scene: Scene, regions: Regions, name: str, view: View) -> Scene:
        objects = [
            replace(obj, selectors=obj.selectors + regions.selectors(index, view))
            for index, obj in enumerate(scene.objects)
        ]
        shown = shown_as(Scene(tuple(objects)), self.show, name, self._rows_of)
        if self.lit is None:
            return shown
        lit, tint = self.lit
        pairs = zip(shown.objects, objects, strict=True)
        return Scene(
            tuple(
                replace(obj, tint=tint) if obj.name == lit and obj.model is before.model else obj
                for obj, before in pairs
            )
        )

    def _rows_of(self, model: Model, rows: np.ndarray) -> Model:
        """The very model that was given before: another one would be decoded anew."""
        key = (id(model), rows.tobytes())
        if key not in self._rows:
            self._rows = {k: both for k, both in self._rows.items() if both[0] is model}
            self._rows[key] = (model, with_rows(model, rows))
        return self._rows[key][1]


def isolated_name(scene: Scene, chosen: str) -> str:
    """The object to be isolated: the chosen one, unless that is the background; "": all."""
    objects = [obj for obj in scene.objects if obj.name == chosen]
    alone = objects and objects[0].label != BACKGROUND and parts_of(objects[0]) is None
    return chosen if alone else ""


# Which objects go along with the scene that they were cut out of.


@dataclass
class Chain:
    """An object with its scene's stops that stands at its scene's x follows it, until somebody says
    otherwise.
    """

    loose: set[str] = field(default_factory=set)  # names of objects that have a slider of their own
    _found: tuple = (None, frozenset(), ())

    def of(self, scene: Scene, index: int) -> tuple[int, ...]:
        """All that go with an object, itself among them, the one with the slider first."""
        followers = self.followers(scene)
        leader = leader_of(scene)
        if leader is None or (index != leader and index not in followers):
            return (index,)
        return (leader, *followers)

    def followers(self, scene: Scene) -> tuple[int, ...]:
        """Indices of the objects that go along with their scene."""
        if self._found[0] is not scene or self._found[1] != self.loose:
            leader, found = leader_of(scene), []
            for index, obj in enumerate(scene.objects):
                if leader is not None and index != leader and obj.name not in self.loose:
                    its = scene.objects[leader]
                    if obj.x == its.x and may_follow(obj, its):
                        found.append(index)
            self._found = (scene, frozenset(self.loose), tuple(found))
        return self._found[2]


def leader_of(scene: Scene) -> int | None:
    """The background that things were cut out of; None: there is none that can go anywhere."""
    for index, obj in enumerate(scene.objects):
        if obj.name == ITS_NAME and len({stop.x for stop in obj.model.stops}) > 1:
            return index
    return None


def may_follow(obj: SceneObject, leader: SceneObject) -> bool:
    """Whether an object has the stops of its scene, where its scene has them."""
    own, its = (sorted((s.x, s.name) for s in each.model.stops) for each in (obj, leader))
    return obj is not leader and own == its


# Which object is shown at two values of x at once, and what stands left and right of the line.

ON_STOP = 1e-3


@dataclass
class SplitState:
    """Which object is shown at a second x, right of the line."""

    on: bool = False
    name: str = ""  # of the object
    x: float = 1.0
    over: bool = False  # heat over shape instead of a line between the two
    detail: float = 1.0  # of the shape, that is laid under the heat
    possible: bool = False  # whether there is anybody to draw it

    def toggle(
        self, obj: SceneObject, over: bool = False, way: Shift | AutoSlide | None = None
    ) -> None:
        """On for this object, at a value stop, else the one farthest from its x; or off.

        over: heat over shape instead of a line; from one of the two to the other nothing goes off.
        way: that its x is on, to where it counts as being.
        """
        if isinstance(way, Shift):
            obj = replace(obj, x=way.end)
        self.on = not self.on or self.name != obj.name or self.over != over
        self.over = over
        if self.name != obj.name or self.x == obj.slider_x:
            measured = [stop.x for stop in obj.model.stops if stop.is_measured]
            others = [x for x in measured if abs(x - obj.slider_x) > ON_STOP]
            self.name, self.x = obj.name, (others or [farthest_stop(obj)])[0]

    def shows(self, scene: Scene) -> bool:
        """Whether two stops of a scene are to be seen: it is on, and the object is there."""
        return self.on and any(obj.name == self.name for obj in scene.objects)

    def other_is_heat(self, scene: Scene) -> bool:
        """Whether the second x shows more heat than the slider does: its colours are laid over."""
        for obj in scene.objects:
            if obj.name == self.name:
                return heat_at(obj, self.x) >= heat_at(obj, obj.x)
        return True

    def right(self, scene: Scene, chain: "Chain | None" = None) -> Scene:
        """The scene right of the line, with all that goes along; the same one where the object is
        gone.
        """
        names = [obj.name for obj in scene.objects]
        if self.name not in names:
            return scene
        index = names.index(self.name)
        moved = [index] if chain is None else chain.of(scene, index)
        objects = [
            replace(obj, x=self.x) if number in moved else obj
            for number, obj in enumerate(scene.objects)
        ]
        return Scene(tuple(objects))


def heat_at(obj: SceneObject, x: Control) -> float:
    """How much of a value stop an object shows at x, 0 to 1."""
    weights, _ = value_weights(obj.model.blend, x)
    return float(weights[0]) if len(weights) else 0.0


def name_of(x: float, stops: tuple[Stop, ...]) -> str:
    """The stop that x is on, else x itself."""
    return next((stop.name for stop in stops if abs(stop.x - x) < ON_STOP), f"x {x:.2f}")
