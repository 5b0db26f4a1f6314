"""Frames of a headset as tests write them: a head at standing height and hands before it."""

import math
from dataclasses import replace

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import LOST, Frame, Hand

LEVEL = np.array([1.0, 0, 0, 0])
HERE = {"left": (-0.2, 1.2, -0.4), "right": (0.2, 1.2, -0.4)}


def at(x: float, y: float, z: float, wxyz: object = LEVEL) -> Pose:
    return Pose(np.array([x, y, z], float), np.array(wxyz, float))


def tilted(radians: float) -> np.ndarray:
    """wxyz of a look upwards."""
    return np.array([math.cos(radians / 2), math.sin(radians / 2), 0, 0])


def yawed(radians: float) -> np.ndarray:
    """wxyz of a look to the left."""
    return np.array([math.cos(radians / 2), 0, math.sin(radians / 2), 0])


def hand(side: str = "right", place: object = None, wxyz: object = LEVEL, **named) -> Hand:
    pose = at(*(HERE[side] if place is None else place), wxyz)
    return replace(Hand(True, pose, pose), **named)


def frame(left: Hand | None = None, right: Hand | None = None, head: Pose | None = None, **named):
    """A frame; hands not given rest where they are, LOST ones are lost."""
    hands = {"left": left or hand("left"), "right": right or hand("right")}
    head = head or at(0.1, 1.7, 0.2)
    return Frame((), head, hands, 0.0, 1 / 90, True, True, **named)


__all__ = ["LOST", "at", "frame", "hand", "tilted", "yawed"]
