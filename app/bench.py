"""launch.py bench: frame times and image error of a scene, without a window."""

import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro


@dataclass(frozen=True)
class Options:
    """Time frames on an orbit and an x sweep, and measure the image error beside them."""

    scene: Annotated[Path, tyro.conf.Positional]
    """A package, a .ply, a .splat or a folder of PLY layers."""
    json: Path | None = None
    """Write the result here; - writes it to standard output."""
    frames: int = 60
    """Frames of the orbit, mono and stereo each (after 3 that do not count)."""
    sweep: int = 50
    """Values of x in the sweep from 0 to 1."""
    size: str = "640x360"
    """WIDTHxHEIGHT in pixels."""
    x: float = -1.0
    """Control value of the orbit; below 0: the first stop."""
    quality_size: str = "256x144"
    """Size of the images that are compared with the float64 reference."""
    drawing: Literal["auto", "quads", "tiles"] = "auto"
    """Drawing back end: GL quads or OpenCL tiles."""
    context: Literal["auto", "egl", "surfaceless", "osmesa", "none"] = "auto"
    """Where GL comes from."""
    mode: Literal["cumulative", "exclusive"] = "cumulative"
    """How a folder of layers adds up."""


def run(options: Options) -> int:
    from app.errors import UsageError
    from app.headless_drawing import open_renderer, parse_size
    from app.measure import Measure
    from runtime_models.read_scene import read_model

    size, quality_size = parse_size(options.size), parse_size(options.quality_size)
    for name in ("frames", "sweep"):
        if getattr(options, name) < 2:
            raise UsageError(f"--{name} is {getattr(options, name)}, expected at least 2.")
    if not options.x <= 1:
        raise UsageError(f"--x is {options.x}, expected 0 to 1.")
    model = read_model(options.scene, options.mode)
    x = model.stops[0].x if options.x < 0 else options.x
    with open_renderer(options.context, options.drawing) as (renderer, ctx):
        measure = Measure(renderer, ctx, model, x, size)
        result = measure.all(options.frames, options.sweep, quality_size)
    result["command"] = command_line()
    result["scene"] = options.scene.name
    print_table(result)
    if options.json == Path("-"):
        print(json.dumps(result, indent=1))
    elif options.json is not None:
        write_json(options.json, result)
        print(f"written to {options.json}", file=sys.stderr)
    return 0


def command_line() -> str:
    """What was typed, with file names alone: rows are read on other machines."""
    words = [Path(w).name if os.sep in w else w for w in sys.argv[1:]]
    return " ".join(["python3 launch.py", *words])


def write_json(path: Path, result: dict) -> None:
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    os.replace(temporary, path)


def print_table(result: dict) -> None:
    from rich.console import Console
    from rich.table import Table

    backends = ", ".join(f"{what} {name}" for what, name in result["backends"].items())
    title = f"{result['scene']}, {result['size']}, {backends}, {result['gl_renderer']}"
    table = Table("ms", "p50", "p95", "p99", title=title)
    for name, row in {"frame": result["frame_ms"], **result["passes"]}.items():
        table.add_row(name, *(f"{row[p]:.2f}" for p in ("p50", "p95", "p99")))
    console = Console(stderr=True)
    console.print(table)
    console.print(
        f"PSNR to the float64 reference {result['psnr_db']:.1f} dB at {result['quality_size']} "
        f"(worst of {result['quality_images']}), {result['drawn']:,} of {result['splats']:,} "
        f"splats drawn, stereo/mono {result['stereo_over_mono']:.2f}, "
        f"worst frame of the x sweep {result['sweep_worst_ms']:.1f} ms, "
        f"frame/draw pass {result['frame_over_draw']:.2f}"
    )
