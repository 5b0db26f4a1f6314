"""Cards beside a controller: the names of its buttons, each with a line to its button, and what
they do.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.cards import Card
from shapeshift.vr.frame import SIDES, Frame, Hand
from shapeshift.vr.glove import LIT, MIRROR, Capsule
from shapeshift.vr.locomotion import Rules
from shapeshift.vr.panel import facing

# A controller as capsules, of our own making: what one holds, with its buttons where they are.
#
# One shape for each family of profiles, not the makers' own. In the grip's own frame, as OpenXR
# has it: the fist holds a tube along Z with the thumb at -Z, open fingers point to -Y, and the
# right hand's back is at +X. Below, places are (out, ahead, up) of a right hand whose thumb is
# up: out of the back of the hand, to where its fingers point, to its thumb.

SHELL, KEY = (0.74, 0.75, 0.79), (0.34, 0.36, 0.43)  # display sRGB
HEAD = (0.0, 0.012, 0.046)  # the middle of what the thumb lies on
FACE_UP, FACE_ALONG = np.array([0.0, -0.40, 0.917]), np.array([0.0, 0.917, 0.40])
FACE_M = 0.020  # from the head's middle to its face
PRESSED_M = 0.0025  # a button goes down by
PULLED_M, SQUEEZED_M = 0.007, 0.003  # a trigger and a grip go in by
TILT_M = 0.007  # the tip of a stick goes aside by
FROM_RIGHT = np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])  # grip frame of (out, ahead, up)

# What of a hand says how far a button is pressed, 0 to 1.
HOW_FAR: Mapping[str, Callable[[Hand], float]] = {
    "trigger": lambda hand: hand.trigger,
    "squeeze": lambda hand: hand.squeeze,
    "stick": lambda hand: max(float(np.hypot(*hand.stick)), float(hand.stick_click)),
    "primary": lambda hand: float(hand.primary),
    "secondary": lambda hand: float(hand.secondary),
    "menu": lambda hand: float(hand.menu),
}


@dataclass
class Model:
    """A right hand's controller while it is put together."""

    hand: Hand
    sign: float  # of the side: 1 right, -1 left
    parts: list[Capsule] = field(default_factory=list)
    places: dict[str, np.ndarray] = field(default_factory=dict)  # of buttons, to point at

    def add(self, a, b, radii: float | tuple[float, float], color=SHELL) -> None:
        """A piece from a to b."""
        both = radii if isinstance(radii, tuple) else (radii, radii)
        self.parts.append(Capsule(np.array(a, float), np.array(b, float), both, color))

    def how_far(self, button: str) -> float:
        return min(max(HOW_FAR[button](self.hand), 0.0), 1.0)

    def key(self, button: str, a, b, radii, pressed=(0.0, 0.0, 0.0)) -> None:
        """A button from a to b, that goes by `pressed` when it is down, and is lit then."""
        part = self.how_far(button)
        moved = np.array(pressed) * part
        self.add(np.add(a, moved), np.add(b, moved), radii, mixed(KEY, LIT, part))
        self.places.setdefault(button, np.add(b, moved))

    def dome(self, button: str, out: float, along: float, radius: float = 0.0052) -> None:
        """A round button on the face."""
        base, top = face(out, along), face(out, along, 0.003)
        self.key(button, base, top, radius, -FACE_UP * PRESSED_M)

    def stick(self, out: float, along: float) -> None:
        x, y = self.hand.stick
        aside = np.array([self.sign * x, 0, 0]) + FACE_ALONG * y
        down = PRESSED_M if self.hand.stick_click else 0.0
        base, tip = face(out, along), face(out, along, 0.013 - down) + aside * TILT_M
        color = mixed(KEY, LIT, self.how_far("stick"))
        self.add(base, tip, 0.0042, KEY)
        self.add(tip, tip, 0.0088, color)
        self.places["stick"] = tip

    def disc(self, out: float, along: float, radius: float, color, width: int = 2) -> None:
        """A flat round pad on the face, of rings."""
        middle = face(out, along, -0.0015)
        for ring in range(1, width + 1):
            at = radius * (ring - 0.5) / width
            circle(
                self, middle, at, (np.array([1.0, 0, 0]), FACE_ALONG), radius / width * 0.62, color
            )

    def trigger(self) -> None:
        top, tip = (0.0, 0.030, 0.040), (0.0, 0.038, 0.020)
        self.key("trigger", top, tip, (0.0095, 0.0062), (0.0, -PULLED_M, 0.0))

    def grip(self, out: float = -0.0125) -> None:
        """A button on the handle where the middle finger lies, and with it the ring finger."""
        goes = (SQUEEZED_M if out < 0 else -SQUEEZED_M, 0.0, 0.0)
        self.key("squeeze", (out, 0.008, 0.008), (out, 0.005, -0.016), 0.0066, goes)

    def handle(self, foot: float = -0.055, color=SHELL) -> None:
        self.add((0.0, -0.010, foot), (0.0, 0.004, 0.030), (0.0155, 0.0160), color)

    def head(self, wide: float = 0.008) -> None:
        out, ahead, up = HEAD
        self.add((out - wide, ahead, up), (out + wide, ahead, up), 0.0205)


