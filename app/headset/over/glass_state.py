"""Which stop the glass shows, and where it is."""

from dataclasses import dataclass, replace

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.errors import UsageError
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.vr.glass import HeldGlass


@dataclass
class GlassState:
    """`stop` "": no glass."""

    stop: str = ""  # its name
    held: HeldGlass | None = None  # of this frame; None: it is not seen

    def row(self) -> dict | None:
        """What a line of a report says of it: metres of the room."""
        if self.held is None:
            return None
        middle = [round(float(number), 6) for number in self.held.play_from_glass.position]
        return {"stop": self.stop, "middle": middle, "radius_m": self.held.radius_m}


def stop_names(editor: EditorState) -> list[str]:
    """Of all objects whose slider moves, each name once, as the sliders have them."""
    names = (stop.name for index in editor.movable for stop in editor.stops(index))
    return list(dict.fromkeys(names))


def stop_named(editor: EditorState, name: str) -> str:
    """The stop that `--glass` means, whatever its capitals; "" for none.  Raises UsageError."""
    names = stop_names(editor)
    found = {each.casefold(): each for each in names}.get(name.casefold())
    if not name or found is not None:
        return found or ""
    if not names:
        raise UsageError(f"--glass is {name}, but nothing here has stops; leave it out.")
    raise UsageError(f"--glass is {name}, expected one of the stops: {', '.join(names)}.")


def stop_now(editor: EditorState, name: str) -> str:
    """The same of a scene that is opened later: "" where it has no such stop."""
    return name if name in stop_names(editor) else ""


def seen_through(editor: EditorState, shown: Scene, stop: str) -> tuple[Scene, Scene]:
    """What is shown with the objects that have a stop of that name at it, as a whole; and these
    alone, whose colours a legend explains.
    """
    stops = {
        editor.scene.objects[index].name: {each.name: each.x for each in editor.stops(index)}
        for index in editor.movable
    }
    objects: list[SceneObject] = []
    moved: list[SceneObject] = []
    for obj in shown.objects:
        x = stops.get(obj.name, {}).get(stop)
        objects.append(obj if x is None else replace(obj, x=x, selectors=()))
        if x is not None:
            moved.append(objects[-1])
    return Scene(tuple(objects)), Scene(tuple(moved))
