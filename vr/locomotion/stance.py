"""How a room is moved about the world: pure functions from one PlaySpace to another.

The room always stays level; it is turned about the world's up alone.
"""

import math
from dataclasses import replace

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.locomotion.play_space import PlaySpace

UP = np.array([0.0, 1.0, 0.0])
LEAST_SCALE, MOST_SCALE = 0.01, 100.0  # metres of the world a metre of the room
FAR_M = 1e4  # metres from the world's origin: beyond, float32 pictures tremble
LEVEL = 1e-3  # of a direction's level part: below, it points up or down


def yaw(radians: float) -> Pose:
    """A turn about up; positive is to the left, seen from above anticlockwise."""
    return Pose(np.zeros(3), np.array([math.cos(radians / 2), 0.0, math.sin(radians / 2), 0.0]))


def heading(wxyz: np.ndarray) -> float:
    """Radians of yaw in which a head or an eye looks; its own up decides where it looks up."""
    back, up = Pose(np.zeros(3), wxyz).matrix()[:3, [2, 1]].T
    if math.hypot(back[0], back[2]) >= LEVEL:
        return math.atan2(back[0], back[2])
    # Straight up (back points down) its up points behind it, straight down ahead.
    ahead = up if back[1] > 0 else -up
    return math.atan2(-ahead[0], -ahead[2])


def moved(play_space: PlaySpace, by: np.ndarray) -> PlaySpace:
    """The room shifted by (3,) metres of the world."""
    at = np.clip(play_space.world_from_play.position + by, -FAR_M, FAR_M)
    return replace(play_space, world_from_play=Pose(at, play_space.world_from_play.wxyz))


def pinned(play_space: PlaySpace, play: np.ndarray, world: np.ndarray) -> PlaySpace:
    """The room shifted so that a point (3,) of it lies at a point (3,) of the world."""
    return moved(play_space, np.asarray(world) - play_space.point(play))


def turned(play_space: PlaySpace, radians: float, about: np.ndarray) -> PlaySpace:
    """The room turned to the left about a point (3,) of it, which stays where it is."""
    there = play_space.point(about)
    room = play_space.world_from_play
    wxyz = Pose.from_matrix(yaw(radians).matrix() @ room.matrix()).wxyz
    return pinned(replace(play_space, world_from_play=Pose(room.position, wxyz)), about, there)


def scaled(play_space: PlaySpace, scale: float, about: np.ndarray) -> PlaySpace:
    """Another scale, held within bounds; a point (3,) of the room stays where it is."""
    there = play_space.point(about)
    scale = min(max(float(scale), LEAST_SCALE), MOST_SCALE)
    return pinned(replace(play_space, scale=scale), about, there)


def underfoot(head: Pose) -> np.ndarray:
    """(3,) metres, room: the floor below the head."""
    return head.position * (1 - UP)


def resized(play_space: PlaySpace, head: Pose, scale: float) -> PlaySpace:
    """Another scale, the feet staying on the spot."""
    return scaled(play_space, scale, underfoot(head))


def play_space_before(
    eye: Pose, head: Pose, floor_y: float | None = None, scale: float = 1.0
) -> PlaySpace:
    """The head over the place of a world's eye and turned its way: the start, and recentring.

    On the floor where the world has one, else with the head at the eye's height.
    """
    level = yaw(heading(eye.wxyz) - heading(head.wxyz))
    play_space = PlaySpace(Pose(np.zeros(3), level.wxyz), scale)
    play_space = pinned(play_space, head.position, eye.position)
    if floor_y is None:
        return play_space
    return moved(play_space, UP * (floor_y - play_space.point(underfoot(head))[1]))
