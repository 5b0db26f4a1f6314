"""launch.py stability: a scene, and the renderer with it, in the cases where methods fail."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import EXPERT, POSITIONAL, SIZE, Opt
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import full
from shapeshift.app.terminal import open_console, say

if TYPE_CHECKING:
    from shapeshift.app.document import Document
    from shapeshift.app.stability_cases.case_context import CaseContext
    from shapeshift.app.stability_cases.table import Table

FAILED = 1  # exit code: a case went past its bound


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Draw a scene in the cases where splat renderers fail, and hold every figure to its bound.

    Writes stability.csv (case, figure, measured, bound, verdict, and why the bound is where it is)
    and a picture of each case's worst frame beside what it is compared with. Run it again to go on
    where it was stopped: cases that held are kept, those that failed are measured anew.

    Exit code 0: every case holds; 1: one fails (its rows say FAILS); 2: bad input.
    docs/stability.md says what each case means.
    """

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers or a scene file (docs/scene.md)."""
    out: Path
    """Folder for stability.csv and the pictures."""
    cases: Annotated[tuple[str, ...], Opt(metavar="CASE")] = ()
    """Names of cases.  Default: all of sweep, stale-orbit, stale-yaw, popping, disparity, canted,
    stereo, far-origin, depth-range, inside, lenses, random-eyes, needles, faint-layers, limits,
    counts, crowd, extrapolated-x, broken-heads, life."""
    size: Annotated[str, SIZE] = "640x360"
    """WIDTHxHEIGHT in pixels."""
    steps: Annotated[int, EXPERT] = 24
    """Frames between two stops of the x sweep, and of the 90-degree turn."""
    rounds: Annotated[int, EXPERT] = 50
    """Contexts made and closed by the case life."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""
    overwrite: bool = False
    """Start anew where the folder holds the table of another scene, size or drawing."""


def run(options: Options) -> int:
    from shapeshift.app.document import open_document
    from shapeshift.app.drawing import parse_size
    from shapeshift.app.progress import working

    parse_size(options.size)  # refused before the scene is read
    names = choose_cases(options)
    scene = open_document(options.scene, options)
    console = open_console()
    with working("starting") as progress:
        table = measure(options, scene, names, command_line(), progress, console.print, say)
    print_table(table, names)
    failed = [name for name in names if table.failed(name)]
    verdict = f"FAILED: {', '.join(failed)}" if failed else "all hold"
    count = f"{len(names)} case{'s' * (len(names) > 1)}"
    say(f"{count}, {verdict}; {full(table.path)} and pictures beside it")
    return FAILED if failed else 0


def measure(
    options: Options, scene: "Document", names: list[str], command: str,
    progress: Callable[[str], object], hear: Callable[[str], object],
    report: Callable[[str], None],
) -> "Table":  # fmt: skip
    """The cases of a scene, in the table and pictures of --out.

    command: named in the table.  progress: hears what is under way, hear: how each case went,
    report: what else there is to be said.  Raises UsageError, BadFile, NoContext, NoDevice.
    """
    from shapeshift.app.drawing import make_folder, open_renderer, parse_size
    from shapeshift.app.stability_cases.case_context import CaseContext
    from shapeshift.app.stability_cases.table import open_table
    from shapeshift.scene.appearance import plain_color

    make_folder(options.out)

    def reopen():
        return open_renderer(options.context, options.drawing, report)

    with reopen() as (renderer, ctx):
        about = subject(options, renderer, scene)
        table = open_table(options.out, command, about, options.overwrite)
        case = CaseContext(
            renderer, ctx, scene, parse_size(options.size), reopen, plain_color(scene.background),
            options.steps, options.rounds,
        )  # fmt: skip
        perform(case, names, table, progress, hear)
    return table


def choose_cases(options: Options) -> list[str]:
    """The cases asked for, in the table's order; refuses numbers and names that cannot be."""
    from shapeshift.app.errors import UsageError
    from shapeshift.app.stability_cases.table import CASES

    for name, least, most in (("steps", 6, 1000), ("rounds", 2, 1000)):
        if not least <= getattr(options, name) <= most:
            given = getattr(options, name)
            raise UsageError(f"--{name} is {given}, expected {least} to {most}.")
    for name in options.cases:
        if name not in CASES:
            raise UsageError(f"--cases: there is no case '{name}'; choose of {', '.join(CASES)}.")
    return [name for name in CASES if not options.cases or name in options.cases]


def subject(options: Options, renderer, scene) -> str:
    """What the rows are about: rows of another scene, size or drawing do not belong with them."""
    from shapeshift.app.measure import processor

    backends = ", ".join(renderer.backends.values())
    return (
        f"{options.scene.name}, {scene.scene.splat_count} splats, {options.mode or 'cumulative'}, "
        f"{options.size}, {options.steps} steps, {options.rounds} rounds, {backends}, {processor()}"
    )


def command_line() -> str:
    from shapeshift.app.commands.bench import command_line as typed

    return typed()


def perform(
    case: "CaseContext", names: list[str], table: "Table", progress: Callable[[str], object],
    hear: Callable[[str], object],
) -> None:  # fmt: skip
    """Runs what is not in the table yet; each case is on disk before the next one starts."""
    from shapeshift.app.stability_cases.table import CASES, save_panels

    for i, name in enumerate(names):
        if name in table.rows:
            continue
        progress(f"{name} ({i + 1} of {len(names)})")
        result = CASES[name](case)
        save_panels(result.panels, table.folder / f"{name}.png")
        table.add(name, result.findings)
        failed = sum(f.verdict == "FAILS" for f in result.findings)
        hear(f"{name}: {f'{failed} past their bounds' if failed else 'holds'}")


def print_table(table, names: list[str]) -> None:
    from rich.table import Table
    from rich.text import Text

    shown = Table("case", "figure", "measured", "bound", "verdict")
    for name in names:
        for i, (case, figure, measured, bound, verdict, _) in enumerate(table.rows[name]):
            style = "bold red" if verdict == "FAILS" else ""
            cells = (case if i == 0 else "", figure, measured, bound, verdict)
            shown.add_row(*(Text(cell, style) for cell in cells))  # figures may hold brackets
        shown.add_section()
    open_console().print(shown)
