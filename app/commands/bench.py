"""launch.py bench: frame times and image error of a scene, without a window."""

import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL, SIZE, Opt
from shapeshift.app.opening import DrawingOptions
from shapeshift.app.terminal import open_console, print_json
from shapeshift.runtime_models.program import portable_program

if TYPE_CHECKING:
    from shapeshift.app.document import Document
    from shapeshift.renderer.renderer import Renderer
    from shapeshift.renderer.settings import RenderSettings

LARGEST_RESULT = 1_000_000  # bytes


@dataclass(frozen=True)
class Options(DrawingOptions):
    """Time frames on an orbit and an x sweep, and measure the image error with them."""

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers or a scene file (docs/scene.md)."""
    json: bool = False
    """Print the result as JSON on standard output."""
    frames: int = 60
    """Frames of the orbit, mono and stereo each, after 3 that do not count."""
    sweep: int = 200
    """Values of x in the sweep from 0 to 1, after 3 that do not count."""
    size: Annotated[str, SIZE] = "640x360"
    """WIDTHxHEIGHT in pixels."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands on the orbit: a stop by its name, or a number from 0 to 1.  Default:
    the first stop, and in a scene file what it says for each object."""
    quality_size: Annotated[str, Opt(expert=True, metavar="SIZE")] = "256x144"
    """WIDTHxHEIGHT of the images that are compared with the float64 reference."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""
    settings: Annotated[str, EXPERT] = ""
    """A setting by its name in the chart, such as "sort every 4"; a wrong name lists them all.
    Default: the exact picture."""
    target: Annotated[Literal["", "auto", "rgba8", "rgba16", "rgba16f", "rgba32f"], EXPERT] = ""
    """Pixel format that quads blend into.  Default: auto (rgba16 where the scene's colours fit,
    else rgba16f), or what --settings says."""
    target_ms: Annotated[float | None, EXPERT] = None
    """Milliseconds that a frame may take: the setting is chosen by a chart of this scene on this
    machine, which is measured once, in seconds, and kept.  Default: no limit, the exact picture."""
    floor_db: Annotated[float | None, EXPERT] = None
    """PSNR in dB against the exact picture below which --target-ms never goes.  Default: 35."""


def run(options: Options) -> int:
    from shapeshift.app.charts.budget import read_budget
    from shapeshift.app.document import open_document
    from shapeshift.app.drawing import open_renderer, parse_size
    from shapeshift.app.errors import UsageError
    from shapeshift.app.measure import Measure

    size, budget = parse_size(options.size), read_budget(options.target_ms, options.floor_db)
    quality_size = parse_size(options.quality_size, "--quality-size")
    check_counts(options)
    if budget and (options.settings or options.target):
        raise UsageError("--target-ms chooses the setting; leave --settings and --target out.")
    subject = open_document(options.scene, options)
    if options.x:
        subject = subject.placed(options.x)
    with open_renderer(options.context, options.drawing) as (renderer, ctx):
        if budget:
            from shapeshift.app.charts.budget_chart import ChartSubject, settings_for

            renderer.settings = settings_for(
                budget, renderer, ctx, ChartSubject(subject, None, size)
            )
        elif options.settings or options.target:
            renderer.settings = asked_settings(options, renderer, subject, size)
        work = Measure(renderer, ctx, subject, None, size)
        result = measure(work, options, quality_size)
    print_table(result)
    if options.json:
        print_json(result)
    return 0


def asked_settings(
    options: Options, renderer: "Renderer", subject: "Document", size: tuple[int, int]
) -> "RenderSettings":
    """RenderSettings of --settings and --target; UsageError where there is none such."""
    from dataclasses import replace

    from shapeshift.app.charts.chart_scene import distances_of
    from shapeshift.app.charts.chart_settings import named_settings, render_settings
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.cameras.framing import orbit_path

    drawing = renderer.backends["drawing"].split()[0]
    settings = renderer.settings
    if options.settings:
        named = named_settings(options.settings, drawing)
        centre, radius = subject.bounds()
        distances = distances_of(subject.points(), orbit_path(8, centre, radius, size))
        settings = render_settings(named, settings.background, drawing, distances)
    if options.target and drawing != "quads":
        raise UsageError(f"--target is what quads blend into, and {drawing} are drawn here.")
    return replace(settings, target=options.target) if options.target else settings


