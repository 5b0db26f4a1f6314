"""launch.py render: a scene into PNG files, without a window."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import (
    CONTROL,
    EXPERT,
    POSITIONAL,
    REGIONS,
    SECTIONS,
    SIZE,
    Debug,
    Opt,
)
from shapeshift.app.opening import DrawingOptions, open_model
from shapeshift.app.paths import full
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.app.document import Document
    from shapeshift.scene.pose import View

MOST_DETAIL = 10.0
AROUND = ("orbit", "front")  # cameras that take their place from the scene
LIMITS = ("max_pixels", "max_distance", "min_pixels", "fade")


@dataclass(frozen=True)
class Options(DrawingOptions):
    """Draw a scene into PNG files."""

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers or a scene file (docs/scene.md)."""
    out: Path
    """Folder for the pictures."""
    x: Annotated[tuple[str, ...], CONTROL] = ()
    """Where the slider stands, one or several: a stop by its name, a number from 0 to 1, or sweep:N
    for N pictures from 0 to 1.  Default: 0, and in a scene file what it says for each object."""
    camera: Annotated[str, Opt(metavar="CAMERA")] = "orbit"
    """orbit, front, auto (cameras that lie with the scene), or a file or folder of cameras: ours,
    cameras.json, transforms.json, camera_path.json, _vr.json, COLMAP (docs/cameras.md)."""
    frames: int = 1
    """Pictures on the orbit, at each x; a camera file gives its own number."""
    size: Annotated[str, SIZE] = ""
    """WIDTHxHEIGHT in pixels.  Default: 640x360, or what the camera file says."""
    stereo: float = 0.0
    """Distance of two eyes in metres; above 0 each picture holds both eyes, side by side."""
    stereo_colors: Annotated[Literal["auto", "each", "shared"], EXPERT] = "auto"
    """Of two eyes: each its own, shared for the middle between them, or shared where nobody can
    tell."""
    background: tuple[float, float, float] | None = None
    """Red, green and blue behind everything, 0 to 1 as displayed.  Default: what the scene was
    trained on, else black."""
    sky: Annotated[tuple[str, str, str] | None, Opt(metavar="COLOR")] = None
    """Instead of one colour those at the zenith, the horizon and the ground, each as RRGGBB.
    Default: the scene file's sky, if it has one."""
    shape_of: Annotated[str, CONTROL] = ""
    """Heat over shape: the edges and the small changes of brightness of the picture at this x are
    laid under the picture at --x, as inspection cameras do.  Default: none."""
    detail: float = 1.0
    """How much of them, 0 to 10."""
    exposure: float = 0.0
    """Stops of light by which the whole scene is brighter; measured heat keeps its colours."""
    gamma: float = 1.0
    """Above 1 dark tones are brighter, below 1 darker."""
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Red, green and blue by which all colours are multiplied."""
    opacity: float = 1.0
    """By which the opacity of every splat is multiplied, 0 to 1."""
    foveation: Literal["off", "low", "medium", "high"] = "off"
    """Draw all pixels only within 35 (low), 25 or 15 degrees of straight on, and a quarter of them
    beyond, as `vr --foveation` does: to see and measure it without a headset."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""
    debug: Annotated[Debug, EXPERT] = ""
    """Draw with a legend, instead of the picture, which splats are left out and why, the same from
    above, how many splats lie over each pixel, how far away they are, which object they belong to,
    or splats as ellipses, points or rings.  Default: the picture."""
    output: Literal["picture", "depth", "normal", "coverage"] = "picture"
    """What to write instead of colours: depth in metres along the view, surface normals, or how
    much of each pixel is covered; each as a .npy and a 16-bit .png, with a legend.json."""
    select: Annotated[tuple[str, ...], REGIONS] = ()
    """Regions with an X of their own (a stop's name or a number) and a soft border in metres:
    sphere:x,y,z:radius:X[:border] box:x,y,z:hx,hy,hz:X[:border] half:x,y,z:nx,ny,nz:X[:border]
    lens:degrees:X[:border].  A later one lies over an earlier one.  Default: none."""
    section: Annotated[tuple[str, ...], SECTIONS] = ()
    """Planes and boxes in the world that cut all objects: plane:nx,ny,nz,d keeps the places p with
    n.p <= d, box:x,y,z:hx,hy,hz its inside; then :capped, :hard or :soft:WIDTH for the edge, and
    :beyond=X to show another stop there (docs/scene.md).  Default: none."""
    show: Annotated[str, Opt(metavar="VIEW")] = "full"
    """Of a scene with objects: full, overlay (each object tinted), background (without objects),
    isolated (objects alone) or isolated:NAME (one of them)."""
    fov_y: Annotated[float, EXPERT] = 0.0
    """Degrees from top to bottom, for a camera file that says nothing about the lens; 0: not
    known."""
    depth_unit: Annotated[float | None, EXPERT] = None
    """Metres a step of the .png of --output depth.  Default: the finest power of ten that reaches
    the far side."""
    max_pixels: Annotated[float, EXPERT] = inf
    """Leave out larger splats: one sigma of the longer axis, in pixels.  Default: no limit."""
    max_distance: Annotated[float, EXPERT] = inf
    """Leave out splats farther away, in metres.  Default: no limit."""
    min_pixels: Annotated[float, EXPERT] = 0.0
    """Leave out smaller splats: from the centre to where they end, in pixels."""
    fade: Annotated[float, EXPERT] = 0.0
    """Share of each of these limits over which splats fade, 0 to 1; 0: they end abruptly."""
    target_ms: Annotated[float | None, EXPERT] = None
    """Milliseconds that a frame may take: the setting is chosen by a chart of this scene on this
    machine, which is measured once, in seconds, and kept.  Default: no limit, the exact picture."""
    floor_db: Annotated[float | None, EXPERT] = None
    """PSNR in dB against the exact picture below which --target-ms never goes.  Default: 35."""
    draft: bool = False
    """With --budget: draw the coarsest levels alone, which are there at once."""
    overwrite: bool = False
    """Replace pictures of the same name."""


