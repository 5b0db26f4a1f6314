"""What of an object lies decoded in the arena; renderer.py keeps one an object."""

from dataclasses import dataclass

from renderer.eye_colors import Look
from renderer.false_colors import Shade
from renderer.recolor import Colored
from runtime_models.model import Model
from runtime_models.stop_weights import Controls

NO_SHADE = Shade(None)  # nothing is decoded yet


@dataclass
class DecodedObject:
    """What of an object lies in the arena now."""

    model: Model
    colored: list[Colored]  # one for all views of a frame, or one a view
    key: tuple | None = None  # control_key of x; None: not decoded yet
    x: Controls = 0.0  # of its geometry
    version: int = 0  # goes up with every other x
    shade: Shade = NO_SHADE  # which colours are decoded
    look: Look | None = None  # made for the first pair of eyes
