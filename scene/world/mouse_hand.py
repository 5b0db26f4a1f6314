"""A mouse as a hand in the world: pure, struct in, struct out.

The hand floats on a plane across the line of sight.  Dragging moves it in that plane, the wheel
pushes it away and pulls it near, a drag with a modifier turns what it holds as if that were a ball
under the mouse.  Places on the picture are in logical pixels from its top left.
"""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.shapes import four
from shapeshift.scene.pose import Pose, View

NOTCH = 1.08  # times as far, one notch of the wheel
TURN = 0.008  # radians a pixel
ROLL = 0.12  # radians a notch, around the line of sight
NEAREST = 2.0  # of the eye's near plane: a hand stays that far
FARTHEST_M = 1000.0

Size = tuple[float, float]  # of the picture, logical pixels


@dataclass(frozen=True)
class MouseHand:
    """Where a mouse holds something."""

    place: tuple[float, float]  # on the picture
    depth_m: float  # along the line of sight, from the eye to the hand's plane
    wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)  # world_from_hand


def ray(view: View, place: tuple[float, float], size: Size) -> tuple[np.ndarray, np.ndarray]:
    """(3,) metres where a ray through a place of the picture begins, (3,) its unit direction."""
    way = along(view, place, size)
    return np.array(view.world_from_eye.position, np.float64), way / np.linalg.norm(way)


def along(view: View, place: tuple[float, float], size: Size) -> np.ndarray:
    """(3,) metres, world axes: from the eye to the place, a metre deep."""
    left, right, low, high = view.tangents
    x = left + (right - left) * place[0] / size[0]
    y = high + (low - high) * place[1] / size[1]
    return view.world_from_eye.matrix()[:3, :3] @ np.array([x, y, -1.0])


def hand_at(view: View, size: Size, point: np.ndarray) -> MouseHand:
    """A hand at a point (3,) of the world before the eye."""
    x, y, z = (view.eye_from_world() @ np.append(point, 1.0))[:3]
    left, right, low, high = view.tangents
    depth = bounded_depth(view, float(-z))
    across = (x / depth - left) / (right - left) * size[0]
    down = (high - y / depth) / (high - low) * size[1]
    return MouseHand((float(across), float(down)), depth)


def pose(hand: MouseHand, view: View, size: Size) -> Pose:
    """Where the hand is in the world, seen from where the eye is now."""
    eye = np.asarray(view.world_from_eye.position, np.float64)
    return Pose(eye + hand.depth_m * along(view, hand.place, size), np.array(hand.wxyz))


def moved(hand: MouseHand, dx: float, dy: float, size: Size) -> MouseHand:
    """Dragged by so many pixels, right and down; not out of the picture, nobody could bring it
    back.
    """
    x, y = (
        float(np.clip(at + by, min(0, at), max(most, at)))
        for at, by, most in zip(hand.place, (dx, dy), size, strict=True)
    )
    return replace(hand, place=(x, y))


def pushed(hand: MouseHand, notches: float, view: View) -> MouseHand:
    """Away from the eye; pulled near with negative notches."""
    depth = hand.depth_m * NOTCH ** float(np.clip(notches, -100, 100))
    return replace(hand, depth_m=bounded_depth(view, depth))


def turned(hand: MouseHand, dx: float, dy: float, view: View) -> MouseHand:
    """Rolled under the mouse: about the eye's up by dx, about its right by dy."""
    right, up, _ = view.world_from_eye.matrix()[:3, :3].T
    turn = multiply(about(right, dy * TURN), about(up, dx * TURN))
    return with_turn(hand, turn)


def rolled(hand: MouseHand, notches: float, view: View) -> MouseHand:
    """About the line of sight, clockwise as the eye sees it."""
    back = view.world_from_eye.matrix()[:3, 2]
    return with_turn(hand, about(back, -notches * ROLL))


def with_turn(hand: MouseHand, turn: np.ndarray) -> MouseHand:
    wxyz = multiply(turn, np.array(hand.wxyz))
    return replace(hand, wxyz=four(wxyz / np.linalg.norm(wxyz)))


def bounded_depth(view: View, depth: float) -> float:
    return float(np.clip(depth, NEAREST * view.near, max(FARTHEST_M, NEAREST * view.near)))


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """wxyz of a turn about a unit axis (3,) by radians."""
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """wxyz of turning by b, then by a."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *vector])
