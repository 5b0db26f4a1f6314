"""From where the editor looks: the camera that hands move, or one of a file; what moves it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.app.editor.state.camera.camera import (
    EVERYTHING,
    FIRST,
    SMOOTH_S,
    Box,
    EditorCamera,
    fov_y_of,
)
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import four, three
from shapeshift.scene.cameras.camera_list import CameraList, moved
from shapeshift.scene.cameras.camera_path import slerp
from shapeshift.scene.cameras.write_cameras import COLMAP_FORMS, write_cameras
from shapeshift.scene.control import ease
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import FirstView
from shapeshift.scene.pose import Pose, View

STRAIGHT = 1e-3  # sine of the angle from straight up or down, where a file knows no upper side
NEAR_FREE = 0.5  # pixels: nearer to where the overlay leaves room is there


class Viewpoint:
    """`size` tells the window's (W, H) in pixels, `free_wanted` the (4,) part of it that the
    overlay leaves free: left, top, right, bottom.
    """

    def __init__(
        self,
        state: EditorState,
        size: Callable[[], tuple[int, int]],
        free_wanted: Callable[[], np.ndarray],
        folder: Path,
    ) -> None:
        self._state, self._size, self.free_wanted = state, size, free_wanted
        self.free = free_wanted()  # where the picture's middle is; follows the overlay
        self.camera = self._first_camera()
        self.steps = Steps()
        self.kept = KeptViews(folder)
        self.flown: View | None = None  # of a film that is looked at; moving freely leaves it
        self.seen = False  # whether a frame has shown anything from here

    def _first_camera(self) -> EditorCamera:
        """The camera of a new scene: on its floor where one is given, else the whole in view."""
        state = self._state
        camera = EditorCamera(state.first_view(self.free_size()), state.first_target, state.radius)
        self._take_lens(camera)
        home = state.first_look.home
        if home is not None:
            camera.toggle_flying()
            camera.stand(home.world_from_eye, fov_y_of(home))
        return camera

    def _take_lens(self, camera: EditorCamera) -> None:
        """Parallel rays and near plane as the file states them for its first view."""
        stated = self._state.edited.file.view
        camera.orthographic = stated is not None and stated.orthographic
        camera.near_m = stated.near_m if stated is not None else 0.0

    def start_anew(self) -> None:
        """The state has another scene."""
        self.camera = self._first_camera()
        self.steps.leave()
        self.flown = None

    # ---- what is seen

    def view(self) -> View:
        """What the window shows: a camera that was stepped to, or what the hand has turned to."""
        view = self.camera.view(self._size(), tuple(self.free))
        if self.flown is not None:
            return fitted(self.flown, view.size, tuple(self.free))
        if self.steps.at_camera:
            return self.steps.view(view.size, tuple(self.free), view.near, view.far)
        return view

    @property
    def parallel(self) -> bool:
        """Whether rays are parallel: never those of a film or of a file's camera."""
        return self.flown is None and not self.steps.at_camera and self.camera.parallel

    def limits(self, settings: RenderSettings) -> RenderSettings:
        """The settings; for parallel rays, whose eye is far away from all, without a distance."""
        return replace(settings, max_distance=np.inf) if self.parallel else settings

    def eye_view(self) -> View:
        """As `view`, but of rays that meet in the eye: what regions and lenses follow."""
        if not self.parallel:
            return self.view()
        return self.camera.eye_view(self._size(), tuple(self.free))

    def stated(self) -> FirstView:
        """The view of now as a scene file states it."""
        free = self.flown is None and not self.steps.at_camera
        view = self.camera.eye_view(self.free_size()) if free else self.plain_view()
        eye, axes = view.world_from_eye.position, view.world_from_eye.matrix()[:3, :3]
        ahead = -axes[:, 2]
        far = float(np.dot((self.camera.target if free else self._state.centre) - eye, ahead))
        target = eye + ahead * max(far, 0.01 * self._state.radius)
        if np.hypot(ahead[0], ahead[2]) < STRAIGHT:  # a little towards where the upper side points
            target = target + axes[:, 1] * STRAIGHT * float(np.linalg.norm(target - eye))
        flags = (self.camera.parallel, self.camera.near_m) if free else (False, 0.0)
        return edits.rounded(FirstView(three(eye), three(target), fov_y_of(view), *flags))

    def go_to(self, stated: FirstView) -> None:
        """Flies to a view that the scene file states."""
        self.leave_camera()
        camera = self.camera
        if camera.flying and stated.orthographic:
            camera.toggle_flying()
        camera.orthographic, camera.near_m = stated.orthographic, stated.near_m
        camera.go_to(np.array(stated.eye), np.array(stated.target), stated.fov_y)

    def plain_view(self) -> View:
        """The same without what the overlay covers: a camera as filed, or centred."""
        if self.flown is not None:
            return self.flown
        if self.steps.at_camera and not self.steps.moving:
            return self.steps.stood_at
        return self.camera.view(self.free_size())

    def free_size(self) -> tuple[int, int]:
        left, top, right, bottom = self.free_wanted()
        return int(right - left), int(bottom - top)

    @property
    def moving(self) -> bool:
        return self.camera.moving or self.steps.moving

    @property
    def sliding(self) -> bool:
        """Whether the picture is still moving over for the overlay."""
        return not np.array_equal(self.free, self.free_wanted())

    def follow_overlay(self, seconds: float) -> None:
        """The picture moves over when the overlay comes or goes, in the same soft way."""
        wanted = self.free_wanted()
        self.free = wanted + (self.free - wanted) * np.exp(-seconds / SMOOTH_S)
        if np.abs(self.free - wanted).max() < NEAR_FREE or not self.seen:
            self.free = wanted

    def refit(self, size: tuple[int, int]) -> None:
        """The free part has another size: what no hand has moved is fitted into it."""
        if self.steps.at_camera or self.flown is not None:
            return
        if self.camera.framed == FIRST and self._state.first_look.home is None:
            self.camera.come_home(self._state.first_view(size))
        elif self.camera.framed == EVERYTHING:
            distance = self._state.fit(self.view(), self.camera.fov_y, size)
            self.camera.frame(self._state.centre, distance)

    # ---- what moves it

    def leave_camera(self) -> None:
        """From the camera that was stepped to, where it stands, to moving freely."""
        if self.steps.at_camera or self.flown is not None:
            view, (_, top, _, bottom) = self.view(), self.free
            height = (view.tangents[3] - view.tangents[2]) * (bottom - top) / view.size[1]
            self.camera.stand(view.world_from_eye, 2 * float(np.arctan(height / 2)))
            self.steps.leave()
            self.flown = None

    def fly(self, view: View) -> None:
        """Looks at a frame of a film, until somebody moves."""
        self.steps.leave()
        self.flown = view

    def look_from(self, side: str) -> None:
        """From one of camera.py's DIRECTIONS."""
        self.leave_camera()
        self.camera.look_from(side)

    def frame_all(self) -> None:
        self.leave_camera()
        distance = self._state.fit(self.view(), self.camera.fov_y, self.free_size())
        self.camera.frame(self._state.centre, distance)

    def go_home(self) -> None:
        """To the first view."""
        self.leave_camera()
        self._take_lens(self.camera)
        self.camera.come_home(self._state.first_view(self.free_size()))

    def toggle_orthographic(self) -> None:
        """Parallel rays, or those that meet in the eye; what is orbited keeps its size."""
        self.leave_camera()
        if self.camera.flying:
            self.camera.toggle_flying()
            self.camera.orthographic = True
        else:
            self.camera.orthographic = not self.camera.orthographic

    def toggle_flying(self) -> None:
        self.leave_camera()
        self.camera.toggle_flying()

    def follow_cameras(self, cameras: CameraList | None, stand: bool) -> None:
        """Other cameras to step through; to the first of them at once where one is to `stand`."""
        now, self.flown = self.view(), None
        self.steps.set_cameras(cameras)
        if stand and cameras is not None:
            self.steps.go_to(0, now if self.seen else None)
            self.steps.untold = ()  # said with the file's other notes

    def step_to_camera(self, by: int) -> None:
        """To the next (1) or the previous (-1), with a word on what its file leaves out."""
        steps = self.steps
        now, self.flown = self.view(), None
        if not steps.step(by, now):
            self._state.say(said("There are no cameras to step through; drop a file of them here."))
        elif steps.untold:
            self._state.say("\n".join(steps.untold))
            steps.untold = ()

    def keep_view(self) -> None:
        """Writes the view of now, as it would be without the panel, behind those kept before."""
        (view,) = moved([self.plain_view()], self._state.origin.tolist())
        try:
            path = self.kept.keep(view)
        except BadFile as error:
            self._state.messages.fail(str(error))
        except OSError as error:
            facts = {"why": error.strerror, "path": error.filename}
            self._state.messages.fail(said("The view cannot be kept: {why}: {path}", **facts))
        else:
            self._state.say(said("Kept in {path}", path=path.absolute()))


# The cameras of a file that the viewer steps through: a short flight from one to the next.

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


# The views that a person keeps, in a file of this start.


class KeptViews:
    """The views that a person keeps; every one is written at once, into a file of this start."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._number = 0
        self.form = "ours"
        self.views: list[View] = []

    def keep(self, view: View) -> Path:
        """Adds a view; returns where all of them lie now.  Raises BadFile, OSError."""
        self._folder.mkdir(parents=True, exist_ok=True)
        if not self._number:
            taken = {path.name.split(".")[0] for path in self._folder.glob("views-*")}
            self._number = next(n for n in range(1, 10**6) if f"views-{n:04d}" not in taken)
        views = (*self.views, view)
        if self.form == "vr":  # a floor is one view: the last
            views = views[-1:]
        names = tuple(f"view {i + 1}" for i in range(len(views)))
        ending = "" if self.form in COLMAP_FORMS else f".{self.form}.json"
        path = self._folder / f"views-{self._number:04d}{ending}"
        write_cameras(CameraList(views, names, self.form), path, self.form)
        self.views.append(view)
        return path
