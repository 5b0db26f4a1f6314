"""How a room is moved about the world: pure functions from one PlaySpace to another.

The room always stays level; it is turned about the world's up alone.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import IDENTITY
from shapeshift.vr.frame import Area, Frame, Hand

# Where the room of a headset stands in the world, and how large the world is seen from it.


@dataclass(frozen=True)
class PlaySpace:
    """world = position + scale * rotation @ play; scale 1 is the true one."""

    world_from_play: Pose = IDENTITY
    scale: float = 1.0  # metres of the world a metre of the room: 2 makes the world look half

    def pose(self, play_from_local: Pose) -> Pose:
        """World pose of something in the room."""
        matrix = self.world_from_play.matrix() @ play_from_local.matrix()
        away = self.world_from_play.matrix()[:3, :3] @ play_from_local.position * self.scale
        turned = Pose.from_matrix(matrix)
        return Pose(self.world_from_play.position + away, turned.wxyz)

    def point(self, play: np.ndarray) -> np.ndarray:
        """(3,) metres of the world of a point of the room."""
        return self.pose(Pose(np.asarray(play, np.float64), IDENTITY.wxyz)).position

    def view(self, play_view: View) -> View:
        """An eye of the room in the world; its near and far grow with the scale."""
        return replace(
            play_view,
            world_from_eye=self.pose(play_view.world_from_eye),
            near=play_view.near * self.scale,
            far=play_view.far * self.scale,
        )


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


# How high the floor lies below somebody's eyes: the room raised for those who sit.
#
# Who sits sees the scene from where they would stand: the whole room is raised by what is missing,
# so that all else (jumps, sizes, the grid) goes on as if they stood.

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