def run(options: Options) -> int:
    from shapeshift.app.charts.budget import read_budget
    from shapeshift.app.charts.budget_chart import ChartSubject, settings_for
    from shapeshift.app.commands.outputs import draw_outputs
    from shapeshift.app.decomposition.show_views import show_objects
    from shapeshift.app.drawing import (
        MOST_VALUES,
        appearing,
        make_folder,
        open_renderer,
        parse_size,
        read_cuts,
        read_look,
        sectioned,
        split_controls,
    )
    from shapeshift.app.errors import UsageError

    controls: Sequence[float | str | None] = split_controls(options.x) or [None]
    size = parse_size(options.size) if options.size else None
    if not 1 <= options.frames <= MOST_VALUES:
        raise UsageError(f"--frames is {options.frames}, expected 1 to {MOST_VALUES}.")
    appearance, backdrop = read_look(options)
    if not 0 <= options.stereo < 1:
        raise UsageError(f"--stereo is {options.stereo}, expected metres from 0 to 1.")
    settings, budget = choose_settings(options), read_budget(options.target_ms, options.floor_db)
    check_one_of(options, budget)
    check_output(options)
    check_show(options)
    # What needs no scene comes before it: large ones take a while to open.
    cameras = choose_cameras(options, size)
    count = len(cameras.views) if cameras else None
    choose_paths(options, [label_of(control) for control in controls], count)
    document, views, selectors = open_views(options, cameras, size)
    cuts = read_cuts(options.section, document.models)
    subjects = [document_at(document, each) for each in controls]
    labels = [label_of(each, s.x) for each, s in zip(controls, subjects, strict=True)]
    rows, paths = choose_paths(options, labels, count)
    shown = [
        appearing(show_objects(subject.scene, options.show), appearance) for subject in subjects
    ]
    with open_renderer(options.context, options.drawing) as (renderer, ctx):
        make_folder(options.out)
        renderer.streaming.reads = not options.draft
        renderer.settings = replace(
            settings, target=renderer.settings.target, background=backdrop or document.background
        )
        if budget:
            drawn = ChartSubject(subjects[0], None, views[0].size, 1 + (options.stereo > 0))
            renderer.settings = settings_for(budget, renderer, ctx, drawn)
            both = (options.stereo_colors, options.foveation)
            renderer.settings = with_words(renderer.settings, *both)
        scenes = [sectioned(with_selectors(shown[c], selectors[i]), cuts) for c, i in rows]
        work = (renderer, scenes, [views[i] for _, i in rows], paths, options.stereo)
        if options.output == "picture":
            draw_all(*work, *shapes_of(options, document, cuts, rows, selectors))
        else:
            draw_outputs(*work, options.output, unit_of(options, document, views))
    say(f"{len(paths)} picture{'s' * (len(paths) > 1)} in {full(options.out)}")
    return 0


