"""Which scene each frame of a film shows, and from where: all of it before anything is drawn."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.camera_files import AUTO
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.cameras.framing import fit_points
from shapeshift.scene.film.film_path import (
    EASE,
    CameraPath,
    Circle,
    FilmPath,
    check_clock,
    check_keys,
    eased_places,
    exact_fps,
    frame_times,
    keyed_places,
)
from shapeshift.scene.film.flight import keyed_flight, tour
from shapeshift.scene.film.style_path import (
    PERCENT,
    StylePath,
    WrittenPath,
    read_style_path,
    style_path_of,
)
from shapeshift.scene.pose import View, look_at
from shapeshift.scene.scene import Scene

if TYPE_CHECKING:
    from shapeshift.scene.cameras.camera_list import CameraList

ORBIT = "orbit"
SIZE = (1280, 720)  # pixels, where nobody says
STEEPEST = 1.2  # radians above or below what is gone around
AROUND = 16  # views of a circle whose pictures everything has to be in
MOST_POINTS = 50_000  # of a scene, that say so
FAR_FROM_PHOTOS = 0.5  # of the distance to the subject: pictures are worse there


@dataclass(frozen=True)
class Clock:
    """How long a film is, and how its camera starts and stops."""

    seconds: float = 10.0
    fps: float = 30.0
    ease: float = EASE
    hold_s: float = 0.0

    def __post_init__(self) -> None:
        """Raises UsageError."""
        try:
            check_clock(self.seconds, self.fps)
        except ValueError as error:
            raise UsageError(f"--{error}") from None
        if not 0 <= self.ease <= 0.5:
            raise UsageError(f"--ease is {self.ease:g}, expected a share of the film, 0 to 0.5.")
        if not 0 <= 2 * self.hold_s < self.seconds:
            raise UsageError(
                f"--hold is {self.hold_s:g}, expected less than half of {self.seconds:g} seconds."
            )

    @property
    def frames(self) -> int:
        return check_clock(self.seconds, self.fps)


@dataclass(frozen=True)
class FilmPlan:
    """Every frame of a film of a document."""

    document: Document
    camera: CameraPath
    size: tuple[int, int]  # pixels of one eye's picture
    clock: Clock
    places: np.ndarray  # (frames,) 0..1 of the camera's way
    style: WrittenPath | None = None
    closed: bool = False  # the end is the beginning again
    note: str = ""  # what one should know, one sentence

    @cached_property
    def times(self) -> np.ndarray:
        """(frames,) seconds."""
        return frame_times(len(self.places), self.clock.seconds, self.closed)

    @cached_property
    def paths(self) -> tuple[StylePath | None, ...]:
        """The style path of each object; None: it stays as the scene has it.  Raises UsageError."""
        objects = self.document.scene.objects
        if self.style is None:
            return (None,) * len(objects)
        if len(self.document.stops) < 2:
            raise UsageError("--style-path: the scene has no second stop to go to; leave it out.")
        rows: list[tuple[Control, ...]] = []
        document = self.document
        for key in self.style.keys:  # one without such a stop stays where the key before has it
            document = document.placed(key.word, "--style-path")
            rows.append(tuple(obj.x for obj in document.scene.objects))
        return tuple(
            style_path_of(self.style, [row[i] for row in rows], obj.model.blend)
            for i, obj in enumerate(objects)
        )

    def at(self, frame: int) -> float:
        """Where a frame is on the style path: seconds, or the place of the camera."""
        by_place = self.style is not None and self.style.unit == PERCENT
        return float((self.places if by_place else self.times)[frame])

    def view(self, frame: int) -> View:
        """From where a frame is seen."""
        return self.camera.view(float(self.places[frame]), self.size)

    def controls(self, frame: int) -> tuple[Control, ...]:
        """The control of every object in a frame."""
        objects = self.document.scene.objects
        return tuple(
            obj.x if path is None else path.control(self.at(frame))
            for obj, path in zip(objects, self.paths, strict=True)
        )

    def scene(self, frame: int) -> Scene:
        """What a frame shows."""
        pairs = zip(self.document.scene.objects, self.controls(frame), strict=True)
        return Scene(tuple(replace(obj, x=x) for obj, x in pairs))


def read_style(text: str, seconds: float) -> WrittenPath | None:
    """The style path of a text; None for an empty one.  Raises UsageError."""
    try:
        return read_style_path(text, seconds) if text.strip() else None
    except ValueError as error:
        raise UsageError(f"--style-path: {error}") from None


def orbit_plan(
    document: Document, clock: Clock, size: tuple[int, int], style: WrittenPath | None
) -> FilmPlan:
    """Once around what a document shows, from the side from which it is first looked at."""
    camera = circle_around(document, size)
    times = frame_times(clock.frames, clock.seconds, closed=True)
    places = eased_places(times, clock.seconds, clock.ease, clock.hold_s)
    return FilmPlan(document, camera, size, clock, places, style, closed=True)


def circle_around(document: Document, size: tuple[int, int]) -> Circle:
    """As near as all of it stays in the picture, all the way."""
    first, (centre, _) = document.view(size), document.bounds()
    means, opacity = (each[:: max(len(each) // MOST_POINTS, 1)] for each in document.points())
    away = first.world_from_eye.position - centre
    level = float(np.hypot(away[0], away[2]))
    rise = float(np.clip(np.arctan2(away[1], level), -STEEPEST, STEEPEST))
    side = np.array([away[0], 0, away[2]]) / level if level > 0 else np.array([0.0, 0, 1])
    back = np.cos(rise) * side + np.array([0, np.sin(rise), 0])
    shifted = replace(first, world_from_eye=look_at(centre + back, centre))
    circle = Circle(shifted, centre)
    views = [circle.view(k / AROUND, size) for k in range(AROUND)]
    distance = max(
        fit_points(means, opacity, centre, v.world_from_eye.matrix(), v.tangents) for v in views
    )
    return Circle(replace(first, world_from_eye=look_at(centre + distance * back, centre)), centre)


def tour_plan(
    document: Document, cameras: "CameraList", clock: Clock, size: tuple[int, int],
    style: WrittenPath | None, smooth: float = 1.0,
) -> FilmPlan:  # fmt: skip
    """Past the cameras of a capture; `cameras` in the world of the document's file."""
    flight = tour(document.sees(cameras).views, size, smooth)
    times = frame_times(clock.frames, clock.seconds)
    places = eased_places(times, clock.seconds, clock.ease, clock.hold_s)
    note = ""
    if flight.farthest > FAR_FROM_PHOTOS:
        note = (
            f"The way leads {flight.farthest:.0%} of the distance to the subject past the nearest "
            "photo, where pictures are worse; a smaller --smooth keeps nearer to them."
        )
    return FilmPlan(document, flight, size, clock, places, style, note=note)


