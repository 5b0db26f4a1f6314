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

    def toggle(self, thing: SceneObject) -> None:
        """On for this object, at a thermal stop, else the one farthest from its x; or off."""
        self.on = not self.on or self.name != thing.name
        if self.name != thing.name or self.x == thing.slider_x:
            thermal = [stop.x for stop in thing.model.stops if stop.kind == "thermal"]
            others = [x for x in thermal if abs(x - thing.slider_x) > ON_STOP]
            self.name, self.x = thing.name, (others or [farthest_stop(thing)])[0]

    def right(self, scene: Scene) -> Scene:
        """The scene right of the line; the same one where the object is gone."""
        if not any(thing.name == self.name for thing in scene.objects):
            return scene
        things = [
            replace(thing, x=self.x) if thing.name == self.name else thing
            for thing in scene.objects
        ]
        return Scene(tuple(things))


def name_of(x: float, stops: tuple[Stop, ...]) -> str:
    """The stop that x is on, else x itself."""
    return next((stop.name for stop in stops if abs(stop.x - x) < ON_STOP), f"x {x:.2f}")