def open_views(options: Options, cameras, size: tuple[int, int] | None) -> tuple:
    """The Document, the views of it, and for each view the selectors of --select."""
    from shapeshift.app.document import Document, open_document
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.document.scene_file import is_scene_file

    if not is_scene_file(options.scene):
        model = open_model(options.scene, options)
        document = Document.of(model, 0.0)
        views = document.sees(cameras).views if cameras else own_views(options, document, size)
        return document, views, [choose_selectors(options.select, model, view) for view in views]
    if options.select:
        raise UsageError("--select is for one model; a scene file has selectors for each object.")
    document = open_document(options.scene, options)
    views = cameras.views if cameras else own_views(options, document, size)
    return document, views, [()] * len(views)


def with_selectors(scene, selectors: tuple):
    """The scene of one object with these parts; without any, as it is."""
    if not selectors:
        return scene
    (obj,) = scene.objects
    return replace(scene, objects=(replace(obj, selectors=selectors),))


def document_at(document, control: float | str | None, said: str = "--x"):
    """The Document at a value of --x; None: as it is.  Raises UsageError, about the option said."""
    if isinstance(control, str):
        return document.placed(control, said)
    return replace(document, scene=document.at(control))


def label_of(control: float | str | None, x=None) -> str:
    """A control in the name of a picture; x: the Control of all objects, where that is known."""
    from shapeshift.app.paths import file_name

    if isinstance(x, float | int):
        return f"x{x:.3f}"
    if not isinstance(control, str):
        return f"x{control or 0:.3f}"
    try:
        return f"x{float(control):.3f}"
    except ValueError:
        return file_name(control)


def check_one_of(options: Options, budget) -> None:
    """A budget chooses the limits; who gives them has chosen already."""
    from shapeshift.app.errors import UsageError

    given = [name for name in LIMITS if getattr(options, name) != getattr(Options, name)]
    if budget and given:
        option = f"--{given[0].replace('_', '-')}"
        raise UsageError(f"--target-ms chooses what {option} says; leave one of the two out.")


def check_output(options: Options) -> None:
    """Numbers have neither a legend drawn over them nor a budget."""
    from shapeshift.app.errors import UsageError

    if not 0 <= options.detail <= MOST_DETAIL:
        raise UsageError(f"--detail is {options.detail}, expected 0 to {MOST_DETAIL:g}.")
    if options.shape_of and (options.debug or options.output != "picture"):
        raise UsageError("--shape-of goes without --debug and --output; leave one of them out.")
    for name in ("debug", "target_ms"):
        if options.output != "picture" and getattr(options, name) != getattr(Options, name):
            option = f"--{name.replace('_', '-')}"
            raise UsageError(f"--output {options.output} goes without {option}; leave one out.")
    if options.depth_unit is not None and not 1e-9 <= options.depth_unit <= 1e6:
        raise UsageError(f"--depth-unit is {options.depth_unit}, expected metres above 0.")


def check_show(options: Options) -> None:
    """Before the scene is read.  Raises UsageError."""
    from shapeshift.app.decomposition.show_views import read_show
    from shapeshift.app.errors import UsageError

    if options.draft and not options.budget:
        raise UsageError("--draft is of scenes in levels of detail; add --budget, such as 2M.")
    show, _ = read_show(options.show)
    if options.select and show in ("background", "isolated"):
        raise UsageError(f"--show {show} goes without --select; leave one of the two out.")


def unit_of(options: Options, document: "Document", views: list) -> float:
    """Metres a step of a depth picture."""
    from shapeshift.app.commands.outputs import choose_unit

    return options.depth_unit or choose_unit(*document.bounds(), views)


def choose_settings(options: Options):
    """The RenderSettings of the options; UsageError names what is out of range."""
    from shapeshift.app.errors import as_typed
    from shapeshift.renderer.settings import RenderSettings

    try:
        names = ("debug", "stereo_colors", "foveation", *LIMITS)
        return RenderSettings(**{name: getattr(options, name) for name in names})
    except ValueError as error:
        raise as_typed(error, RenderSettings) from None


def with_words(settings, stereo_colors: str, foveation: str):
    """What a budget chose, with what was said besides."""
    if stereo_colors != "auto":
        settings = replace(settings, stereo_colors=stereo_colors)
    return replace(settings, foveation=foveation)


