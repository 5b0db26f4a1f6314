"""What who wears the headset chose at the door, beside the rules of moving."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Wearing:
    """How a session looks; the panel changes some of it."""

    floor: bool = True  # a grid on it
    hints: bool = True  # names of buttons, notices
    depth: bool = True  # of the splats: hides hands behind them, and goes to the compositor
    panel_layer: bool = True  # the panel is a layer of the compositor's
    edges: bool = True  # of the room that is free to walk in
    visibility: bool = True  # nothing is drawn where lenses show nothing
    glass: str = ""  # the stop that a glass in the hand shows; "": there is none


WEARING = Wearing()
