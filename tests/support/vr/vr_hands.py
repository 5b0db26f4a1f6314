"""Hands and frames for the tests of what is in the room: no runtime."""

from dataclasses import replace

import numpy as np

from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.vr.frame import LOST, Frame, Hand
from shapeshift.vr.panel import Carried, PanelPlane

PLANE = PanelPlane((320, 360), 0.001)
OPEN = Carried(PLANE, open=True, pinned=True)  # a panel that a menu button has opened
HEAD = Pose(np.array([0.0, 1.6, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
GRIP_TURN = np.array([0.8660254, 0.5, 0.0, 0.0])  # 60 degrees up, as a fist holds a controller


def eyes(size: tuple[int, int] = (200, 180), head: Pose = HEAD) -> tuple[View, View]:
    """Two eyes with the leaning fields of view of a headset."""
    right = head.matrix()[:3, 0] * 0.032
    return tuple(
        View(Pose(head.position + side * right, head.wxyz), tangents, 0.05, 100.0, size)
        for side, tangents in ((-1, (-1.2, 0.9, -1.1, 1.0)), (1, (-0.9, 1.2, -1.1, 1.0)))
    )


def hand_at(position, target=None, **state) -> Hand:
    """A hand at a place (3,), whose ray goes through `target`; metres of the room."""
    position = np.asarray(position, np.float64)
    ahead = position - np.array([0.0, 0.0, 1.0]) if target is None else np.asarray(target, float)
    return Hand(True, Pose(position, GRIP_TURN), look_at(position, ahead), **state)


def moved(hand: Hand, by) -> Hand:
    """The hand (3,) metres elsewhere, turned as before."""
    grip, aim = (Pose(pose.position + np.asarray(by), pose.wxyz) for pose in (hand.grip, hand.aim))
    return replace(hand, grip=grip, aim=aim)


def a_frame(left: Hand = LOST, right: Hand = LOST, seen_s: float = 0.0, **state) -> Frame:
    fields = {"views": eyes(), "head": HEAD, "period_s": 1 / 72, "drawn": True, "focused": True}
    return Frame(hands={"left": left, "right": right}, seen_s=seen_s, **(fields | state))


def pixel_of(view: View, place: np.ndarray) -> tuple[int, int]:
    """(row from the top, column) of a place (3,) of the view's own world."""
    clip = view.clip_from_eye() @ view.eye_from_world() @ np.append(place, 1.0)
    x, y = clip[:2] / clip[3]
    width, height = view.size
    return int((1 - y) / 2 * height), int((1 + x) / 2 * width)