def measure(work, options, quality_size: tuple[int, int]) -> dict:
    """All rows of a Measure, with what was asked; says on stderr what it is at."""
    from shapeshift.app.progress import working

    with working("starting") as progress:
        result = work.all(options.frames, options.sweep, quality_size, progress)
    return result | {"command": command_line(), "scene": options.scene.name}


def command_line() -> str:
    """What was typed, with file names alone: rows are read on other machines."""
    words = [Path(w).name if os.sep in w else w for w in sys.argv[1:]]
    return " ".join([portable_program(), *words])


def check_counts(options) -> None:
    """--frames and --sweep, as `check_counts_of` wants them."""
    check_counts_of("--", frames=options.frames, sweep=options.sweep)


def check_counts_of(said: str = "", **counts: int) -> None:
    """Two or more of each, since one frame has no percentiles.  Raises UsageError."""
    from shapeshift.app.drawing import MOST_VALUES
    from shapeshift.app.errors import UsageError

    for name, count in counts.items():
        if not 2 <= count <= MOST_VALUES:
            raise UsageError(f"{said}{name} is {count}, expected 2 to {MOST_VALUES}.")


def check_result_path(path: Path) -> None:
    """Refuses, before minutes of work, a file that cannot be written or that is not a result."""
    from shapeshift.app.errors import UsageError

    if path.is_dir():
        raise UsageError(f"{path} is a folder; name the JSON file that the result goes to.")
    if not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
        raise UsageError(f"cannot write into the folder {path.parent}; choose another file.")
    if path.exists() and not is_result(path):
        raise UsageError(f"{path} exists and is no bench result; choose another file.")


def is_result(path: Path) -> bool:
    from shapeshift.runtime_models.files.json_fields import saved_object

    return "frame_ms" in saved_object(path, LARGEST_RESULT)


def write_json(path: Path, result: dict) -> None:
    from shapeshift.runtime_models.files.whole_file import write_whole

    write_whole(path, (json.dumps(result, indent=1, allow_nan=False) + "\n").encode())


def print_table(result: dict) -> None:
    from rich.table import Table

    backends = ", ".join(f"{what} {name}" for what, name in result["backends"].items())
    rows = {
        "frame": result["frame_ms"],
        "stereo": result["stereo_ms"],
        "x sweep": result["sweep_ms"],
    }
    if touch := result.get("touch"):
        rows |= {"in motion": touch["frame_ms"], "its physics": touch["physics_ms"]}
    last = list(rows)[-1]
    rows |= result["passes"]
    table = Table("ms", "p50", "p95", "p99")
    for name, row in rows.items():
        table.add_row(name, *(f"{row[p]:.2f}" for p in ("p50", "p95", "p99")))
        if name == last:
            table.add_section()
    db = result["psnr_db"]
    quality = "NaN in a picture" if db is None else f"{db:.1f} dB"
    caption = (
        f"PSNR to {result['psnr_against']} {quality} at {result['quality_size']} "
        f"(worst of {result['quality_images']}), {result['drawn']:,} of {result['splats']:,} "
        f"splats drawn{by_budget(result)}, stereo/mono {result['stereo_over_mono']:.2f}, "
        f"worst frame of the x sweep {result['sweep_worst_ms']:.1f} ms{frame_over_draw(result)}; "
        f"{result['frames']} frames after {result['warm_up']} that do not count"
    )
    console = open_console()
    title = f"{result['scene']}, {result['size']}, {backends}, {result['gl_renderer']}"
    console.print(title, markup=False)  # a scene's name may hold brackets
    console.print(table)
    console.print(caption, markup=False)


def by_budget(result: dict) -> str:
    """How many splats the budget put into the arena, in words; nothing without one."""
    if result["budget"] is None:
        return ""
    return f" (budget {result['budget']:,}, {result['in_pages']:,} at hand)"


def frame_over_draw(result: dict) -> str:
    if result["draw_pass_ratio"] is None:
        return ""
    return (
        f", frame/draw pass ({' + '.join(result['draw_passes'])}) {result['draw_pass_ratio']:.2f}"
    )
