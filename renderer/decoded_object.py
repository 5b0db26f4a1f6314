"""What of an object lies decoded in the arena; renderer.py keeps one an object."""

from dataclasses import dataclass

from shapeshift.renderer.colors.color_cache import ColorCache, forget_colors
from shapeshift.renderer.colors.eye_colors import EyeColors
from shapeshift.renderer.colors.false_colors import Shade
from shapeshift.runtime_models.model import Model
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.appearance import Appearance

BESIDE_SET = 2  # of colours, behind those of two eyes
NO_SHADE = Shade(None)  # nothing is decoded yet


@dataclass
class DecodedObject:
    """What of an object lies in the arena now."""

    model: Model
    colored: list[ColorCache]  # one for all views of a frame, or one a view
    key: tuple | None = None  # control_key of x; None: not decoded yet
    x: Controls = 0.0  # of its geometry
    version: int = 0  # goes up with every other x
    shade: Shade = NO_SHADE  # which colours are decoded
    grade: Appearance | None = None  # of its colours; None: they are as decoded
    second: tuple[Shade, Appearance | None] | None = None  # the same of a second set of colours
    opacity: float = 1.0  # times that of its splats
    beside: tuple[Shade, Appearance | None] | None = None  # of the one for `Renderer.draw_beside`
    look: EyeColors | None = None  # made for the first pair of eyes

    def look_beside(self, look: tuple[Shade, Appearance | None]) -> None:
        """Forgets the colours of `draw_beside` where they are for another look."""
        while len(self.colored) <= BESIDE_SET:
            self.colored.append(ColorCache(self.colored[0].centre))
        before = self.beside
        if before is None or not before[0].same(look[0]) or before[1] != look[1]:
            forget_colors([self.colored[BESIDE_SET]])
        self.beside = look
