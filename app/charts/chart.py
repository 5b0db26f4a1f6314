"""launch.py chart: what every named setting saves in time and costs in the picture."""

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL, SIZE
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import full
from shapeshift.app.terminal import open_console, say
from shapeshift.runtime_models.program import portable_program

if TYPE_CHECKING:
    from shapeshift.app.charts.chart_scene import ChartScene, Walk

MOST_FRAMES = 1000


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Price at least 24 settings: frame time and image error compared with the exact one.  Scenes
    in levels of detail (launch.py lod, streamed SOG) have rows of budgets of splats besides.

    Writes rows.csv, chart.svg and chart.png.  Rows that are there are kept: Ctrl-C loses nothing.
    """

    scenes: Annotated[tuple[Path, ...], POSITIONAL] = ()
    """Packages, splats of any known format, folders of layers or scene files; several stand side by
    side."""
    out: Path = Path("out/chart")
    """Folder for rows.csv and the chart."""
    cameras: Path | None = None
    """Views to measure from, any file that render's --camera takes.  Default: an arc about the
    scene, 0.75 degrees a frame."""
    size: Annotated[str, SIZE] = "1280x720"
    """WIDTHxHEIGHT in pixels."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""
    frames: int = 0
    """Views on the arc; 0: 32, with --quick 8."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands: a stop by its name, or a number from 0 to 1.  Default: the first
    stop of the first scene, and in a scene file what it says for each object."""
    quick: bool = False
    """About ten settings, fewer frames, no SSIM."""
    decode: Annotated[bool, EXPERT] = False
    """Measure something else, without a scene: decode time against the number of anchors, of all
    five networks and of the colours alone."""


def run(options: Options) -> int:
    from shapeshift.app.drawing import make_folder, parse_size
    from shapeshift.app.errors import UsageError

    size = parse_size(options.size)
    if options.decode:
        if options.scenes:
            raise UsageError("--decode takes no scene; leave it out, or leave --decode out.")
        from shapeshift.app.charts.decode_chart import run_decode

        make_folder(options.out)
        return run_decode(options.out, options.context, command_line(options))
    if not options.scenes:
        raise UsageError("name a scene to chart, or add --decode.")
    if not 0 <= options.frames <= MOST_FRAMES or options.frames == 1:
        raise UsageError(f"--frames is {options.frames}, expected 2 to {MOST_FRAMES}.")
    subjects = read_subjects(options)
    cameras = read_views(options, subjects[0], size)
    make_folder(options.out)
    return measure_and_draw(options, subjects, cameras, size)


def read_subjects(options: Options) -> list:
    """The scenes in order; one that is named twice is read once and shared."""
    from shapeshift.app.document import open_document

    known = {path: open_document(path, options) for path in dict.fromkeys(options.scenes)}
    return subjects_of(options, known)


def subjects_of(options: Options, known: dict) -> list:
    """What was opened, in the order of the command line, where --x has it."""
    if options.x:
        known = {path: subject.placed(options.x) for path, subject in known.items()}
    return [known[path] for path in options.scenes]


def leaf_scene(
    options: Options, subjects: list, x: float | None, size: tuple[int, int], walk: "Walk"
) -> "ChartScene | None":
    """The same with leaves to choose from; None where nothing has any, or --max-splats reads one
    level of them.
    """
    from shapeshift.app.charts.chart_scene import by_leaves, has_levels, make_chart_scene

    if options.max_splats or not any(map(has_levels, subjects)):
        return None
    known = dict(zip(options.scenes, subjects, strict=True))
    anew = {
        path: by_leaves(path, options) if has_levels(subject) else subject
        for path, subject in known.items()
    }
    found = subjects_of(options, anew)
    return make_chart_scene(found, x, size, walk, read_views(options, found[0], size))


def read_views(options: Options, subject, size: tuple[int, int]) -> list:
    from shapeshift.app.camera_files import named_cameras
    from shapeshift.app.errors import UsageError

    if options.cameras is None:
        return []
    if options.frames:
        raise UsageError("--cameras gives the number of frames; leave --frames out.")
    cameras = named_cameras(str(options.cameras), options.scenes[0], options, size)
    return list(subject.sees(cameras).views[:MOST_FRAMES])


