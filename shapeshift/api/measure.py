"""Scenes in numbers: likeness to each other and to photos, what changed between two visits, frame
times, what shortcuts save and cost, the cases where methods fail.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from shapeshift.api.arguments import Camera, Kind, PathText, Progress, Size, X
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import in_words_of_python, opened
from shapeshift.api.render import Context, Drawing, shared_renderer
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile

if TYPE_CHECKING:
    from shapeshift.app.change.find_change import SceneChange
    from shapeshift.app.charts.chart_measure import ChartRow
    from shapeshift.renderer.renderer import Renderer as FrameRenderer

Measured = dict[str, Any]
Masks = Literal["auto", "object", "valid", "ignore"]
Background = Literal["auto", "black", "white", "gray"]
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
    from shapeshift.app.commands.compared import SceneSide, split_stop
    from shapeshift.runtime_models.stop_weights import Control, control_text

    at = ""
    if not isinstance(scene, OpenedScene):
        path, at = split_stop(str(plain(scene)))
        scene = opened(path).at(at or None)
    stops: dict[Control, str] = {stop.x: stop.name for stop in scene.stops}
    if not at and scene.x is not None:
        at = stops[scene.x] if scene.x in stops else control_text(scene.x)
    name = scene.path.resolve().name if scene.path else "scene"
    return SceneSide(f"{name} @ {at}" if at else name, scene.subject)


def change(
    before: PathText | OpenedScene,
    after: PathText | OpenedScene,
    *,
    degrees: float | None = None,
    millimetres: float = 0.0,
    stop: str = "",
    values: str = "",
    value_range: tuple[float, float] | None = None,
    cameras: Camera | None = None,
    size: Size = (320, 240),
    out: PathText | None = None,
    overwrite: bool = False,
    drawing: Drawing = "auto",
    context: Context = "auto",
    progress: Progress | None = None,
) -> "SceneChange":
    """Where an earlier and a later scene of one place differ: `places`, the largest first, each
    with its kind (moved, appeared, vanished, hotter, colder, recoloured), centre and box in metres
    of `before`, area_m2, amount and unit; and `registration`, how their worlds fit together.

    degrees, millimetres: from where on values and shapes count; None is 5 of heat, of others a
    twentieth of their range; 0 mm is a thirty-second of the
    scene's radius.  stop: whose colours and shapes are compared; "": the first that shows no
    values.  values: the stop whose values are; "": the first thermal one, else the first of others.
    value_range: of such stops that do not say it.  cameras: views of `before`: only what is in
    their pictures is compared; None: each scene from where its photos were taken, else from all
    around.  out: a folder, as the command writes it.  Raises UsageError, BadFile where the scenes
    do not fit together.

        for place in ss.change("march.shift", "june.shift").places:
            print(place.kind, place.centre, place.amount, place.unit)
    """
    from shapeshift.api.views import choose_views
    from shapeshift.app.change.draw_visits import visit_of
    from shapeshift.app.change.find_change import ChangeChoice, find_change
    from shapeshift.app.change.outputs import check_folder, write_change

    choice = ChangeChoice(0.0, millimetres / 1000, degrees, size=size)
    choice.settings(1.0)  # refused before anything is read
    folder = None if out is None else plain(out)
    if folder is not None:
        check_folder(folder, overwrite)
    scenes = opened(before), opened(after)
    names = (scenes[0].path or plain("before")).name, (scenes[1].path or plain("after")).name
    visits = (
        visit_of(scenes[0].subject, names[0], stop, value_range, values),
        visit_of(scenes[1].subject, names[1], stop, value_range, values),
    )
    views = None if cameras is None else choose_views(scenes[0], cameras, 1, size)

    def work(frames: "FrameRenderer") -> "SceneChange":
        found = find_change(frames, visits, names, choice, views, progress or silent)
        if folder is not None:
            write_change(frames, found, names, folder, progress or silent)
        return found.change

    with shared_renderer(drawing, context, RenderSettings(), (0.0, 0.0, 0.0)) as renderer:
        return renderer.inspect(work)


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


def evaluate(
    scene: PathText | OpenedScene,
    capture: PathText,
    *,
    modality: str | None = None,
    downscale: int | None = None,
    masks: Masks = "auto",
    background: Background = "auto",
    vgg: PathText | None = None,
    device: Kind | None = None,
) -> dict[str, Any]:
    """PSNR in dB and SSIM of a scene on the held-out photos of a capture, by modality: the result
    of `shapeshift eval --json` (every 8th photo is held out, unless the capture says which).

    modality: only that one.  downscale: divide the photos' sides by this; None is what the scene
    was trained with, else such that neither exceeds 640 pixels.  masks: what a mask means; object:
    nothing is outside it; auto: as it was trained, else as the capture says.  vgg: an ONNX file of
    VGG16's first layers, for a distance of features.  Raises BadFile, UsageError, NoDevice.

        scores = ss.evaluate("scene.shift", "capture")
        scores["modalities"]["RGB"]["psnr_db"]
    """
    from shapeshift.app.training.evaluate import only, trained_downscale, trained_masks
    from shapeshift.rasterizer.device import open_device
    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.training.calibration.extrinsics import rig_of, with_extrinsics
    from shapeshift.training.evaluation.evaluate import evaluate_model, report
    from shapeshift.training.evaluation.vgg_distance import VggDistance

    started = time.perf_counter()
    scene = opened(scene)
    if scene.subject.file is not None:
        raise BadFile("photos are of one scene as it was trained; name the model of one object.")
    model = scene.model
    distance = None if vgg is None else VggDistance(plain(vgg))
    photos = read_capture(plain(capture))
    photos = photos if modality is None else only(photos, modality)
    photos = with_extrinsics(photos, rig_of(model.provenance))
    factor = downscale or trained_downscale(model.provenance)
    meant = trained_masks(model.provenance, masks)
    scores = evaluate_model(open_device(device), model, photos, factor, meant, background, distance)
    result = report(scene.path, scores, started)
    return result if distance is None else result | {"vgg_file": distance.name}


def stability(
    scene: PathText | OpenedScene,
    out: PathText,
    *,
    cases: Sequence[str] = (),
    size: Size = BENCH_SIZE,
    steps: int = 24,
    rounds: int = 50,
    drawing: Drawing = "auto",
    context: Context = "auto",
    overwrite: bool = False,
    progress: Callable[[str], object] | None = None,
) -> list[dict[str, str]]:
    """The cases where splat renderers fail, each held to its bound (docs/stability.md): a row a
    figure, with case, figure, measured, bound, verdict ("holds", "FAILS" or "") and reason.

    out: a folder that gets stability.csv and a picture a case; the same call goes on where it was
    stopped.  cases: of the command's names; () is all.  steps: frames between two stops.  rounds:
    of the case life.  progress: called with what is going on.  Raises UsageError, BadFile,
    NoContext, NoDevice.

        rows = ss.stability("scene.shift", "stability", cases=["sweep"])
        failed = [row["case"] for row in rows if row["verdict"] == "FAILS"]
    """
    from shapeshift.api.views import pixels_of
    from shapeshift.app.commands.stability import Options, choose_cases, measure
    from shapeshift.app.stability_cases.table import COLUMNS

    width, height = pixels_of(size)
    scene = opened(scene)
    options = Options(
        scene.path or Path("scene"), plain(out), tuple(cases), f"{width}x{height}", steps, rounds,
        drawing, context, overwrite,
    )  # fmt: skip
    hear = progress or silent
    with in_words_of_python():
        names = choose_cases(options)
        command = f"shapeshift.stability of {options.scene.name}"
        table = measure(options, scene.subject, names, command, hear, silent, silent)
    return [
        dict(zip(COLUMNS, map(str, row), strict=True)) for name in names for row in table.rows[name]
    ]
