"""launch.py change: what moved, appeared or vanished, and whose values changed, from A to B."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from shapeshift.app.command_line import EXPERT, POSITIONAL, SIZE, Opt
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.runtime_models.program import program


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Compare two scenes of one place, an earlier and a later one, and list where it changed."""

    scene_a: Annotated[Path, POSITIONAL]
    """The earlier scene."""
    scene_b: Annotated[Path, POSITIONAL]
    """The later scene, of a second capture."""
    out: Path | None = None
    """A folder for the list, a picture a place, and layers that the viewer opens.  Default:
    nothing is written."""
    json: bool = False
    """Print one object instead of a table."""
    overwrite: bool = False
    """Replace what an earlier run wrote into --out."""
    degrees: float | None = None
    """From how much on values count as changed, in their unit.  Default: 5 of heat, of others a
    twentieth of their range."""
    millimetres: float = 0.0
    """From how many millimetres on a surface counts as moved; 0: a thirty-second of the scene's
    radius."""
    stop: str = ""
    """The stop whose colours and shapes are compared.  Default: the first that shows no values."""
    values: Annotated[str, Opt(metavar="STOP")] = ""
    """The stop whose values are compared.  Default: the first thermal one, else the first of other
    values."""
    range: tuple[float, float] | None = None
    """The values that black and white of the value stops stand for.  Default: what the scenes
    say."""
    camera: Annotated[str, Opt(metavar="CAMERA")] = ""
    """A file or folder of cameras in A's world (docs/cameras.md): only what is in their pictures
    is compared, and scenes that do not say where they were photographed are drawn from there.
    Default: each from where its photos were taken, else 26 views from all around and above."""
    size: Annotated[str, SIZE] = "320x240"
    """WIDTHxHEIGHT in pixels of what is drawn to be compared."""
    colour: Annotated[float, EXPERT] = 14.0
    """From which distance on (Lab, of lightness a third) a colour counts as changed."""
    cell: Annotated[float, EXPERT] = 0.0
    """Millimetres of the cubes in which views are joined; 0: a 64th of the scene's radius."""
    fov_y: Annotated[float, EXPERT] = 0.0
    """Degrees from top to bottom, for a camera file that says nothing about the lens; 0: not
    known."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""


def run(options: Options) -> int:
    from shapeshift.app.camera_files import named_cameras
    from shapeshift.app.change.draw_visits import visit_of
    from shapeshift.app.change.find_change import ChangeChoice, find_change, without_heat
    from shapeshift.app.change.outputs import (
        change_rows,
        check_folder,
        print_places,
        write_change,
    )
    from shapeshift.app.document import open_document
    from shapeshift.app.drawing import open_renderer, parse_size
    from shapeshift.app.opening import PATIENCE_S, progress_after
    from shapeshift.app.terminal import print_json

    size = parse_size(options.size)
    choice = ChangeChoice(
        options.cell / 1000, options.millimetres / 1000, options.degrees, options.colour, size
    )
    refuse_amounts(options)  # before anything is read
    if options.out is not None:
        check_folder(options.out, options.overwrite)
    names = options.scene_a.name, options.scene_b.name
    cameras = None
    if options.camera:
        cameras = named_cameras(options.camera, options.scene_a, options, size)
    documents = [open_document(path, options) for path in (options.scene_a, options.scene_b)]
    before, after = (
        visit_of(document, name, options.stop, options.range, options.values)
        for document, name in zip(documents, names, strict=True)
    )
    visits = before, after
    if said := without_heat(*visits, names):
        say(said)
    views = None if cameras is None else list(documents[0].sees(cameras).views)
    with (
        open_renderer(options.context, options.drawing) as (renderer, _),
        progress_after(PATIENCE_S) as progress,
    ):
        found = find_change(renderer, visits, names, choice, views, progress)
        if options.out is not None:
            write_change(renderer, found, names, options.out, progress)
    if options.json:
        print_json(change_rows(found.change, names, documents[0].origin))
    else:
        print_places(found.change, documents[0].origin)
    if options.out is not None:
        say(f"written to {full(options.out)}; look: {program()} {full(options.out / 'layers')}")
    return 0


def refuse_amounts(options: Options) -> None:
    """Raises UsageError for what is no amount."""
    from shapeshift.app.errors import UsageError

    for name, value in (("--cell", options.cell), ("--millimetres", options.millimetres)):
        if not 0 <= value < float("inf"):
            raise UsageError(f"{name} is {value:g}; 0 (by the scene) or more is wanted.")
    for name, most in (("--degrees", options.degrees), ("--colour", options.colour)):
        if most is not None and not 0 < most < float("inf"):
            raise UsageError(f"{name} is {most:g}; more than 0 is wanted.")