def measure_and_draw(options: Options, subjects: list, cameras: list, size: tuple) -> int:
    from shapeshift.app.charts.budget_chart import ChartSubject, keep_chart
    from shapeshift.app.charts.chart_measure import ChartRow, Pricing, open_pair
    from shapeshift.app.charts.chart_picture import draw_chart
    from shapeshift.app.charts.chart_rows import RowsFile
    from shapeshift.app.charts.chart_scene import QUICK, Walk, budgets_of, digest, make_chart_scene
    from shapeshift.app.charts.chart_settings import settings_of
    from shapeshift.app.measure import draws_on_cpu, machine_line

    x = None
    if not (options.x or any(subject.file for subject in subjects)):
        x = subjects[0].x  # scenes side by side show one stop
    walk = QUICK if options.quick else Walk()
    walk = replace(walk, frames=options.frames or walk.frames)
    chart_scene = make_chart_scene(subjects, x, size, walk, cameras)
    contents = [s.scene if s.file else s.scene.objects[0].model for s in subjects]
    scene_words = scene_line(options, chart_scene, digest(contents, cameras))
    leaves = leaf_scene(options, subjects, x, size, walk)
    pictures = not options.quick
    with open_pair(options.context, options.drawing) as (renderers, ctx):
        pricing = Pricing(renderers, ctx, chart_scene, subjects[0].background)
        on_cpu = draws_on_cpu(pricing.drawing, ctx)
        head = (command_line(options), machine_line(ctx), f"{scene_words}; {pricing.drawing}")
        file = RowsFile(options.out / "rows.csv", ChartRow, head)
        measure_rows(pricing, file, settings_of(pricing.drawing, options.quick), pictures)
        if len(subjects) == 1 and not (options.quick or cameras):
            drawn = ChartSubject(subjects[0], x, size)
            keep_chart(pricing, renderers[0], ctx, drawn, file.rows)  # for --target-ms
        if leaves is not None:
            by_budget = Pricing(renderers, ctx, leaves, subjects[0].background)
            rows = budgets_of(leaves.scene, pricing.drawing, options.quick)
            measure_rows(by_budget, file, rows, pictures)
    title = f"{scene_words.split(';')[0]}, {options.size}, {pricing.drawing}"
    front = draw_chart(file.rows, title, options.out, on_cpu)
    print_front(front, len(file.rows), options.out)
    return 0


def measure_rows(pricing, file, settings, pictures: bool) -> None:
    """Adds the rows that the file lacks, one after the other, with progress on stderr."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import TimeRemainingColumn as Remaining

    from shapeshift.app.progress import progress_bar

    known = {row.name for row in file.rows}
    missing = [named for named in settings if named.name not in known]
    columns = (TextColumn("{task.description}", markup=False), BarColumn(),
               MofNCompleteColumn(), Remaining())  # fmt: skip
    with progress_bar(*columns) as progress:
        task = progress.add_task("", total=len(settings), completed=len(settings) - len(missing))
        for named in missing:
            progress.update(task, description=named.name)
            file.add(pricing.row(named, pictures))
            progress.advance(task)


def command_line(options: Options) -> str:
    """What makes these rows again, with file names alone: they are read on other machines."""
    words = [portable_program(), "chart", *(path.name for path in options.scenes)]
    plain = Options()
    for name in ("cameras", "size", "drawing", "context", "frames", "x", "mode"):
        value = getattr(options, name)
        if value != getattr(plain, name):
            word = value.name if isinstance(value, Path) else str(value)
            words.append(f"--{name} {shlex.quote(word)}")
    words += [f"--{name}" for name in ("quick", "decode") if getattr(options, name)]
    return " ".join([*words, "--out DIR"])


def scene_line(options: Options, chart_scene, contents: str) -> str:
    """What was drawn: names, splats, contents, and what near and far are there."""
    from collections import Counter

    from shapeshift.app.charts.chart_scene import WARM_UP

    names = Counter(path.name for path in options.scenes)
    words = [name if n == 1 else f"{n} x {name}" for name, n in names.items()]
    far = chart_scene.distances
    return (
        f"{' + '.join(words)} ({chart_scene.scene.splat_count:,} splats); contents {contents}; "
        f"{len(chart_scene.path) - WARM_UP} views; near {far.near:g} m, far {far.far:g} m"
    )


def print_front(front: list, count: int, out: Path) -> None:
    """The settings that nothing beats, on stderr."""
    from rich.table import Table

    table = Table("nothing is both faster and more alike", "ms", "x exact", "dB", "SSIM")
    for row in front:
        ssim = f"{row.ssim:.4f}" if row.ssim == row.ssim else "-"
        table.add_row(row.name, f"{row.ms:.2f}", f"{row.ratio:.3f}", f"{row.db:.1f}", ssim)
    open_console().print(table)
    say(f"{count} settings in {full(out / 'rows.csv')}; {full(out / 'chart.png')} shows them.")