def circle(model: Model, middle, radius: float, axes, thick: float, color=SHELL) -> None:
    """A ring of capsules around a middle, across two axes."""
    count = 10 if radius < 0.02 else 20
    turns = np.linspace(0, 2 * np.pi, count + 1)
    points = [middle + radius * (np.cos(t) * axes[0] + np.sin(t) * axes[1]) for t in turns]
    for a, b in pairwise(points):
        model.add(a, b, thick, color)


def touch_like(model: Model) -> None:
    """A stick and two buttons on a round face."""
    model.handle()
    model.head()
    model.trigger()
    model.grip()
    model.stick(-0.009, 0.006)
    model.dome("primary", 0.009, -0.006)
    model.dome("secondary", 0.013, 0.007)
    model.dome("menu", -0.006, -0.013, 0.0032)


def index_like(model: Model) -> None:
    """A strap over the back of the hand; the handle itself feels how it is squeezed."""
    squeezed = model.how_far("squeeze")
    model.handle(-0.060, mixed(SHELL, LIT, squeezed))
    model.places["squeeze"] = np.array([-0.014, 0.006, -0.012])
    model.head(0.010)
    model.trigger()
    strap = [(0.014, 0.0, 0.055), (0.038, -0.002, 0.040), (0.050, -0.006, 0.0),
             (0.038, -0.010, -0.045), (0.006, -0.012, -0.062)]  # fmt: skip
    for a, b in pairwise(strap):
        model.add(a, b, 0.0065, KEY)
    model.stick(-0.011, 0.004)
    model.add(face(0.002, -0.008, -0.003), face(0.002, 0.010, -0.003), 0.0060, KEY)
    model.dome("primary", 0.013, -0.008)
    # The upper one is B in both hands: the panel's in the left, true size in the right one.
    model.dome("secondary", 0.014, 0.005)
    if model.sign < 0:
        model.dome("menu", 0.014, 0.005, 0.0054)


def wand_like(model: Model) -> None:
    """A long handle with a ring at its head and a trackpad under the thumb."""
    model.handle(-0.105)
    model.head(0.006)
    pressed = max(model.how_far("stick"), model.how_far("primary"))
    model.disc(0.0, 0.0, 0.018, mixed(KEY, LIT, pressed))
    model.places |= {"stick": face(0.0, 0.015, 0.002), "primary": face(0.0, 0.0, 0.002)}
    model.trigger()
    model.grip(-0.014)
    model.grip(0.014)
    model.dome("menu", 0.0, 0.024, 0.0036)
    axes = np.array([1.0, 0, 0]), FACE_ALONG
    circle(model, np.array([0.0, 0.052, 0.088]), 0.040, axes, 0.0095)


def motion_like(model: Model) -> None:
    """A stick and a small trackpad, and a ring of lights above them."""
    model.handle()
    model.head(0.012)
    model.trigger()
    model.grip()
    model.stick(-0.012, 0.004)
    model.disc(0.012, 0.002, 0.010, mixed(KEY, LIT, model.how_far("primary")))
    model.places["primary"] = face(0.012, 0.002, 0.003)
    model.dome("menu", 0.0, -0.014, 0.0034)
    axes = np.array([1.0, 0, 0]), FACE_ALONG
    circle(model, np.array([0.0, 0.046, 0.082]), 0.045, axes, 0.0060)


def simple(model: Model) -> None:
    """One button, and one for the menu."""
    model.handle(-0.045)
    model.head(0.004)
    model.dome("trigger", 0.0, 0.004, 0.0085)
    model.places["squeeze"] = model.places["trigger"]
    model.dome("menu", 0.0, -0.013, 0.0036)


