"""The four views of a scene of objects by a word: of `render --show` and `show=` in Python."""

from dataclasses import replace

from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.parts import BACKGROUND
from shapeshift.runtime_models.program import program
from shapeshift.scene.four_views import ALONE, FOUR_VIEWS, FULL, has_objects, parts_of, shown_as
from shapeshift.scene.scene import Scene


def read_show(text: str, said: str = "--show") -> tuple[str, str]:
    """One of FOUR_VIEWS, and of isolated:NAME the object's name or label, else "".

    said: what the text is called where it is typed.  Raises UsageError.
    """
    show, colon, name = text.partition(":")
    if show not in FOUR_VIEWS or (colon and (show != ALONE or not name)):
        views = ", ".join(FOUR_VIEWS)
        raise UsageError(f"{said}: '{text[:60]}' is no view; expected {views} or {ALONE}:NAME.")
    return show, name


def show_objects(scene: Scene, text: str, said: str = "--show") -> Scene:
    """What of a scene is drawn in a view, as `read_show` reads it; one object alone also where it
    is hidden.  Raises UsageError for a scene without objects, and for a name that none has.
    """
    show, name = read_show(text, said)
    if show == FULL:
        return scene
    if not has_objects(scene):
        raise UsageError(
            f"{said} {show}: the scene has no objects beside a background; "
            f"`{program()} segment` makes them."
        )
    if name and not any(parts_of(obj) is not None for obj in scene.objects):
        objects = [obj for obj in scene.objects if obj.label != BACKGROUND]
        found = [obj for obj in objects if name in (obj.name, str(obj.label))]
        if not found:
            there = ", ".join(f"{obj.label} {obj.name}" for obj in objects)
            raise UsageError(f"{said}: nothing of the scene is '{name[:60]}'; it has {there}.")
        chosen = next((obj for obj in found if obj.name == name), found[0])  # a name before a label
        name = chosen.name
        shown = [replace(obj, visible=True) if obj is chosen else obj for obj in scene.objects]
        scene = Scene(tuple(shown))
    try:
        return shown_as(scene, show, name)
    except BadFile as error:
        raise UsageError(f"{said}: {error}") from None
