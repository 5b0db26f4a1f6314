"""Scenes in numbers: likeness to each other, frame times, what each shortcut saves and costs."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapeshift.api.arguments import Camera, PathText, Progress, Size, X
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import opened
from shapeshift.api.render import Context, Drawing
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.renderer.settings import RenderSettings

if TYPE_CHECKING:
    from shapeshift.app.charts.chart_measure import ChartRow

Measured = dict[str, Any]
VIEWS = 8  # of the orbit on which two scenes are compared
BENCH_SIZE, QUALITY_SIZE, CHART_SIZE = (640, 360), (256, 144), (1280, 720)


def silent(*progress: object) -> None:
    """Nobody listens."""


def compare(
    a: PathText | OpenedScene,
    b: PathText | OpenedScene,
    *,
    cameras: Camera | None = None,
    size: Size | None = None,
    background: tuple[float, float, float] | None = None,
    out: PathText | None = None,
    overwrite: bool = False,
    drawing: Drawing = "auto",
    context: Context = "auto",
) -> Measured:
    """How alike two scenes look: {"a", "b", "views": [{"view", "psnr_db", "ssim", "largest"}],
    "mean"}; PSNR in dB or "equal", the largest difference of display sRGB 0..1.

    A scene is compared as it stands (`scene.at("Thermal")`), or a path with @stop.  cameras: views
    as of `Scene.views`; None is 8 views on an orbit about A.  out: a folder for a sheet (A, B and
    their difference) a view.  docs/compare.md says how likeness is measured (SSIM: Wang et al.
    2004).  Raises UsageError, BadFile.

        ss.compare("scene.shift@RGB", "scan.ply")["mean"]["psnr_db"]
        ss.compare(scene.at("RGB"), scene.at("Thermal"), out="diff")
    """
    from shapeshift.api.views import choose_views
    from shapeshift.app.commands.compare import Options, drawn_views, score

    first, second = side_of(a), side_of(b)
    scene = OpenedScene(first.subject)
    if cameras is None:
        views = choose_views(scene, "orbit", VIEWS, size)
    else:
        views = choose_views(a if isinstance(a, OpenedScene) else scene, cameras, 1, size)
    options = Options(
        first.name, second.name, out=None if out is None else plain(out),
        background=background, overwrite=overwrite, drawing=drawing, context=context,
    )  # fmt: skip
    pairs = drawn_views(options, views, first, second)
    return score(pairs, (first.name, second.name), options, silent)


def side_of(scene: PathText | OpenedScene):
    """A scene as it stands, or what a path, or a path with @stop or @x, stands for."""
    from shapeshift.app.commands.compare_sides import SceneSide, split_stop
    from shapeshift.runtime_models.stop_weights import control_text

    at = ""
    if not isinstance(scene, OpenedScene):
        path, at = split_stop(str(plain(scene)))
        scene = opened(path).at(at or None)
    stops = {stop.x: stop.name for stop in scene.stops}
    if not at and scene.x is not None:
        at = stops[scene.x] if scene.x in stops else control_text(scene.x)
    name = scene.path.resolve().name if scene.path else "scene"
    return SceneSide(f"{name} @ {at}" if at else name, scene.subject)


def bench(
    scene: PathText | OpenedScene,
    *,
    frames: int = 60,
    sweep: int = 200,
    size: Size = BENCH_SIZE,
    x: X | None = None,
    quality_size: Size = QUALITY_SIZE,
    settings: RenderSettings | None = None,
    drawing: Drawing = "auto",
    context: Context = "auto",
    progress: Callable[[str], None] | None = None,
) -> Measured:
    """Frame times of an orbit, mono and stereo in turns, and of a sweep of x, in milliseconds, with
    the PSNR in dB to the float64 reference: the rows of `shapeshift bench --json`.

    frames, sweep: 2 or more; 3 more do not count.  size, quality_size: width, height in pixels, of
    what is timed and of what is compared.  settings: None is exact.  progress: called with what is
    going on.  Raises UsageError, BadFile, NoContext, NoDevice.

        row = ss.bench("workshop.shift", frames=20, sweep=20)
        print(row["frame_ms"]["p50"], row["psnr_db"])
    """
    from shapeshift.app.commands.bench import check_counts_of
    from shapeshift.app.drawing import open_renderer
    from shapeshift.app.measure import Measure

    check_counts_of(frames=frames, sweep=sweep)
    scene = opened(scene).at(x)
    with open_renderer(context, drawing, silent) as (renderer, ctx):
        if settings is not None:
            renderer.settings = settings
        work = Measure(renderer, ctx, scene.subject, None, size)
        result = work.all(frames, sweep, quality_size, progress or silent)
    return result | {"scene": scene.path.name if scene.path else "scene"}


def chart(
    scene: PathText | OpenedScene,
    out: PathText | None = None,
    *,
    quick: bool = True,
    frames: int = 0,
    size: Size = CHART_SIZE,
    x: X | None = None,
    only: Sequence[str] = (),
    drawing: Drawing = "auto",
    context: Context = "auto",
    progress: Progress | None = None,
) -> "list[ChartRow]":
    """What each named setting saves in time and costs in the picture: a ChartRow a setting (ms,
    exact_ms, ratio, psnr_db, sweep_psnr_db, ssim, drawn ...), the exact one among them.

    out: a folder that gets chart.svg and chart.png.  quick: about ten settings, no SSIM.  frames:
    views on an arc about the scene; 0 is 32, quick 8.  only: settings by their names.  progress:
    called with (setting, part 0..1).  Raises UsageError, BadFile.

        rows = ss.chart("workshop.shift", size=(320, 180))
        fastest = min(rows, key=lambda row: row.ms)
    """
    from shapeshift.app.charts.chart_measure import Pricing, open_pair
    from shapeshift.app.charts.chart_scene import QUICK, Walk, make_chart_scene
    from shapeshift.app.charts.chart_settings import settings_of
    from shapeshift.app.measure import draws_on_cpu

    if frames < 0 or frames == 1:
        raise UsageError(f"frames is {frames}, expected 2 or more, or 0.")
    scene = opened(scene).at(x)
    walk = QUICK if quick else Walk()
    chart_scene = make_chart_scene(
        [scene.subject], None, size, replace(walk, frames=frames or walk.frames)
    )
    with open_pair(context, drawing) as (renderers, ctx):
        pricing = Pricing(renderers, ctx, chart_scene, scene.subject.background)
        named = settings_of(pricing.drawing, quick)
        known = {each.name: each for each in named}
        if unknown := [name for name in only if name not in known]:
            raise UsageError(f"there is no setting '{unknown[0]}'; there are {', '.join(known)}.")
        named = tuple(known[name] for name in only) or named
        rows = []
        for number, each in enumerate(named):
            (progress or silent)(each.name, number / len(named))
            rows.append(pricing.row(each, not quick))
        on_cpu = draws_on_cpu(pricing.drawing, ctx)
    if out is not None:
        draw(rows, scene, size, pricing.drawing, plain(out), on_cpu)
    return rows


def draw(
    rows: "list[ChartRow]", scene: OpenedScene, size: Size, drawing: str, out: Path, on_cpu: bool
) -> None:
    """chart.svg and chart.png of the rows."""
    from shapeshift.app.charts.chart_picture import draw_chart
    from shapeshift.app.drawing import make_folder

    make_folder(out)
    name = scene.path.name if scene.path else "scene"
    title = f"{name} ({scene.splat_count:,} splats), {size[0]}x{size[1]}, {drawing}"
    draw_chart(rows, title, out, on_cpu)