FAMILIES: Mapping[str, Callable[[Model], None]] = {
    "valve/index_controller": index_like,
    "oculus/touch_controller": touch_like,
    "htc/vive_controller": wand_like,
    "microsoft/motion_controller": motion_like,
    "khr/simple_controller": simple,
}


@dataclass(frozen=True)
class HeldController:
    """Of a hand in the room: metres."""

    parts: tuple[Capsule, ...]
    buttons: Mapping[str, np.ndarray]  # (3,) of each button's top


def controller(side: str, hand: Hand, profile: str, holds: bool = False) -> HeldController | None:
    """The controller that a hand holds; None where it holds none, or is lost.

    profile: of OpenXR; of one that is not known the commonest is drawn.  holds: an object, too.
    """
    if hand.grip is None or hand.joints is not None:
        return None
    model = Model(hand, 1.0 if side == "right" else -1.0)
    FAMILIES.get(profile.removeprefix("/interaction_profiles/"), touch_like)(model)
    if holds:
        model.add((0.0, -0.009, -0.046), (0.0, -0.008, -0.040), 0.0175, LIT)
    if "stick" in model.places:
        model.places["press"] = model.places["stick"]  # of a stick that can be pressed
    # Columns: of the right hand's grip, as glove.py has it.
    to_play = hand.grip.matrix()[:3, :3] * MIRROR[side] @ FROM_RIGHT
    at = hand.grip.position
    parts = tuple(
        Capsule(to_play @ p.a + at, to_play @ p.b + at, p.radii, p.color) for p in model.parts
    )
    return HeldController(
        parts, {name: to_play @ place + at for name, place in model.places.items()}
    )


def face(out: float, along: float, over: float = 0.0) -> np.ndarray:
    """(3,) a place on the face: out, up along it, and over it."""
    return np.array(HEAD) + FACE_UP * (FACE_M + over) + FACE_ALONG * along + np.array([out, 0, 0])


def mixed(color, other, part: float) -> tuple[float, ...]:
    """A colour on its way to another one."""
    return tuple(a + (b - a) * part for a, b in zip(color, other, strict=True))


AWAY_M = 0.085  # from the grip to the cards' near edge, outwards
ABOVE_M = 0.02  # their middle over the grip
GAP_M = 0.004  # between two cards
LINE_M = 0.0011  # radius
INK = (0.92, 0.93, 0.96)  # display sRGB


def labelled(
    side: str, held: HeldController, rows: Mapping[str, str], grip: np.ndarray, head: Pose,
    opacity: float,
) -> tuple[list[Card], list[Capsule]]:  # fmt: skip
    """Cards outwards of a hand, from top to bottom as their buttons are, and the lines to these.

    rows: what each button is called and does; a row whose name is no button has no line.
    """
    level = facing(grip, head)
    axes = level.matrix()[:3, :3]
    outwards = axes[:, 0] * (1 if side == "right" else -1)
    up = axes[:, 1]

    def height(name: str) -> float:
        place = held.buttons.get(name)
        return -np.inf if place is None else float(place @ up)

    names = sorted(rows, key=height, reverse=True)
    cards = [Card((rows[name],), level, opacity) for name in names]
    sizes = [card.size_m for card in cards]
    tall = sum(size[1] for size in sizes) + GAP_M * (len(sizes) - 1)
    edge = grip + outwards * AWAY_M + up * (ABOVE_M + tall / 2)
    placed, lines = [], []
    for name, card, (wide, high) in zip(names, cards, sizes, strict=True):
        near = edge - up * (high / 2)
        middle = near + outwards * (wide / 2)
        placed.append(replace(card, play_from_card=Pose(middle, level.wxyz)))
        if name in held.buttons:
            ink = (*INK, 0.9 * opacity)
            lines.append(Capsule(held.buttons[name], near, (LINE_M, LINE_M), ink))
        edge = edge - up * (high + GAP_M)
    return placed, lines


# What the buttons of a controller do, on a card beside each glove for the first ten seconds.

SHOWN_S, FADES_S = 10.0, 1.0  # seconds of a session, and the last of them
ASIDE_M, RAISED_M = 0.15, 0.02  # from the grip to the middle of the card, outwards and up

