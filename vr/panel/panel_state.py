"""What the panel in the room tells, what it remembers between frames, and what it wishes for.

Places on it are pixels of its picture, from its upper left corner.
"""

from dataclasses import dataclass, field

from shapeshift.runtime_models.model import Stop
from shapeshift.vr.frame import Pulse

QUALITIES = ("auto", "fast", "balanced", "best")  # auto: the budget keeps the headset's period
STICKS = ("", "slides", "rests", "walks")  # rests: came to a stop and has to be let go
ON_STOP = 1e-3  # of the slider's range

Place = tuple[float, float]  # pixels of the panel's picture


@dataclass(frozen=True)
class Slider:
    """The control value of one object."""

    name: str  # of the object
    stops: tuple[Stop, ...]
    x: float


@dataclass(frozen=True)
class Facts:
    """What the panel tells, taken anew from the world each frame."""

    sliders: tuple[Slider, ...] = ()  # of the objects that have somewhere to go
    quality: str = QUALITIES[0]
    scale: float = 1.0  # metres of the world a metre of the room (vr/locomotion/play_space.py)
    note: str = ""  # one short line at the lower edge
    floor: bool = True  # the grid on the floor is shown


@dataclass(frozen=True)
class Panel:
    """State between frames."""

    facts: Facts = Facts()
    chosen: str = ""  # object whose slider is shown; "": the first
    side: str = ""  # hand that carries it, one of vr.frame.SIDES; "": it is closed
    hovers: dict[str, str] = field(default_factory=dict)  # side -> item that it points at
    held: dict[str, str] = field(default_factory=dict)  # side -> item that it pressed and holds
    elsewhere: frozenset[str] = frozenset()  # sides whose press began beside the panel
    grip_px: float = 0.0  # from the pointer to the knob's middle, where it was taken
    exit_s: float = 0.0  # seconds for which Exit asks "really?"
    stick: str = ""  # what the carrying hand's thumbstick does since it left its middle: STICKS

    @property
    def open(self) -> bool:
        return self.side != ""

    @property
    def slider(self) -> Slider | None:
        """The one that is shown."""
        sliders = self.facts.sliders
        return next((s for s in sliders if s.name == self.chosen), sliders[0] if sliders else None)


@dataclass(frozen=True)
class SetX:
    """The control value of an object is to be x."""

    object: str
    x: float


@dataclass(frozen=True)
class SetQuality:
    name: str  # of QUALITIES


@dataclass(frozen=True)
class SetScale:
    scale: float  # metres of the world a metre of the room


@dataclass(frozen=True)
class Recentre:
    """The world is to lie before the head as it did at first."""


@dataclass(frozen=True)
class PutBack:
    """All objects are to be where and what the scene file has them."""


@dataclass(frozen=True)
class SetFloor:
    """The grid on the floor is to be shown, or not."""

    shown: bool


@dataclass(frozen=True)
class Exit:
    """VR is to end."""


Wish = SetX | SetQuality | SetScale | Recentre | PutBack | SetFloor | Exit | Pulse


def shown_stop(slider: Slider) -> str:
    """What is seen now, in words: a stop's name, or how far it is on the way between two."""
    stops = sorted(slider.stops, key=lambda stop: stop.x)
    below = [stop for stop in stops if stop.x <= slider.x + ON_STOP]
    above = [stop for stop in stops if stop.x > slider.x + ON_STOP]
    if below and slider.x - below[-1].x <= ON_STOP:
        return below[-1].name
    if below and above:
        part = (slider.x - below[-1].x) / (above[0].x - below[-1].x)
        percent = min(max(round(100 * part), 1), 99)  # 0 and 100 are for the stops themselves
        return f"{below[-1].name} \u2192 {above[0].name}  {percent} %"
    end = (below[-1:] or above[:1])[0].name if stops else ""
    return f"{end}  x {slider.x:.2f}".strip()


def size_text(scale: float) -> str:
    """How large the world looks."""
    size = 100 / scale
    return f"{size:.0f} %" if size >= 100 else f"{size:.3g} %"
