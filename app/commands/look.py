"""How `render` shows a scene: exposure, gamma, tint, opacity, and what is behind everything."""

import re
from dataclasses import replace
from typing import Protocol

from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.appearance import NEUTRAL, Appearance, Background, Color, Sky, check_color
from shapeshift.scene.scene import Scene

Texts = tuple[str, str, str]


class LookOptions(Protocol):
    """The options of a command that say it."""

    @property
    def background(self) -> Color | None: ...
    @property
    def sky(self) -> Texts | None: ...
    @property
    def exposure(self) -> float: ...
    @property
    def gamma(self) -> float: ...
    @property
    def tint(self) -> Color: ...
    @property
    def opacity(self) -> float: ...


def read_look(options: LookOptions) -> tuple[Appearance, Background | None]:
    """The appearance of the whole scene, and what is asked for behind it.  Raises UsageError."""
    try:
        if options.background is not None:
            check_color(options.background, "background")
        tint = three(options.tint)
        appearance = Appearance(options.exposure, options.gamma, tint, options.opacity)
    except ValueError as error:
        raise UsageError(f"--{error}") from None
    if options.sky is None:
        return appearance, options.background
    if options.background is not None:
        raise UsageError("--sky says what --background does; leave one of the two out.")
    return appearance, Sky(*map(read_color, options.sky))


def read_color(text: str) -> Color:
    """Display sRGB of a text like 87b5e8."""
    if not re.fullmatch("#?[0-9a-fA-F]{6}", text):
        raise UsageError(f"--sky has the colour '{text[:60]}'; six digits like 87b5e8 are wanted.")
    value = int(text.removeprefix("#"), 16)
    return three((value >> shift & 255) / 255 for shift in (16, 8, 0))


def appearing(scene: Scene, appearance: Appearance) -> Scene:
    """The scene with that of all on top of each object's own."""
    if appearance == NEUTRAL:
        return scene
    objects = (replace(obj, appearance=obj.appearance.under(appearance)) for obj in scene.objects)
    return replace(scene, objects=tuple(objects))
