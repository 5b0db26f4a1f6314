"""launch.py film: a flight through a scene that changes on the way, as a video or pictures."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.cluster.open_cluster import NONE, ClusterOptions
from shapeshift.app.command_line import EXPERT, POSITIONAL, SIZE, Opt
from shapeshift.app.opening import DrawingOptions
from shapeshift.app.paths import full
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.app.document import Document
    from shapeshift.app.film.draw_film import FrameFolder, FrameForm
    from shapeshift.app.film.film_plan import Clock, FilmPlan
    from shapeshift.scene.appearance import Background
    from shapeshift.scene.cameras.camera_list import CameraList
    from shapeshift.scene.film.film_path import FilmPath

ORBIT_EASE = 0.0  # a circle is played again and again
MOST_SUPERSAMPLE = 8


@dataclass(frozen=True)
class Options(ClusterOptions, DrawingOptions):
    """Make a film of a scene: a flight at constant apparent speed past the cameras of its capture,
    around it, or along a path from the viewer, while the scene goes from stop to stop.

    Started again after an interruption it goes on with the frame that is missing."""

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers or a scene file."""
    out: Path
    """NAME.mp4, NAME.webm (both want PyAV: the command `extras film`), NAME.webp, NAME.gif, or a
    folder for numbered pictures."""
    cameras: Annotated[str, Opt(metavar="CAMERAS")] = "auto"
    """auto (cameras that lie with the scene, else orbit), orbit, a file or folder of cameras, or a
    NAME.film.json from the viewer (docs/film.md)."""
    style_path: Annotated[str, Opt(metavar="PATH")] = ""
    """What the scene shows when: "RGB@0 Thermal@3s Opened@6s", or in % of the camera's way:
    "RGB@20% Opened@80%".  Two equal neighbours hold.  Default: as the scene opens."""
    seconds: float | None = None
    """How long the film is.  Default: 10, or what the file of the path says."""
    fps: float | None = None
    """Frames a second.  Default: 30, or what the file of the path says."""
    size: Annotated[str, SIZE] = ""
    """WIDTHxHEIGHT in pixels, of one eye.  Default: 1280x720, or what the file of the path says."""
    smooth: float = 1.0
    """How far a flight past cameras may leave them for a calm way; 0: through each of them."""
    ease: float | None = None
    """Share of the film, 0 to 0.5, in which the camera gets to its speed and stops again.
    Default: 0.12, around the scene 0."""
    hold: float = 0.0
    """Seconds that the camera stands at the beginning and at the end."""
    streams: Annotated[tuple[str, ...], Opt(metavar="STREAM")] = ()
    """depth, normal, coverage: a folder of 16-bit PNG of each beside the film.
    Default: none."""
    stereo: float = 0.0
    """Distance of two eyes in metres; above 0 each frame holds both, side by side."""
    supersample: int = 1
    """Pixels a side that are drawn for each of the film's, 1 to 8."""
    poster: Path | None = None
    """A PNG file for the frame in the middle of the film.  Default: none."""
    every: int = 1
    """Draw each N-th frame alone, for a first look; the film stays as long."""
    codec: Literal["", "h264", "av1", "vp9"] = ""
    """How a video is packed.  Default: h264 in .mp4, vp9 in .webm.  With av1 and vp9 the file is
    the same to the byte each time; of h264 only the frames are."""
    background: tuple[float, float, float] | None = None
    """Red, green and blue behind everything, 0 to 1 as displayed.  Default: what the scene was
    trained on, else black."""
    save_path: Path | None = None
    """A NAME.film.json for the viewer and other films, with twelve cameras of the way.
    Default: none."""
    keep_frames: bool = False
    """Leave NAME.frames beside the video, for another one of the same frames."""
    overwrite: bool = False
    """Replace the film, and frames of another one, in --out."""
    only: Annotated[str, Opt(expert=True, metavar="FRAMES")] = ""
    """Draw these frames alone, such as 57 or 0:150 (150 not with it): the parts of a film may be
    drawn by several machines into one folder.  Default: all."""
    fov_y: Annotated[float, EXPERT] = 0.0
    """Degrees from top to bottom, for a camera file that says nothing about the lens.  Default:
    0, not known."""
    depth_unit: Annotated[float | None, EXPERT] = None
    """Metres a step of the depth stream.  Default: the finest power of ten that reaches the far
    side."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""


def run(options: Options) -> int:
    from shapeshift.app.camera_files import refuse_fov
    from shapeshift.app.cluster.open_cluster import check_cluster
    from shapeshift.app.document import open_document
    from shapeshift.app.film.draw_film import FrameFolder
    from shapeshift.app.film.film_plan import read_style

    check_cluster(options)
    refuse_fov(options.fov_y)
    # What needs no scene comes before it: large ones take a while to open.
    path, cameras = named_path(options)
    clock = clock_of(options, path)
    size = size_of(options, path)
    codec = check_out(options, clock, size)
    style = read_style(options.style_path or (path.style if path else ""), clock.seconds)
    numbers = numbers_of(options, clock.frames)
    document = open_document(options.scene, options)
    plan = plan_of(options, document, path, cameras, (clock, size, style))
    plan.controls(0)  # refuses a stop that is none, before anything is written
    form = form_of(options, plan)
    folder = FrameFolder(frames_path(options.out), form.streams, form.pixels(plan.size))
    begin(options, plan, form, folder)
    if plan.note:
        say(plan.note)
    try:
        draw_lacking(options, plan, form, folder, numbers)
    except KeyboardInterrupt:
        there = len(numbers) - len(folder.lacking(numbers))
        say(f"{there} of {len(numbers)} frames are drawn: {full(folder.path)}; start it again.")
        raise
    finish(options, plan, folder, numbers, codec)
    return 0


def named_path(options: Options) -> "tuple[FilmPath | None, CameraList | None]":
    """What --cameras names: a path that is played as it is, or cameras to fly past; or neither."""
    from shapeshift.app.camera_files import named_cameras
    from shapeshift.app.film.film_plan import found_cameras, is_named, path_of_cameras
    from shapeshift.app.paths import plain
    from shapeshift.scene.film.film_path import is_film_file, read_film_file

    if options.cameras == "auto":
        return None, found_cameras(options.scene, options)
    if not is_named(options.cameras):
        return None, None
    if is_film_file(plain(options.cameras)):
        return read_film_file(plain(options.cameras)), None
    cameras = named_cameras(options.cameras, options.scene, options)
    for note in cameras.notes:
        say(note)
    return (path_of_cameras(cameras), None) if cameras.fps > 0 else (None, cameras)


def clock_of(options: Options, path: "FilmPath | None") -> "Clock":
    """Raises UsageError."""
    from shapeshift.app.film.film_plan import Clock
    from shapeshift.scene.film.film_path import EASE

    seconds = options.seconds if options.seconds is not None else path.seconds if path else 10.0
    fps = options.fps if options.fps is not None else path.fps if path else 30.0
    circle = path is None and options.cameras == "orbit"
    ease = options.ease
    if ease is None:
        ease = path.ease if path else ORBIT_EASE if circle else EASE
    return Clock(seconds, fps, ease, options.hold)


def size_of(options: Options, path: "FilmPath | None") -> tuple[int, int]:
    """Pixels of one eye.  Raises UsageError."""
    from shapeshift.app.drawing import parse_size
    from shapeshift.app.film.film_plan import SIZE as USUAL

    if options.size:
        return parse_size(options.size)
    return (path.size if path else None) or USUAL


def check_out(options: Options, clock: "Clock", size: tuple[int, int]) -> str:
    """The codec, "" where none is wanted.  Raises UsageError where options cannot work."""
    from shapeshift.app.drawing import LARGEST_SIDE, MOST_PIXELS
    from shapeshift.app.errors import UsageError
    from shapeshift.app.film.write_video import check_video

    out = options.out
    if not 0 <= options.stereo < 1:
        raise UsageError(f"--stereo is {options.stereo}, expected metres from 0 to 1.")
    if not 1 <= options.supersample <= MOST_SUPERSAMPLE:
        raise UsageError(
            f"--supersample is {options.supersample}, expected 1 to {MOST_SUPERSAMPLE}."
        )
    drawn = [side * options.supersample for side in size]
    if max(drawn) > LARGEST_SIDE or drawn[0] * drawn[1] > MOST_PIXELS:
        raise UsageError(
            f"--supersample {options.supersample} of {size[0]}x{size[1]} are {drawn[0]}x{drawn[1]} "
            f"pixels; up to {LARGEST_SIDE} a side and {MOST_PIXELS:,} are drawn."
        )
    if not 0 <= options.smooth <= 10:
        raise UsageError(f"--smooth is {options.smooth:g}, expected 0 to 10.")
    if options.every < 1:
        raise UsageError(f"--every is {options.every}, expected 1 or more.")
    if options.background and not all(0 <= c <= 1 for c in options.background):
        raise UsageError(f"--background is {options.background}, expected three values in 0..1.")
    if options.depth_unit is not None and not 1e-9 <= options.depth_unit <= 1e6:
        raise UsageError(f"--depth-unit is {options.depth_unit}, expected metres above 0.")
    streams_of(options)
    refuse_taken(options)
    if not is_video(out):
        if options.codec:
            raise UsageError("--codec is for .mp4 and .webm; a folder holds pictures.")
        return ""
    if options.only:
        raise UsageError("--only draws a part of a film; give a folder as --out, and the video is "
                         "made of the whole later.")  # fmt: skip
    return check_video(
        out, options.codec, (size[0] * (1 + (options.stereo > 0)), size[1]), clock.fps
    )


def refuse_taken(options: Options) -> None:
    """Raises UsageError where a file that would be written is there."""
    from shapeshift.app.errors import UsageError
    from shapeshift.app.film.write_video import PICTURES, VIDEOS

    if options.out.suffix and not is_video(options.out) and not options.out.is_dir():
        known = ", ".join([*VIDEOS, *PICTURES])
        raise UsageError(f"--out ends in {options.out.suffix}; {known}, or a folder, is wanted.")
    if is_video(options.out) and options.out.is_dir():
        raise UsageError(f"{options.out} is a folder; choose another --out.")
    if not is_video(options.out) and options.out.is_file():
        raise UsageError(f"{options.out} is a file; a folder is wanted, or a name with an ending.")
    if options.poster is not None and options.poster.suffix.lower() != ".png":
        raise UsageError(f"--poster is {options.poster}; a name that ends in .png is wanted.")
    for path in (options.out if is_video(options.out) else None, options.poster, options.save_path):
        if path is not None and path.exists() and not options.overwrite:
            raise UsageError(f"{path} exists; choose another name or add --overwrite.")


def is_video(out: Path) -> bool:
    """Whether one file is wanted, and no folder."""
    from shapeshift.app.film.write_video import PICTURES, VIDEOS

    return out.suffix.lower() in (*VIDEOS, *PICTURES)


def frames_path(out: Path) -> Path:
    """Where the frames lie."""
    return out.with_suffix(".frames") if is_video(out) else out


def streams_of(options: Options) -> tuple[str, ...]:
    """Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.app.film.draw_film import STREAMS

    words = [word for text in options.streams for word in text.split(",") if word]
    for word in words:
        if word not in STREAMS:
            raise UsageError(f"--streams has '{word}'; {', '.join(STREAMS)} are known.")
    return tuple(dict.fromkeys(words))


