"""What one frame of a headset is, in our own words: eyes, head, hands, time.  No OpenXR here.

Everything is in play space: metres of the room, +Y up, the floor at y = 0 where the runtime knows
it, as the runtime's reference space says.  `PlaySpace` (vr/play_space.py) says where
that room is in the world.
"""

from dataclasses import dataclass, field

import numpy as np

from shapeshift.scene.pose import Pose, View

SIDES = ("left", "right")
NEAR_M, FAR_M = 0.05, 1000.0  # of the eyes, before the scale of a PlaySpace


def view_names(count: int) -> tuple[str, ...]:
    """Of the views of a frame, in their order."""
    return (*SIDES, *(f"{side}-inset" for side in SIDES))[:count]


@dataclass(frozen=True)
class Hand:
    """One controller, or a hand without one, as it is at the time that the frame will be seen.

    A lost hand, or one whose actions are inactive, has `active` False, no poses, and rests.
    """

    active: bool = False
    grip: Pose | None = None  # play_from_grip: the palm
    aim: Pose | None = None  # play_from_aim: points along its -Z
    squeeze: float = 0.0  # 0..1
    trigger: float = 0.0  # 0..1
    stick: tuple[float, float] = (0.0, 0.0)  # -1..1, right and forward; a trackpad that is pressed
    stick_click: bool = False
    primary: bool = False  # A or X; the trackpad's own where there is no such button
    secondary: bool = False  # B or Y
    menu: bool = False
    # (26, 4) place and radius, metres, of a hand that holds no controller
    joints: np.ndarray | None = field(default=None, compare=False)


LOST = Hand()


class HandLost(Exception):
    """A pose was asked of a hand that has none: callers look first."""


def grip_of(hand: Hand) -> Pose:
    """play_from_grip of a hand that is there.  Raises HandLost."""
    if hand.grip is None:
        raise HandLost
    return hand.grip


def aim_of(hand: Hand) -> Pose:
    """play_from_aim of a hand that points.  Raises HandLost."""
    if hand.aim is None:
        raise HandLost
    return hand.aim


@dataclass(frozen=True)
class Area:
    """A rectangle on the floor of the room that is free to walk in."""

    play_from_area: Pose  # its middle; +Y up
    size_m: tuple[float, float]  # along x and z


@dataclass(frozen=True)
class Pulse:
    """A buzz for a hand."""

    side: str  # of SIDES
    strength: float  # 0..1
    seconds: float


@dataclass(frozen=True)
class Frame:
    """What a frame loop gives: where the eyes and hands will be, and when."""

    # play_from_eye, one an eye, then where there are any its insets; off-centre tangents, pixels of
    # its target
    views: tuple[View, ...]
    head: Pose  # play_from_head
    hands: dict[str, Hand]  # of SIDES
    seen_s: float  # the runtime's predicted display time, seconds since the session began
    period_s: float  # of the runtime's frames
    drawn: bool  # False: nothing is shown now, so nothing is to be drawn
    focused: bool  # False: somebody else has the hands; they are LOST
    recentred: bool = False  # the room has a new origin since the last frame
    area: Area | None = None  # where the runtime knows it
