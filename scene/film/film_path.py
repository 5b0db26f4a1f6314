"""What a film shows when: cameras and a style path on one clock.  docs/film.md has its file."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import MOST_BYTES, CameraList, CameraReading
from shapeshift.scene.cameras.own_cameras import own_rows, read_own_cameras
from shapeshift.scene.film.style_path import read_style_path
from shapeshift.scene.pose import Pose, View

EASE = 0.12  # of a film, at either end: in which the camera gets to its speed
MOST_FRAMES = 100_000
FPS_RANGE = (1.0, 240.0)
SECONDS_RANGE = (0.01, 36_000.0)
FINEST_FPS = 1001  # denominator of frame rates: 30000/1001 is 29.97


class CameraPath(Protocol):
    """Where the camera is at each place of its way."""

    def view(self, place: float, size: tuple[int, int]) -> View:
        """At a place from 0 to 1."""
        ...


@dataclass(frozen=True)
class Circle:
    """Once around the vertical through a centre, from a view on: the last place is the first."""

    first: View
    centre: np.ndarray  # (3,) metres

    def view(self, place: float, size: tuple[int, int]) -> View:
        """The first view turned by 2 pi times the place, counter-clockwise seen from above."""
        angle = 2 * np.pi * place
        turn = Pose(np.zeros(3), np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0])).matrix()
        turn[:3, 3] = self.centre - turn[:3, :3] @ self.centre
        up = self.first.tangents[3]
        right = up * size[0] / size[1]
        pose = Pose.from_matrix(turn @ self.first.world_from_eye.matrix())
        return View(pose, (-right, right, -up, up), self.first.near, self.first.far, size)


@dataclass(frozen=True)
class FilmKey:
    """A camera through which a film goes."""

    view: View
    at_s: float | None = None  # when; None: where constant apparent speed leads there
    hold_s: float = 0.0  # how long the camera stands there


@dataclass(frozen=True)
class FilmPath:
    """The content of a film file: what the command's --cameras reads and the viewer writes."""

    keys: tuple[FilmKey, ...]  # at least one; all with a time, or none
    style: str = ""  # as `read_style_path` reads it; "": the scene as it opens
    seconds: float = 10.0
    fps: float = 30.0
    size: tuple[int, int] | None = None  # pixels; None: the command's default
    ease: float = EASE

    @property
    def timed(self) -> bool:
        """Whether its keys say when."""
        return any(key.at_s is not None for key in self.keys)


def check_clock(seconds: float, fps: float) -> int:
    """The number of frames.  ValueError, one sentence."""
    for name, value, (low, high) in (
        ("seconds", seconds, SECONDS_RANGE), ("fps", fps, FPS_RANGE),
    ):  # fmt: skip
        if not low <= value <= high:
            raise ValueError(f"{name} is {value:g}, expected {low:g} to {high:g}.")
    frames = max(round(seconds * exact_fps(fps)), 1)
    if frames > MOST_FRAMES:
        raise ValueError(f"seconds times fps are {frames:,} frames; at most {MOST_FRAMES:,} are.")
    return frames


def exact_fps(fps: float) -> Fraction:
    """29.97 as 30000/1001."""
    near = Fraction(round(fps * FINEST_FPS / 1000) * 1000, FINEST_FPS)
    return (
        near
        if abs(near - fps) < 0.005 and fps != round(fps)
        else Fraction(fps).limit_denominator(FINEST_FPS)
    )


def frame_times(frames: int, seconds: float, closed: bool = False) -> np.ndarray:
    """(frames,) seconds: from 0 to the end; of a closed way the end is the beginning again."""
    return np.arange(frames) / max(frames - (not closed), 1) * seconds


def eased_places(times: np.ndarray, seconds: float, ease: float, hold_s: float = 0) -> np.ndarray:
    """(n,) places 0..1 at times: constant speed, slow in the share `ease` at either end; before
    and after it the camera stands `hold_s`.
    """
    moving = max(seconds - 2 * hold_s, 1e-9)
    t = np.clip((times - hold_s) / moving, 0, 1)
    if not ease > 0:
        return t

    def way(u: np.ndarray) -> np.ndarray:  # the integral of 10 u^3 - 15 u^4 + 6 u^5
        return u**4 * (2.5 + u * (u - 3))

    start, end = np.minimum(t, ease) / ease, np.maximum(t - 1 + ease, 0) / ease
    cruise = np.clip(t - ease, 0, 1 - 2 * ease)
    return (ease * way(start) + cruise + ease * (0.5 - way(1 - end))) / (1 - ease)


