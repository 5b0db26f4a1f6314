"""How high the floor lies below somebody's eyes: the room raised for those who sit.

Who sits sees the scene from where they would stand: the whole room is raised by what is missing,
so that all else (jumps, sizes, the grid) goes on as if they stood.
"""

import math
from dataclasses import replace

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import Area, Frame, Hand

POSTURES = ("standing", "seated")
LOWEST_M, HIGHEST_M = -0.6, 1.6  # that a room is raised by


def lift_of(posture: str, head_y_m: float, eye_height_m: float) -> float:
    """Metres by which the room is raised for a head that is so high over its floor."""
    if posture != "seated" or not math.isfinite(head_y_m):
        return 0.0
    return min(max(eye_height_m - head_y_m, LOWEST_M), HIGHEST_M)


def lifted(frame: Frame, lift_m: float) -> Frame:
    """The frame with all that is in the room so much higher over its floor."""
    if lift_m == 0:
        return frame
    return replace(
        frame,
        views=tuple(
            replace(view, world_from_eye=raised(view.world_from_eye, lift_m))
            for view in frame.views
        ),
        head=raised(frame.head, lift_m),
        hands={side: _raised_hand(hand, lift_m) for side, hand in frame.hands.items()},
        area=_raised_area(frame.area, lift_m),
    )


def raised(pose: Pose, by_m: float) -> Pose:
    return Pose(pose.position + np.array([0.0, by_m, 0.0]), pose.wxyz)


def _raised_hand(hand: Hand, by_m: float) -> Hand:
    joints = None if hand.joints is None else hand.joints + np.array([0.0, by_m, 0.0, 0.0])
    return replace(
        hand,
        grip=None if hand.grip is None else raised(hand.grip, by_m),
        aim=None if hand.aim is None else raised(hand.aim, by_m),
        joints=joints,
    )


def _raised_area(area: Area | None, by_m: float) -> Area | None:
    return area and replace(area, play_from_area=raised(area.play_from_area, by_m))
