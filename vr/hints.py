"""What the buttons of a controller do, on a card beside each glove for the first ten seconds."""

from collections.abc import Mapping

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.cards import Card
from shapeshift.vr.frame import SIDES, Frame
from shapeshift.vr.locomotion.locomotion import Rules
from shapeshift.vr.panel.plane import facing

SHOWN_S, FADES_S = 10.0, 1.0  # seconds of a session, and the last of them
ASIDE_M, ABOVE_M = 0.15, 0.02  # from the grip to the middle of the card, outwards and up

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
        place = grip.position + outwards * ASIDE_M + np.array([0.0, ABOVE_M, 0.0])
        cards.append(Card(lines, Pose(place, facing(place, frame.head).wxyz), opacity))
    return tuple(cards)


def _of_hand(names: list[str], side: str) -> str:
    """Of two single letters the one that this hand's button carries."""
    if len(names) == 2 and all(len(name) == 1 for name in names):
        return names[SIDES.index(side)]
    return " ".join(names)
