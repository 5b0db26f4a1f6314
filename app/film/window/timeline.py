"""The film that a person makes in the window: keys of cameras and of stops, and the playhead."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.film.film_plan import (
    Clock,
    FilmPlan,
    film_of,
    keyed_plan,
    orbit_plan,
    read_style,
    tour_plan,
)
from shapeshift.scene.cameras.camera_list import CameraList, moved
from shapeshift.scene.film.film_path import FilmKey, FilmPath, eased_places, frame_times
from shapeshift.scene.film.flight import keyed_flight
from shapeshift.scene.film.style_path import PERCENT, WrittenKey, WrittenPath
from shapeshift.scene.pose import View

CAMERA, STOP = "camera", "stop"
SIZE = (1280, 720)
LEAST_GAP_S = 0.05  # between two keys
KEYS = 9  # that an orbit or a tour becomes


@dataclass(frozen=True)
class FilmKeys:
    """What is edited, undone and saved; cameras are views of the shown world, each with a time."""

    cameras: tuple[FilmKey, ...] = ()
    stops: tuple[WrittenKey, ...] = ()
    seconds: float = 10.0
    fps: float = 30.0
    size: tuple[int, int] = SIZE

    def times(self, track: str) -> list[float]:
        if track == CAMERA:
            return [key.at_s or 0.0 for key in self.cameras]
        return [key.at for key in self.stops]

    @property
    def style(self) -> str:
        """As `read_style_path` reads it."""
        return WrittenPath(self.stops).text() if self.stops else ""

    def path(self, origin: Sequence[float]) -> FilmPath:
        """As a file has it: in the file's world, whose zero lies at -origin of the shown one."""
        views = moved([key.view for key in self.cameras], origin)
        cameras = (replace(key, view=v) for key, v in zip(self.cameras, views, strict=True))
        return FilmPath(tuple(cameras), self.style, self.seconds, self.fps, self.size)


