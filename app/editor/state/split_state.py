"""Which object is shown at two values of x at once, and what stands left and right of the line."""

from dataclasses import dataclass, replace

from shapeshift.app.editor.state.regions import farthest_stop
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.scene import Scene, SceneObject

ON_STOP = 1e-3


@dataclass
class SplitState:
    """Which object is shown at a second x, right of the line."""

    on: bool = False
    name: str = ""  # of the object
    x: float = 1.0
    possible: bool = False  # whether there is anybody to draw it

    def toggle(self, obj: SceneObject) -> None:
        """On for this object, at a thermal stop, else the one farthest from its x; or off."""
        self.on = not self.on or self.name != obj.name
        if self.name != obj.name or self.x == obj.slider_x:
            thermal = [stop.x for stop in obj.model.stops if stop.kind == "thermal"]
            others = [x for x in thermal if abs(x - obj.slider_x) > ON_STOP]
            self.name, self.x = obj.name, (others or [farthest_stop(obj)])[0]

    def right(self, scene: Scene) -> Scene:
        """The scene right of the line; the same one where the object is gone."""
        if not any(obj.name == self.name for obj in scene.objects):
            return scene
        objects = [
            replace(obj, x=self.x) if obj.name == self.name else obj for obj in scene.objects
        ]
        return Scene(tuple(objects))


def name_of(x: float, stops: tuple[Stop, ...]) -> str:
    """The stop that x is on, else x itself."""
    return next((stop.name for stop in stops if abs(stop.x - x) < ON_STOP), f"x {x:.2f}")
