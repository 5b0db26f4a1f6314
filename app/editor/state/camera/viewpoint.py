"""From where the editor looks: the camera that hands move, or one of a file; what moves it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.app.editor.state.camera.camera import (
    EVERYTHING,
    FIRST,
    SMOOTH_S,
    EditorCamera,
    fov_y_of,
)
from shapeshift.app.editor.state.camera.kept_views import KeptViews
from shapeshift.app.editor.state.camera.stepping import Steps, fitted
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.cameras.camera_list import CameraList, moved
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import FirstView
from shapeshift.scene.pose import View

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