def plan_of(
    options: Options, document: "Document", path: "FilmPath | None",
    cameras: "CameraList | None", form: tuple,
) -> "FilmPlan":  # fmt: skip
    """form: (Clock, size, style path).  Raises UsageError."""
    from shapeshift.app.film.film_plan import keyed_plan, orbit_plan, tour_plan

    clock, size, style = form
    if path is not None:
        return keyed_plan(document, path, clock, size, style)
    if cameras is not None:
        return tour_plan(document, cameras, clock, size, style, options.smooth)
    if options.cameras == "auto":
        clock = replace(clock, ease=ORBIT_EASE if options.ease is None else options.ease)
        note = "No cameras lie with the scene: the film goes around it once."
        return replace(orbit_plan(document, clock, size, style), note=note)
    return orbit_plan(document, clock, size, style)


def form_of(options: Options, plan: "FilmPlan") -> "FrameForm":
    from shapeshift.app.commands.outputs import choose_unit
    from shapeshift.app.film.draw_film import FrameForm

    step = max(len(plan.places) // 50, 1)
    views = [plan.view(frame) for frame in range(0, len(plan.places), step)]
    unit = options.depth_unit or choose_unit(*plan.document.bounds(), views)
    return FrameForm(options.stereo, options.supersample, streams_of(options), unit)


def numbers_of(options: Options, count: int) -> list[int]:
    """The frames that are asked for.  Raises UsageError."""
    from shapeshift.app.errors import UsageError

    if not options.only:
        return list(range(0, count, options.every))
    first, colon, end = options.only.partition(":")
    if not (
        first.isascii() and first.isdigit() and (not colon or (end.isascii() and end.isdigit()))
    ):
        raise UsageError(
            f"--only is '{options.only}', expected a frame such as 57 or a part 0:150."
        )
    low, high = int(first), int(end) if colon else int(first) + 1
    if not low < high <= count:
        raise UsageError(f"--only is {options.only}; the film has the frames 0 to {count - 1}.")
    return list(range(low, high, options.every))


def begin(options: Options, plan: "FilmPlan", form: "FrameForm", folder: "FrameFolder") -> None:
    """Makes the folder of frames ready.  Raises UsageError."""
    from shapeshift.app.drawing import make_folder
    from shapeshift.app.film.draw_film import film_key, frame_facts
    from shapeshift.scene.document.appearance_rows import background_row
    from shapeshift.scene.film.film_path import write_film_file

    drawing = {
        "size": list(plan.size), "stereo": form.eye_distance, "supersample": form.supersample,
        "depth_unit": form.depth_unit, "background": background_row(background_of(options, plan)),
        "drawing": options.drawing, "context": options.context,
    }  # fmt: skip
    reading = {name: getattr(options, name) for name in DrawingOptions.__dataclass_fields__}
    key = film_key(plan, options.scene, drawing | {"reading": reading})
    rows = [frame_facts(plan, frame) for frame in range(len(plan.places))]
    facts = {"frames": len(rows), "fps": plan.clock.fps} | drawing | {"rows": rows}
    for path in filter(None, (options.poster, options.save_path)):
        make_folder(path.parent)
    folder.begin(key, facts, options.overwrite)
    if options.save_path is not None:
        from shapeshift.app.film.film_plan import film_of

        write_film_file(film_of(plan.document, plan), options.save_path)


def background_of(options: Options, plan: "FilmPlan") -> "Background":
    return options.background or plan.document.background


def draw_lacking(
    options: Options, plan: "FilmPlan", form: "FrameForm", folder: "FrameFolder",
    numbers: list[int],
) -> None:  # fmt: skip
    """The frames that are not there."""
    from shapeshift.app.drawing import open_renderer
    from shapeshift.app.film.draw_film import draw_frames
    from shapeshift.app.film.film_tasks import draw_by_cluster
    from shapeshift.app.progress import progress_bar

    lacking = folder.lacking(numbers)
    if not lacking:
        return
    if len(lacking) < len(numbers):
        say(f"{len(numbers) - len(lacking)} of {len(numbers)} frames are there already.")
    if options.cluster != NONE:
        draw_by_cluster(options, plan, folder, numbers)
        return
    with open_renderer(options.context, options.drawing) as (renderer, _):
        renderer.settings = replace(renderer.settings, background=background_of(options, plan))
        with progress_bar() as bar:
            task = bar.add_task(
                "drawing", total=len(numbers), completed=len(numbers) - len(lacking)
            )
            draw_frames(renderer, plan, lacking, folder, form, lambda number: bar.advance(task))


def finish(
    options: Options, plan: "FilmPlan", folder: "FrameFolder", numbers: list[int], codec: str
) -> None:
    """The video, the poster, and where they are."""
    from shapeshift.app.drawing import save_png
    from shapeshift.app.film.write_video import read_frame, write_video
    from shapeshift.app.progress import progress_bar
    from shapeshift.scene.film.film_path import exact_fps

    if options.poster is not None:
        middle = read_frame(folder.frame(numbers[len(numbers) // 2]))
        save_png(middle / 255, options.poster)
    count = f"{len(numbers)} frame{'s' * (len(numbers) > 1)}"
    if not is_video(options.out):
        say(f"{count} in {full(options.out)}")
        return
    frames = [folder.frame(number) for number in numbers]
    with progress_bar() as bar:
        task = bar.add_task("encoding", total=len(frames))
        fps = exact_fps(plan.clock.fps) / options.every
        write_video(options.out, frames, fps, codec, lambda number: bar.advance(task))
    if not options.keep_frames:
        folder.remove()
    size = options.out.stat().st_size
    say(f"{count}, {plan.clock.seconds:g} s, {size:,} bytes: {full(options.out)}")