def keyed_places(keys: Sequence[FilmKey], key_places: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(n,) places at times of keys that say when: monotone cubics, at rest while a key holds."""
    from scipy.interpolate import PchipInterpolator

    at: list[float] = []
    places: list[float] = []
    for key, place in zip(keys, key_places.tolist(), strict=True):
        at.append(key.at_s or 0.0)
        places.append(place)
        if key.hold_s > 0:
            at.append((key.at_s or 0.0) + key.hold_s)
            places.append(place)
    if len(at) < 2:
        return np.full(len(times), places[0])
    return np.clip(PchipInterpolator(at, places)(np.clip(times, at[0], at[-1])), 0, 1)


def check_keys(keys: Sequence[FilmKey], seconds: float) -> None:
    """ValueError, one sentence, where times of keys are no order, or only some have one."""
    if not keys:
        raise ValueError("it has no camera; add one.")
    given = [key.at_s is not None for key in keys]
    if any(given) and not all(given):
        raise ValueError("some of its cameras have a time and some have none; give all or none.")
    if not any(given):
        return
    ends = [(key.at_s or 0.0, (key.at_s or 0.0) + key.hold_s) for key in keys]
    for number, (before, after) in enumerate(pairwise(ends), 2):
        if not before[1] < after[0]:
            raise ValueError(
                f"camera {number} has the time {after[0]:g} s, at which the one before it still "
                f"stands or is not reached ({before[1]:g} s); times must rise."
            )
    if not ends[-1][1] <= seconds:
        raise ValueError(
            f"its last camera is there until {ends[-1][1]:g} s, the film ends at {seconds:g} s."
        )


# NAME.film.json: a FilmPath on disk, written by the viewer and the command, read by both.

MARK = "shapeshift_film"
VERSION = 1
ENDING = ".film.json"
MOST_SIDE = 16384


def is_film_file(path: Path) -> bool:
    """Whether a file says of itself that it is one."""
    if not path.is_file() or path.suffix.lower() != ".json":
        return False
    try:
        data = read_json(path, most_bytes=MOST_BYTES)
    except (BadFile, OSError):
        return False
    return isinstance(data, dict) and MARK in data


def film_beside(scene: Path) -> Path:
    """Where the film of a scene lies that the window keeps with it."""
    name = scene.name.removesuffix(".json").removesuffix(".scene")
    stem = name if name != scene.name else scene.stem
    return scene.with_name(f"{stem or scene.name}{ENDING}")


def read_film_file(path: Path, cameras: int = 1) -> FilmPath:
    """cameras: how many it has at least.  Raises BadFile, one sentence."""
    return film_of(read_json(path, most_bytes=MOST_BYTES), path.name, cameras)


def film_of(data: object, name: str, cameras: int = 1) -> FilmPath:
    """What such a file holds, of what JSON gives; name: for messages.  Raises BadFile."""
    fields = Fields(data, name, "see docs/film.md")
    fields.count(MARK, VERSION, VERSION)
    seconds = fields.number("seconds", 10.0, "seconds from 0.01 to 36000", *SECONDS_RANGE)
    fps = fields.number("fps", 30.0, "1 to 240", *FPS_RANGE)
    ease = fields.number("ease", EASE, "0 to 0.5", 0.0, 0.5)
    style = fields.text("style", "")
    rows = fields.rows("cameras", 100_000, "camera")
    size = None
    if fields.has("size"):
        width, height = fields.numbers("size", 2, most=MOST_SIDE)
        if not (width >= 1 and height >= 1 and width == int(width) and height == int(height)):
            raise fields.error("size", f"[width, height] in whole pixels up to {MOST_SIDE}")
        size = (int(width), int(height))
    views: tuple[View, ...] = ()
    if rows or cameras:
        own = [dict(row.data) for row in rows]
        views = read_own_cameras(own, CameraReading(), name).views
    fields.refuse_unknown_keys()
    keys = tuple(
        FilmKey(
            view,
            row.number("time", None, "seconds from 0", 0.0, SECONDS_RANGE[1]),
            row.number("hold", 0.0, "seconds from 0", 0.0, SECONDS_RANGE[1]),
        )
        for view, row in zip(views, rows, strict=True)
    )
    try:
        check_clock(seconds, fps)
        if keys or cameras:
            check_keys(keys, seconds)
        if style:
            read_style_path(style, seconds)
    except ValueError as error:
        raise BadFile(f"{name}: {error}") from None
    return FilmPath(keys, style, seconds, fps, size, ease)


def film_rows(path: FilmPath) -> dict:
    """The file as JSON has it."""
    views = tuple(key.view for key in path.keys)
    rows = own_rows(CameraList(views, ("",) * len(views), "film"))
    for row, key in zip(rows, path.keys, strict=True):
        if key.at_s is not None:
            row["time"] = float(key.at_s)
        if key.hold_s > 0:
            row["hold"] = float(key.hold_s)
    size = {"size": list(path.size)} if path.size else {}
    clock = {"seconds": float(path.seconds), "fps": float(path.fps), "ease": float(path.ease)}
    return {MARK: VERSION} | clock | size | {"style": path.style, "cameras": rows}


def write_film_file(film: FilmPath, path: Path) -> None:
    """Whole or not at all."""
    write_whole(path, film_bytes(film))


def film_bytes(film: FilmPath) -> bytes:
    """What is written."""
    return (json.dumps(film_rows(film), indent=1, ensure_ascii=False) + "\n").encode()