def keyed_plan(
    document: Document, film: FilmPath, clock: Clock, size: tuple[int, int],
    style: WrittenPath | None,
) -> FilmPlan:  # fmt: skip
    """Through the keys of a film file, in the world of the document's file.  Raises UsageError."""
    from shapeshift.scene.cameras.camera_list import moved

    try:
        check_keys(film.keys, clock.seconds)
    except ValueError as error:
        raise UsageError(f"--cameras: {error}") from None
    views = moved([key.view for key in film.keys], (-document.origin).tolist())
    flight = keyed_flight(views)
    times = frame_times(clock.frames, clock.seconds)
    if film.timed:
        places = keyed_places(film.keys, flight.key_places, times)
    else:
        places = eased_places(times, clock.seconds, clock.ease, clock.hold_s)
    return FilmPlan(document, flight, size, clock, places, style)


def path_of_cameras(cameras: "CameraList") -> FilmPath:
    """A file that is a path already, with frames a second, as a FilmPath that plays as it does."""
    from shapeshift.scene.film.film_path import FilmKey

    count = len(cameras.views)
    seconds = max(count / cameras.fps, 0.01)
    at = np.linspace(0, seconds, count) if count > 1 else np.zeros(1)
    keys = (FilmKey(v, float(t)) for v, t in zip(cameras.views, at, strict=True))
    return FilmPath(tuple(keys), "", seconds, float(exact_fps(cameras.fps)))


def film_of(document: Document, plan: FilmPlan, keys: int = 12) -> FilmPath:
    """A plan as a film file: keys along its way, with their times, in the world of the file."""
    from shapeshift.scene.cameras.camera_list import moved
    from shapeshift.scene.film.film_path import FilmKey

    frames = np.unique(np.linspace(0, len(plan.places) - 1, keys).round().astype(int))
    views = moved([plan.view(int(k)) for k in frames], document.origin.tolist())
    at = [float(plan.times[k]) for k in frames]
    clock, style = plan.clock, plan.style.text() if plan.style else ""
    made = (FilmKey(v, t) for v, t in zip(views, at, strict=True))
    return FilmPath(tuple(made), style, clock.seconds, clock.fps, plan.size, clock.ease)


def found_cameras(scene: Path, options) -> "CameraList | None":
    """The cameras that lie with a scene, or None."""
    from shapeshift.app.camera_files import camera_reading
    from shapeshift.scene.cameras.read_cameras import find_cameras, read_camera_list

    path = find_cameras(scene)
    return read_camera_list(path, camera_reading(options)) if path else None


def is_named(cameras: str) -> bool:
    """Whether --cameras names a file."""
    return cameras not in (AUTO, ORBIT)