# What a maker calls the buttons; A and X, B and Y by hand.
NAMES: Mapping[str, Mapping[str, str]] = {
    "valve/index_controller": {"squeeze": "Squeeze", "primary": "A", "secondary": "B", "menu": "B"},
    "oculus/touch_controller": {
        "squeeze": "Grip", "primary": "X A", "secondary": "Y B", "menu": "Menu",
    },
    "htc/vive_controller": {
        "squeeze": "Grip", "stick": "Pad, edge", "primary": "Pad, middle", "menu": "Menu",
    },
    "microsoft/motion_controller": {"squeeze": "Grip", "primary": "Pad", "menu": "Menu"},
    "khr/simple_controller": {"trigger": "Button", "menu": "Menu"},
}  # fmt: skip
ANY = {"squeeze": "Grip", "stick": "Stick", "trigger": "Trigger"}
# Buttons that one hand alone has, by profile.
ONE_HAND = {
    "valve/index_controller": {"secondary": "right", "menu": "left"},
    "oculus/touch_controller": {"menu": "left"},
}


# Their sticks can be pressed.
WITH_CLICK = ("valve/index_controller", "oculus/touch_controller", "microsoft/motion_controller")

# Of a hand without a controller.
BARE: tuple[str, ...] = (
    "Pinch: take, or act by ray",
    "Fist: take, or hold the world",
    "Thumb, middle: jump",
)


def hint_lines(profile: str, side: str, rules: Rules, panel_hand: str) -> tuple[str, ...]:
    """The same without their names."""
    return tuple(hint_rows(profile, side, rules, panel_hand).values())


def hint_rows(profile: str, side: str, rules: Rules, panel_hand: str) -> dict[str, str]:
    """ "button: what it does" for each that a hand's controller has, by the name of its action."""
    kind = profile.removeprefix("/interaction_profiles/")
    simple = kind == "khr/simple_controller"
    names = dict(NAMES.get(kind, {})) if simple else ANY | dict(NAMES.get(kind, {}))
    for button, hand in ONE_HAND.get(kind, {}).items():
        if hand != side:
            names.pop(button, None)
    does = {
        "squeeze": "take, or hold the world",
        "trigger": "take or act" if simple else "act on what the ray meets",
        "stick": stick_text(side, rules),
        "primary": "jump: point, let go",
        "secondary": "true size",
        "menu": "panel",
    }
    if rules.one_hand and "stick" in names and kind in WITH_CLICK:
        names["press"] = f"{names['stick']}, pressed"
        does["press"] = "panel"
    rows = {
        button: f"{_of_hand(names[button].split(' '), side)}: {text}"
        for button, text in does.items()
        if button in names
    }
    opens = side in (panel_hand, rules.one_hand)
    return rows | {"palm": "Palm up: panel"} if opens else rows


def stick_text(side: str, rules: Rules) -> str:
    """What a stick does."""
    if rules.one_hand:
        return "walk, turn sideways"
    return "walk" if side == rules.walks else "turn, fly"


def hint_opacity(seconds: float) -> float:
    """After so many seconds of a session, 0 to 1."""
    return min(max((SHOWN_S - seconds) / FADES_S, 0.0), 1.0)


def hints(
    frame: Frame, seconds: float, profiles: Mapping[str, str], rules: Rules, panel_hand: str
) -> tuple[Card, ...]:
    """The cards after so many seconds of a session; none beside a hand that is not there."""
    opacity = hint_opacity(seconds)
    cards = []
    for side in SIDES if opacity > 0 else ():
        grip = frame.hands[side].grip
        if grip is None:
            continue
        if frame.hands[side].joints is not None:
            opens = side in (panel_hand, rules.one_hand)
            lines = (*BARE, "Palm up: panel") if opens else BARE
        else:
            lines = hint_lines(profiles.get(side, ""), side, rules, panel_hand)
        level = facing(grip.position, frame.head).matrix()
        outwards = level[:3, 0] * (1 if side == "right" else -1)
        place = grip.position + outwards * ASIDE_M + np.array([0.0, RAISED_M, 0.0])
        cards.append(Card(lines, Pose(place, facing(place, frame.head).wxyz), opacity))
    return tuple(cards)


def _of_hand(names: list[str], side: str) -> str:
    """Of two single letters the one that this hand's button carries."""
    if len(names) == 2 and all(len(name) == 1 for name in names):
        return names[SIDES.index(side)]
    return " ".join(names)
