"""Which object is shown at two values of x at once, and what stands left and right of the line."""

from dataclasses import dataclass, replace

from shapeshift.app.editor.state.regions import farthest_stop
from shapeshift.renderer.colors.palette import value_weights
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.control import Shift
from shapeshift.scene.film.style_path import AutoSlide
from shapeshift.scene.scene import Scene, SceneObject

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

    def right(self, scene: Scene) -> Scene:
        """The scene right of the line; the same one where the object is gone."""
        if not any(obj.name == self.name for obj in scene.objects):
            return scene
        objects = [
            replace(obj, x=self.x) if obj.name == self.name else obj for obj in scene.objects
        ]
        return Scene(tuple(objects))


def heat_at(obj: SceneObject, x: Control) -> float:
    """How much of a value stop an object shows at x, 0 to 1."""
    weights, _ = value_weights(obj.model.blend, x)
    return float(weights[0]) if len(weights) else 0.0


def name_of(x: float, stops: tuple[Stop, ...]) -> str:
    """The stop that x is on, else x itself."""
    return next((stop.name for stop in stops if abs(stop.x - x) < ON_STOP), f"x {x:.2f}")
