"""What happened in one step of a world, in the words of the output of `launch.py simulate`."""

from dataclasses import dataclass, field

from shapeshift.runtime_models.files.json_fields import control_row
from shapeshift.scene.world.reactions import Fired

DECIMALS = 6  # of what is written: micrometres


@dataclass
class Record:
    """One step: what has moved, changed, begun to touch, and who did what."""

    step: int
    t: float
    poses: dict = field(default_factory=dict)  # name -> x, y, z, w, x, y, z of what has moved
    x: dict = field(default_factory=dict)  # name -> x of what has changed
    contacts: list = field(default_factory=list)  # pairs that begin to touch: names, impulse, point
    hands: list = field(default_factory=list)
    rays: list = field(default_factory=list)
    events: list = field(default_factory=list)  # reactions that were taken

    def row(self) -> dict:
        """Without what is empty."""
        return {name: value for name, value in vars(self).items() if value or name in ("step", "t")}

    @property
    def is_news(self) -> bool:
        return len(self.row()) > 2


def event_row(name: str, fired: Fired) -> dict:
    row = {"object": name, "on": fired.kind, "reaction": fired.reaction + 1}
    to_x = control_row(fired.to_x, DECIMALS)
    return row | {"from": fired.before, "to": fired.after, "x": to_x}


def rounded(number: float) -> float:
    """As it is written; never -0."""
    return round(float(number), DECIMALS) + 0.0
