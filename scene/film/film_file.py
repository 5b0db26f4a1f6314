"""NAME.film.json: a FilmPath on disk, written by the viewer and the command, read by both."""

import json
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import MOST_BYTES, CameraList, CameraReading
from shapeshift.scene.cameras.own_cameras import own_rows, read_own_cameras
from shapeshift.scene.film.film_path import (
    EASE,
    FPS_RANGE,
    SECONDS_RANGE,
    FilmKey,
    FilmPath,
    check_clock,
    check_keys,
)
from shapeshift.scene.film.style_path import read_style_path
from shapeshift.scene.pose import View

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
    text = json.dumps(film_rows(film), indent=1, ensure_ascii=False) + "\n"
    write_whole(path, text.encode())
