"""A glass in a hand for tests: the fist that holds it up, and which rays meet it."""

import math
from dataclasses import replace

import numpy as np

from shapeshift.scene.pose import Pose, View
from shapeshift.vr.frame import Hand
from shapeshift.vr.glass import HeldGlass
from tests.support.vr.vr_hands import hand_at

BEFORE = (0.05, 1.45, -0.5)  # a hand before the eyes


def upright(position=BEFORE, turned: float = 0.0) -> Hand:
    """A fist whose thumb is up, turned by radians about the handle."""
    hand = hand_at(position)
    up = np.array([math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0])  # the grip's -Z to the sky
    about = np.array([math.cos(turned / 2), 0.0, math.sin(turned / 2), 0.0])
    matrix = Pose(np.zeros(3), about).matrix() @ Pose(np.zeros(3), up).matrix()
    matrix[:3, 3] = position
    return replace(hand, grip=Pose.from_matrix(matrix))


def away_of(glass: HeldGlass, view: View) -> np.ndarray:
    """(H, W) metres from the disc's middle where the ray of a pixel meets its plane, row 0 below:
    a ray tracer of one plane.
    """
    left, right, down, up = view.tangents
    rows, columns = np.mgrid[: view.size[1], : view.size[0]]
    x = left + (columns + 0.5) * (right - left) / view.size[0]
    y = down + (rows + 0.5) * (up - down) / view.size[1]
    along = np.stack([x, y, -np.ones_like(x)], axis=2) @ view.world_from_eye.matrix()[:3, :3].T
    plane = glass.play_from_glass.matrix()
    eye, normal = view.world_from_eye.position, plane[:3, 2]
    metres = (plane[:3, 3] - eye) @ normal / (along @ normal)
    meets = eye + along * metres[..., None] - plane[:3, 3]
    return np.where(metres > 0, np.linalg.norm(meets, axis=2), 1e3)