def choose_cameras(options: Options, size: tuple[int, int] | None):
    """What --camera names, in its own world; None: views around the scene.  `size` None leaves the
    pixels to the file."""
    from shapeshift.app.camera_files import named_cameras, refuse_fov

    refuse_fov(options.fov_y)
    if options.camera in AROUND:
        return None
    cameras = named_cameras(options.camera, options.scene, options, size)
    for note in cameras.notes:
        say(note)
    return cameras


def choose_paths(
    options: Options, labels: list[str], views: int | None
) -> tuple[list[tuple[int, int]], list[Path]]:
    """(number of the control, of the view) of every picture, and its file.

    Raises UsageError where one is there.
    """
    from shapeshift.app.commands.outputs import LEGEND
    from shapeshift.app.drawing import MOST_VALUES
    from shapeshift.app.errors import UsageError

    views = views or (options.frames if options.camera == "orbit" else 1)
    count = len(labels) * views
    if count > MOST_VALUES:
        raise UsageError(f"--x and --frames ask for {count} pictures, over {MOST_VALUES}.")
    rows = [(c, i) for c in range(len(labels)) for i in range(views)]
    paths = [options.out / f"{n:04d}_{labels[c]}.png" for n, (c, _) in enumerate(rows)]
    beside = [p.with_suffix(".npy") for p in paths] + [options.out / LEGEND]
    files = paths if options.output == "picture" else paths + beside
    taken = [p for p in files if p.exists()]
    if taken and not options.overwrite:
        raise UsageError(f"{taken[0]} exists; choose another --out or add --overwrite.")
    return rows, paths


def own_views(options: Options, document: "Document", size: tuple[int, int] | None) -> list["View"]:
    """The views around the scene: as many as --frames on the orbit, else the one from the front."""
    from shapeshift.scene.cameras.framing import orbit_path

    size = size or (640, 360)
    if options.camera == "front" or options.frames == 1:
        return [document.view(size)]
    return orbit_path(options.frames, *document.bounds(), size)


def choose_selectors(texts: tuple[str, ...], model, view) -> tuple:
    """The selectors that the texts of --select stand for; a lens looks along the view."""
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.selectors.selector_texts import read_selector

    try:
        return tuple(read_selector(text, model.stops, view.world_from_eye) for text in texts)
    except ValueError as error:
        raise UsageError(f"--select {error}") from None


def shapes_of(options: Options, document: "Document", cuts: tuple, rows, selectors) -> tuple:
    """The scenes whose shape is laid under each picture, and how much of it; () for none."""
    if not options.shape_of:
        return ()
    from shapeshift.app.decomposition.show_views import show_objects
    from shapeshift.app.drawing import appearing, read_look, sectioned

    shape = show_objects(document_at(document, options.shape_of, "--shape-of").scene, options.show)
    shape = appearing(shape, read_look(options)[0])
    scenes = [sectioned(with_selectors(shape, selectors[i]), cuts) for _, i in rows]
    return scenes, options.detail


def draw_all(
    renderer, scenes: list, views: list, paths: list[Path], eye_distance: float,
    shapes: Sequence = (), detail: float = 1.0,
) -> None:  # fmt: skip
    """A picture of each scene from its view; two eyes side by side where they are apart.

    shapes: other scenes, one a picture, whose fine structure is laid under it.
    """
    import numpy as np

    from shapeshift.app.commands.outputs import with_legend
    from shapeshift.app.drawing import save_png
    from shapeshift.app.progress import tracked
    from shapeshift.renderer.debug.debug import debug_legend
    from shapeshift.scene.pose import stereo_pair

    work = list(zip(scenes, views, paths, shapes or [None] * len(scenes), strict=True))
    for scene, view, path, shape in tracked(work, "drawing"):
        eyes = stereo_pair(view, eye_distance) if eye_distance > 0 else [view]
        parts = []
        for each in (scene, shape) if shape is not None else (scene,):
            renderer.update(each)
            stats = renderer.draw(eyes)
            parts.append([renderer.resolved(i).copy() for i in range(len(eyes))])
        if shape is not None:
            from shapeshift.renderer.colors.heat_over_shape import heat_over_shape

            pairs = zip(*parts, strict=True)
            parts[0] = [heat_over_shape(heat, photo, detail) for heat, photo in pairs]
        picture = np.concatenate(parts[0], axis=1)
        save_png(with_legend(picture, debug_legend(renderer.settings.debug, stats)), path)
