"""A film of a scene as a library has it: the command `film`, without its words."""

import contextlib
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapeshift.api.arguments import PathText, Progress, Size
from shapeshift.api.opened import OpenedScene
from shapeshift.app.document import Document
from shapeshift.app.drawing import make_folder, open_renderer
from shapeshift.app.errors import UsageError
from shapeshift.app.film.film import (
    Options,
    check_out,
    clock_of,
    form_of,
    is_video,
    named_path,
    numbers_of,
    plan_of,
    size_of,
)
from shapeshift.app.paths import plain
from shapeshift.scene.cameras.camera_list import CameraList, moved
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.app.film.draw_film import FrameFolder
    from shapeshift.app.film.film_plan import FilmPlan
    from shapeshift.scene.film.film_path import FilmPath


HOW = (
    "smooth",
    "ease",
    "hold",
    "streams",
    "stereo",
    "supersample",
    "every",
    "codec",
    "background",
    "depth_unit",
    "overwrite",
    "drawing",
    "context",
)  # options of the command that a call takes by their names


def film(
    scene: OpenedScene,
    out: PathText,
    cameras: Any,
    style_path: str,
    clock: tuple[float | None, float | None],
    size: Size | None,
    progress: Progress | None,
    how: dict[str, Any],
) -> Path:
    """What Scene.film makes, and where it is.  clock: seconds and fps."""
    for name in how:
        if name not in HOW:
            raise UsageError(f"there is no option '{name}'; there are {', '.join(HOW)}.")
    if size is not None and len(size) != 2:
        raise UsageError(f"size is {size}; (width, height) in pixels is wanted.")
    up, flip = scene.turned
    options = Options(
        scene=scene.path or Path("scene"), out=plain(out), up=up, flip=flip,  # type: ignore[arg-type]
        style_path=style_path, seconds=clock[0], fps=clock[1],
        size=f"{size[0]}x{size[1]}" if size is not None else "",
        cameras=str(cameras) if isinstance(cameras, str | PathLike) else "auto", **how,
    )  # fmt: skip
    if options.streams and is_video(options.out):
        raise UsageError("streams are pictures; give a folder as out.")
    path, listed = path_of(scene, cameras, options)
    return make(scene.subject, options, path, listed, progress or (lambda what, part: None))


def path_of(
    scene: OpenedScene, cameras: Any, options: Options
) -> "tuple[FilmPath | None, CameraList | None]":
    """Which way is meant; UsageError for what is none."""
    if isinstance(cameras, str | PathLike):
        if str(cameras) == "auto" and scene.path is None:
            return None, None
        return named_path(options)
    if isinstance(cameras, CameraList):
        return None, cameras
    views = [cameras] if isinstance(cameras, View) else list(cameras)
    if not views or not all(isinstance(view, View) for view in views):
        raise UsageError(
            "cameras are 'auto', 'orbit', a file or folder of cameras, a CameraList, or Views."
        )
    views = moved(views, scene.origin.tolist())  # plans take cameras of the file's world
    return None, CameraList(tuple(views), ("",) * len(views), "views")


def make(
    document: Document, options: Options, path: "FilmPath | None", cameras: CameraList | None,
    progress: Progress,
) -> Path:  # fmt: skip
    """Draws and writes it.  Raises UsageError, BadFile."""
    from shapeshift.app.film.draw_film import draw_frames
    from shapeshift.app.film.film_plan import read_style
    from shapeshift.app.film.write_video import write_video
    from shapeshift.scene.film.film_path import exact_fps

    clock, size = clock_of(options, path), size_of(options, path)
    codec = check_out(options, clock, size)
    style = read_style(options.style_path or (path.style if path else ""), clock.seconds)
    plan = plan_of(options, document, path, cameras, (clock, size, style))
    plan.controls(0)  # refuses a stop that is none
    form, numbers = form_of(options, plan), numbers_of(options, len(plan.places))
    done = [0]

    def report(what: str) -> None:
        done[0] += 1
        progress(what, done[0] / len(numbers))

    make_folder(options.out.parent)
    with frame_folder(options, plan) as folder:
        with open_renderer(options.context, options.drawing, lambda said: None) as (renderer, _):
            background = options.background or document.background
            renderer.settings = replace(renderer.settings, background=background)
            draw_frames(renderer, plan, numbers, folder, form, lambda number: report("drawing"))
        if is_video(options.out):
            done[0], fps = 0, exact_fps(clock.fps) / options.every
            frames: Sequence[Path] = [folder.frame(number) for number in numbers]
            write_video(options.out, frames, fps, codec, lambda number: report("encoding"))
    return options.out


@contextlib.contextmanager
def frame_folder(options: Options, plan: "FilmPlan") -> "Iterator[FrameFolder]":
    """Where the frames go: into the folder that was named, or for a video where nobody looks."""
    from shapeshift.app.film.draw_film import FrameFolder, frame_facts
    from shapeshift.app.film.film import streams_of

    if is_video(options.out):
        with tempfile.TemporaryDirectory(prefix="shapeshift-film-") as path:
            yield FrameFolder(Path(path))
        return
    folder = FrameFolder(options.out, streams_of(options))
    rows = [frame_facts(plan, frame) for frame in range(len(plan.places))]
    # Arrays of a scene can be edited: no frames of an earlier call are taken for this one's.
    folder.begin("", {"frames": len(rows), "rows": rows}, options.overwrite)
    yield folder
