"""What somebody who wears a headset has set, and finds again at the next start."""

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from shapeshift.renderer.settings import FOVEATIONS
from shapeshift.runtime_models.files.json_fields import is_number, saved_object
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.vr.frame import SIDES
from shapeshift.vr.locomotion import TURNINGS, Rules
from shapeshift.vr.play_space import POSTURES

FILE = "headset.json"
LARGEST = 1 << 16  # bytes
BOTH = "both"
HANDS = (BOTH, *SIDES)
VIGNETTES = (0.0, 0.4, 0.8, 1.0)  # that the panel offers
LEAST_SIZE, MOST_SIZE = 0.75, 2.0  # of the panel's text
SIZES = (0.8, 1.0, 1.25, 1.5)  # that the panel offers
HAND_MODELS = ("gloves", "controllers")  # how a hand is drawn that holds a controller
INSETS = "quad"  # foveation by the runtime's own four views, two of them sharp insets
INSTEAD = "medium"  # where a session has none
WORDS: dict[str, tuple[str, ...]] = {
    "posture": POSTURES,
    "hands": HANDS,
    "panel_hand": SIDES,
    "walking_hand": SIDES,
    "turning": TURNINGS,
    "hand_model": HAND_MODELS,
    "foveation": (*FOVEATIONS, INSETS),
}


@dataclass(frozen=True)
class WornSettings:
    """How one sits, which hands one has, how one moves and reads."""

    posture: str = "standing"
    hands: str = BOTH  # left, right: all with that one
    panel_hand: str = "left"  # that carries the panel
    walking_hand: str = "left"  # whose stick walks
    turning: str = "snap"
    hand_model: str = "gloves"
    foveation: str = "off"  # how near to what one looks at all pixels are drawn; or INSETS
    vignette: float = 0.8  # 0: none, 1: black
    text_size: float = 1.0  # of the panel, with all that is on it
    passthrough: bool = False  # the room itself is behind the scene, where the runtime shows it

    @property
    def one_hand(self) -> str:
        """The side of the only one; "" for both."""
        return self.hands if self.hands in SIDES else ""

    @property
    def wants_insets(self) -> bool:
        return self.foveation == INSETS

    def sharp(self, has_insets: bool) -> str:
        """RenderSettings.foveation of a session that has the four views, or has not."""
        if not self.wants_insets:
            return self.foveation
        return "off" if has_insets else INSTEAD

    @property
    def carries(self) -> str:
        """The hand beside which the panel hangs; one hand alone points at it."""
        one = self.one_hand
        return SIDES[1 - SIDES.index(one)] if one else self.panel_hand

    def rules(self, before: Rules) -> Rules:
        """The rules of moving with these in them."""
        return replace(
            before, walks=self.one_hand or self.walking_hand, turning=self.turning,
            vignette=self.vignette, one_hand=self.one_hand,
        )  # fmt: skip


class KeptSettings:
    """`now` holds in this session: what is kept, and what the command line says instead.

    folder None: nothing is kept.
    """

    def __init__(self, folder: Path | None = None, **said: Any) -> None:
        self._folder = folder
        self._kept = read_settings(folder) if folder is not None else WornSettings()
        given = {name: value for name, value in said.items() if value is not None}
        self.now = replace(self._kept, **given)

    def choose(self, **values: Any) -> None:
        """What a hand has set is kept; OSError where the folder cannot be written."""
        self.now, self._kept = replace(self.now, **values), replace(self._kept, **values)
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole(self._folder / FILE, json.dumps(asdict(self._kept), indent=1).encode())


def read_settings(folder: Path) -> WornSettings:
    """Of the folder's file; each value that is none of ours is as at first."""
    found = saved_object(folder / FILE, LARGEST)
    good: dict[str, Any] = {n: found[n] for n, known in WORDS.items() if found.get(n) in known}
    for name, low, high in (("vignette", 0.0, 1.0), ("text_size", LEAST_SIZE, MOST_SIZE)):
        value = found.get(name)
        if is_number(value) and low <= value <= high:
            good[name] = float(value)
    if isinstance(found.get("passthrough"), bool):
        good["passthrough"] = found["passthrough"]
    return WornSettings(**good)


# What who wears the headset chose at the door, beside the rules of moving.


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