class Timeline:
    """Edits replace `keys`; `did` says what was done since the history heard of it last."""

    def __init__(self) -> None:
        self.keys = FilmKeys()
        self.did, self.together = "", ""
        self.at_s = 0.0  # the playhead
        self.playing = False
        self.chosen: tuple[str, int] | None = None  # track and number of the key that is edited
        self.problem = ""  # why there is no film, one sentence
        self._plan: tuple[FilmKeys | None, tuple, FilmPlan | None] = (None, (), None)

    def forget(self) -> None:
        """Another scene."""
        self.__init__()  # type: ignore[misc]

    def restore(self, keys: FilmKeys) -> None:
        """What it was before an edit, or after one that was undone."""
        self.keys, self.chosen = keys, None

    def _edit(self, what: str, together: str = "", **values) -> None:
        self.keys = replace(self.keys, **values)
        self.did, self.together = what, together

    # ---- keys

    def add_camera(self, view: View) -> None:
        """A camera key at the playhead; one that is there already is replaced."""
        kept = [k for k in self.keys.cameras if abs((k.at_s or 0.0) - self.at_s) >= LEAST_GAP_S]
        cameras = sorted([*kept, FilmKey(view, self.at_s)], key=lambda key: key.at_s or 0.0)
        self._edit("key of the camera", cameras=tuple(cameras))
        self.chosen = (CAMERA, self.keys.times(CAMERA).index(self.at_s))

    def add_stop(self, word: str) -> None:
        """A key of what is shown at the playhead."""
        kept = [k for k in self.keys.stops if abs(k.at - self.at_s) >= LEAST_GAP_S]
        stops = sorted([*kept, WrittenKey(word, self.at_s)], key=lambda key: key.at)
        self._edit("key of a stop", stops=tuple(stops))
        self.chosen = (STOP, self.keys.times(STOP).index(self.at_s))

    def move(self, track: str, number: int, at_s: float) -> None:
        """Drags a key along the film; it stays between its neighbours."""
        times = self.keys.times(track)
        low = times[number - 1] + LEAST_GAP_S if number else 0.0
        high = times[number + 1] - LEAST_GAP_S if number + 1 < len(times) else self.keys.seconds
        at_s = min(max(at_s, low), max(high, low))
        what, together = f"move a key of the {track}", f"{track} {number}"
        if track == CAMERA:
            cameras = list(self.keys.cameras)
            cameras[number] = replace(cameras[number], at_s=at_s, hold_s=0.0)
            self._edit(what, together, cameras=tuple(cameras))
        else:
            stops = list(self.keys.stops)
            stops[number] = replace(stops[number], at=at_s)
            self._edit(what, together, stops=tuple(stops))

    def delete(self) -> bool:
        """Takes the chosen key away; False where none is chosen."""
        if self.chosen is None:
            return False
        (track, number), self.chosen = self.chosen, None
        rows = self.keys.cameras if track == CAMERA else self.keys.stops
        left = (*rows[:number], *rows[number + 1 :])
        if track == CAMERA:
            self._edit("delete a key of the camera", cameras=left)
        else:
            self._edit("delete a key of a stop", stops=left)
        return True

    def clear(self) -> None:
        """Takes all keys away."""
        self.chosen = None
        self._edit("clear the film", cameras=(), stops=())

    def set_clock(self, seconds: float, fps: float, size: tuple[int, int]) -> None:
        """Another length stretches what there is; the keys stay at their parts of it."""
        factor = seconds / self.keys.seconds
        cameras = tuple(
            replace(k, at_s=(k.at_s or 0.0) * factor, hold_s=k.hold_s * factor)
            for k in self.keys.cameras
        )
        stops = tuple(replace(k, at=k.at * factor) for k in self.keys.stops)
        values = {"cameras": cameras, "stops": stops, "seconds": seconds, "fps": fps, "size": size}
        self._edit("length of the film", "clock", **values)
        self.at_s = min(self.at_s * factor, seconds)

    def fill(self, document: Document, cameras: CameraList | None) -> None:
        """Keys of a way once around the scene, or past cameras: the film's own ways."""
        keys = self.keys
        clock = Clock(keys.seconds, keys.fps)
        if cameras is None:
            plan = orbit_plan(document, replace(clock, ease=0.0), keys.size, None)
            last = replace(plan, places=np.append(plan.places, 1.0))  # the end is a key, too
            made = film_of(document, replace(last, closed=False), KEYS)
        else:
            made = film_of(document, tour_plan(document, cameras, clock, keys.size, None), KEYS)
        what = "way around the scene" if cameras is None else "way past the cameras"
        self._edit(what, cameras=made.keys)
        self.chosen = None

    def take_over(self, film: FilmPath, origin: Sequence[float]) -> None:
        """A film that was read from a file; keys without a time get those that they are met at."""
        views = moved([key.view for key in film.keys], [-float(c) for c in origin])
        keys = [replace(key, view=v) for key, v in zip(film.keys, views, strict=True)]
        if keys and not film.timed:
            places = keyed_flight(views).key_places
            times = frame_times(1001, film.seconds)
            met = np.interp(places, eased_places(times, film.seconds, film.ease), times)
            keys = [replace(key, at_s=float(t)) for key, t in zip(keys, met, strict=True)]
        style = read_style(film.style, film.seconds)
        stops = style.keys if style is not None else ()
        if style is not None and style.unit == PERCENT:
            stops = tuple(replace(k, at=k.at * film.seconds) for k in stops)
        size = film.size or SIZE
        self.keys = FilmKeys(tuple(keys), stops, film.seconds, film.fps, size)
        self.did, self.together, self.chosen, self.at_s = "open a film", "", None, 0.0

    # ---- what it shows

    def plan(self, document: Document) -> FilmPlan | None:
        """The film as it would be drawn; None where there is none yet, or `problem` says why."""
        objects = tuple((obj.name, id(obj.model)) for obj in document.scene.objects)
        known, of, plan = self._plan
        if known is not self.keys or of != objects:  # keys are replaced, and their views are arrays
            plan = self._make(document)
            self._plan = (self.keys, objects, plan)
        return plan

    def _make(self, document: Document) -> FilmPlan | None:
        self.problem, keys = "", self.keys
        if not document.scene.objects or not (keys.cameras or keys.stops):
            return None
        try:
            clock = Clock(keys.seconds, keys.fps)
            style = read_style(keys.style, keys.seconds)
            if keys.cameras:
                plan = keyed_plan(document, keys.path((0, 0, 0)), clock, keys.size, style)
            else:
                plan = orbit_plan(document, replace(clock, ease=0.0), keys.size, style)
            plan.controls(0)
        except UsageError as error:
            self.problem = str(error)
            return None
        return plan

    def frame(self, plan: FilmPlan) -> int:
        """The frame under the playhead."""
        return int(
            np.clip(np.searchsorted(plan.times, self.at_s + 1e-9) - 1, 0, len(plan.times) - 1)
        )

    def advance(self, seconds: float) -> None:
        """Lets a preview go on; at its end it begins again."""
        if self.playing:
            self.at_s += seconds
            if self.at_s >= self.keys.seconds:
                self.at_s %= self.keys.seconds
