"""The cameras of a file that the viewer steps through: a short flight from one to the next."""

from dataclasses import replace

import numpy as np

from shapeshift.app.editor.state.camera.camera import Box
from shapeshift.runtime_models.shapes import four
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.camera_path import slerp
from shapeshift.scene.control import ease
from shapeshift.scene.pose import Pose, View

FLIGHT_S = 0.4  # from one camera to the next
LONGEST_NAME = 40  # letters in the status line


class Steps:
    """Which camera is looked through, or none; times in seconds come from outside."""

    def __init__(self) -> None:
        self.cameras: CameraList | None = None
        self.untold: tuple[str, ...] = ()  # what the file's reader assumed, until it is shown
        self.index = -1  # the last one that was stood at
        self.at_camera = False  # whether the picture is that camera's; moving freely leaves it
        self._from: View | None = None  # where the flight began
        self._seconds = FLIGHT_S

    def set_cameras(self, cameras: CameraList | None) -> None:
        """Cameras instead of those that there were; nobody stands at one yet."""
        self.cameras, self.index, self.at_camera, self._from = cameras, -1, False, None
        self.untold = cameras.notes if cameras else ()

    @property
    def count(self) -> int:
        return len(self.cameras.views) if self.cameras else 0

    @property
    def stood_at(self) -> View:
        """The camera that is looked through, while `standing`."""
        assert self.cameras is not None  # nobody stands at a camera where there is none
        return self.cameras.views[self.index]

    @property
    def moving(self) -> bool:
        return self.at_camera and self._seconds < FLIGHT_S

    @property
    def text(self) -> str:
        """ "camera 3 of 96 NAME" while standing at one, else how many there are."""
        if self.cameras is None or not self.count:
            return ""
        if not self.at_camera:
            return f"{self.count} cameras" if self.count > 1 else "1 camera"
        name = self.cameras.names[self.index]
        short = name if len(name) <= LONGEST_NAME else "\u2026" + name[1 - LONGEST_NAME :]
        return f"camera {self.index + 1} of {self.count} {short}".strip()

    def step(self, by: int, now: View) -> bool:
        """To the next (1) or the one before (-1), from the picture `now`; False without cameras.

        After a free movement, a step back returns to the camera that was left; a step on goes to
        the next one.
        """
        if not self.count:
            return False
        index = 0 if self.index < 0 and by > 0 else (self.index + by) % self.count
        self.go_to(self.count - 1 if self.index < 0 and by < 0 else index, now)
        return True

    def go_to(self, index: int, now: View | None = None) -> None:
        """To that camera, in flight from `now`, or at once."""
        self.index, self.at_camera = index, True
        self._from, self._seconds = now, 0.0 if now is not None else FLIGHT_S

    def leave(self) -> None:
        self.at_camera = False

    def advance(self, seconds: float) -> None:
        self._seconds = min(self._seconds + seconds, FLIGHT_S)

    def view(self, size: tuple[int, int], free: Box, near: float, far: float) -> View:
        """What is seen now in size (W, H) pixels: the camera's whole picture fits into `free`."""
        wanted = fitted(self.stood_at, size, free)
        wanted = replace(wanted, near=min(near, wanted.near), far=max(far, wanted.far))
        if not self.moving or self._from is None:
            return wanted
        part = ease(self._seconds / FLIGHT_S)
        return between(self._from, wanted, part)


def fitted(view: View, size: tuple[int, int], free: Box) -> View:
    """The same eye in a window of size (W, H): its picture whole and central in `free` pixels."""
    left, right, low, high = view.tangents
    x0, y0, x1, y1 = free
    per_pixel = max((right - left) / (x1 - x0), (high - low) / (y1 - y0))
    middle_x, middle_y = (left + right) / 2, (low + high) / 2  # tangents at the middle of `free`
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    width, height = size
    tangents = (
        middle_x - x * per_pixel, middle_x + (width - x) * per_pixel,
        middle_y - (height - y) * per_pixel, middle_y + y * per_pixel,
    )  # fmt: skip
    return replace(view, tangents=tangents, size=size)


def picture_box(view: View, shown: View) -> Box:
    """Where a camera's own picture ends in what is shown of it, in pixels of the window."""
    left, right, low, high = view.tangents
    l, r, d, u = shown.tangents
    width, height = shown.size
    per_x, per_y = width / (r - l), height / (u - d)
    return ((left - l) * per_x, (u - high) * per_y, (right - l) * per_x, (u - low) * per_y)


def between(one: View, other: View, part: float) -> View:
    """A view on the way from one to the other, 0..1; pixels and depths are the other's."""
    a, b = one.world_from_eye, other.world_from_eye
    turn = slerp(a.wxyz[None], b.wxyz[None], np.array([part]))[0]
    pose = Pose(a.position + (b.position - a.position) * part, turn)
    tangents = four(s + (t - s) * part for s, t in zip(one.tangents, other.tangents, strict=True))
    return replace(other, world_from_eye=pose, tangents=tangents)
