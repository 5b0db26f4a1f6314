"""launch.py render: a scene into PNG files, without a window."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Annotated, Literal

import tyro

from app.opening import ReadingOptions, open_model
from app.terminal import say

AROUND = ("orbit", "front")  # cameras that take their place from the scene
LEGEND = "legend.json"  # of --output
LIMITS = ("max_pixels", "max_distance", "min_pixels", "fade")


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Draw a scene into PNG files."""

    scene: Annotated[Path, tyro.conf.Positional]
    """A package, a .ply, a .splat, a folder of PLY layers or a scene file, see docs/scene.md."""
    out: Path
    """Folder for the pictures."""
    x: tuple[str, ...] = ()
    """Control values in 0..1, or sweep:N; default: 0, and in a scene file what it says for each
    object."""
    camera: str = "orbit"
    """orbit, front, auto (cameras that lie with the scene), or a file or folder of cameras, see
    docs/cameras.md: ours, cameras.json, transforms.json, camera_path.json, _vr.json, COLMAP."""
    fov_y: float = 0.0
    """Degrees from top to bottom, for a camera file that says nothing about the lens."""
    frames: int = 1
    """Pictures on the orbit (per control value); a camera file gives its own number."""
    size: str = ""
    """WIDTHxHEIGHT in pixels; default 640x360, or what the camera file says."""
    stereo: float = 0.0
    """Distance of two eyes in metres; above 0 each picture holds both, side by side."""
    background: tuple[float, float, float] | None = None
    """Display sRGB, 0 to 1; default: what the scene was trained on, else black."""
    drawing: Literal["auto", "quads", "tiles"] = "auto"
    """Drawing back end: GL quads or OpenCL tiles."""
    context: Literal["auto", "egl", "surfaceless", "osmesa", "none"] = "auto"
    """Where GL comes from."""
    debug: Literal["", "culls", "birdseye", "overdraw", "depth", "object"] = ""
    """Instead of the picture: which splats are left out and why, the same from above, how many
    splats lie over each pixel, how far they are, which object they are of; with a legend."""
    output: Literal["picture", "depth", "normal", "coverage"] = "picture"
    """Instead of the colours: metres along the view, directions of the surface or how much of a
    pixel is covered; each as a .npy and a 16-bit .png, and a legend.json that tells the numbers."""
    depth_unit: float | None = None
    """Metres a step of --output depth's .png; default: the finest power of ten that is enough."""
    max_pixels: float = inf
    """Leave out splats larger than this: one sigma of the longer axis, pixels."""
    max_distance: float = inf
    """Leave out splats farther from the eye than this, metres."""
    min_pixels: float = 0.0
    """Leave out splats smaller than this: from the centre to where they end, pixels."""
    fade: float = 0.0
    """Part of each of these limits over which splats fade, 0 to 1; 0: they end at once."""
    select: tuple[str, ...] = ()
    """Parts with a control value X of their own (a number or a stop's name), smooth over a border
    in metres: sphere:x,y,z:radius:X[:border] box:x,y,z:hx,hy,hz:X[:border]
    half:x,y,z:nx,ny,nz:X[:border] lens:degrees:X[:border]; a later one lies over an earlier one."""
    target_ms: float | None = None
    """Choose the setting by this budget, milliseconds a frame, from a chart of this scene on this
    machine; measured once, in seconds, and kept."""
    floor_db: float | None = None
    """Never below this PSNR against the exact picture, whatever the budget; default 35."""
    overwrite: bool = False
    """Replace pictures of the same name."""


def run(options: Options) -> int:
    from app.charts.budget import read_budget
    from app.charts.budget_chart import Drawn, settings_for
    from app.commands.outputs import draw_outputs
    from app.drawing import (
        MOST_VALUES,
        make_folder,
        open_renderer,
        parse_controls,
        parse_size,
    )
    from app.errors import UsageError
    from scene.scene_file import is_scene_file

    controls = parse_controls(options.x) if options.x else [None]
    size = parse_size(options.size) if options.size else None
    if not 1 <= options.frames <= MOST_VALUES:
        raise UsageError(f"--frames is {options.frames}, expected 1 to {MOST_VALUES}.")
    if options.background and not all(0 <= c <= 1 for c in options.background):
        raise UsageError(f"--background is {options.background}, expected three values in 0..1.")
    if not 0 <= options.stereo < 1:
        raise UsageError(f"--stereo is {options.stereo}, expected metres from 0 to 1.")
    settings, budget = choose_settings(options), read_budget(options.target_ms, options.floor_db)
    check_one_of(options, budget)
    check_output(options)
    # What needs no scene comes before it: large ones take a while to open.
    cameras = choose_cameras(options, size)
    pairs, paths = choose_paths(options, controls, len(cameras.views) if cameras else None)
    opened = (open_objects if is_scene_file(options.scene) else open_one)(options, cameras, size)
    views = opened.views
    with open_renderer(options.context, options.drawing) as (renderer, ctx):
        make_folder(options.out)
        background = options.background or opened.background
        renderer.settings = replace(
            settings, target=renderer.settings.target, background=background
        )
        if budget:
            x, eyes = controls[0], 1 + (options.stereo > 0)
            drawn = Drawn(opened.subject, x, views[0].size, eyes)
            renderer.settings = settings_for(budget, renderer, ctx, drawn)
        scenes = [opened.scene_at(x, i) for x, i in pairs]
        work = (renderer, scenes, [views[i] for _, i in pairs], paths, options.stereo)
        if options.output == "picture":
            draw_all(*work)
        else:
            draw_outputs(*work, options.output, unit_of(options, opened.subject, views))
    say(f"{len(paths)} picture{'s' * (len(paths) > 1)} in {options.out}")
    return 0


@dataclass(frozen=True)
class Opened:
    """What is drawn, from where, before what."""

    views: list
    background: tuple[float, float, float]  # where the options give none
    scene_at: Callable  # (x, row of the view) -> Scene
    subject: object  # what a budget is measured with


def open_one(options: Options, cameras, size: tuple[int, int] | None) -> Opened:
    """A scene of one model, with the parts of --select."""
    from app.subject import Subject
    from scene.scene import Scene

    model = open_model(options.scene, options)
    subject = Subject.of(model, 0.0)
    views = subject.sees(cameras).views if cameras else own_views(options, subject, size)
    selectors = [choose_selectors(options.select, model, view) for view in views]

    def scene_at(x: float | None, row: int) -> Scene:
        (thing,) = subject.at(x).objects
        return Scene((replace(thing, selectors=selectors[row]),))

    return Opened(views, subject.background, scene_at, subject)


def open_objects(options: Options, cameras, size: tuple[int, int] | None) -> Opened:
    """The objects of a scene file, each where and as the file says."""
    from app.errors import UsageError
    from app.subject import open_subject

    if options.select:
        raise UsageError("--select is for one model; a scene file has selectors for each object.")
    subject = open_subject(options.scene, options)
    views = cameras.views if cameras else own_views(options, subject, size)
    return Opened(views, subject.background, lambda x, row: subject.at(x), subject)


def check_one_of(options: Options, budget) -> None:
    """A budget chooses the limits; who gives them has chosen already."""
    from app.errors import UsageError

    given = [name for name in LIMITS if getattr(options, name) != getattr(Options, name)]
    if budget and given:
        option = f"--{given[0].replace('_', '-')}"
        raise UsageError(f"--target-ms chooses what {option} says; leave one of the two out.")


def check_output(options: Options) -> None:
    """Numbers have neither a legend drawn over them nor a budget."""
    from app.errors import UsageError

    for name in ("debug", "target_ms"):
        if options.output != "picture" and getattr(options, name) != getattr(Options, name):
            option = f"--{name.replace('_', '-')}"
            raise UsageError(f"--output {options.output} goes without {option}; leave one out.")
    if options.depth_unit is not None and not 1e-9 <= options.depth_unit <= 1e6:
        raise UsageError(f"--depth-unit is {options.depth_unit}, expected metres above 0.")


def unit_of(options: Options, subject, views: list) -> float:
    """Metres a step of a depth picture."""
    from app.commands.outputs import choose_unit

    return options.depth_unit or choose_unit(*subject.bounds(), views)


def choose_settings(options: Options):
    """The RenderSettings of the options; UsageError names what is out of range."""
    from app.errors import UsageError
    from renderer.settings import RenderSettings

    try:
        return RenderSettings(**{name: getattr(options, name) for name in ("debug", *LIMITS)})
    except ValueError as error:
        raise UsageError(f"--{str(error).replace('_', '-', 1)}") from None


def choose_cameras(options: Options, size: tuple[int, int] | None):
    """The CameraList of the files that --camera names, in their own world; None: views around the
    scene.  `size` None leaves the pixels to the file.
    """
    from app.camera_files import named_cameras

    if options.camera in AROUND:
        return None
    cameras = named_cameras(options.camera, options.scene, options, size)
    for note in cameras.notes:
        say(note)
    return cameras


def choose_paths(
    options: Options, controls: list[float | None], views: int | None
) -> tuple[list[tuple[float | None, int]], list[Path]]:
    """(x, number of the view) of every picture, and its file.  UsageError where one is there."""
    from app.drawing import MOST_VALUES
    from app.errors import UsageError

    views = views or (options.frames if options.camera == "orbit" else 1)
    count = len(controls) * views
    if count > MOST_VALUES:
        raise UsageError(f"{count} pictures asked for, at most {MOST_VALUES} in one run.")
    pairs = [(x, i) for x in controls for i in range(views)]
    paths = [options.out / f"{i:04d}_x{x or 0:.3f}.png" for i, (x, _) in enumerate(pairs)]
    beside = [p.with_suffix(".npy") for p in paths] + [options.out / LEGEND]
    files = paths if options.output == "picture" else paths + beside
    taken = [p for p in files if p.exists()]
    if taken and not options.overwrite:
        raise UsageError(f"{taken[0]} exists; choose another --out or add --overwrite.")
    return pairs, paths


def own_views(options: Options, subject, size: tuple[int, int] | None) -> list:
    """The views around the scene: as many as --frames on the orbit, else the one from the front."""
    from scene.framing import orbit_path

    size = size or (640, 360)
    if options.camera == "front" or options.frames == 1:
        return [subject.view(size)]
    return orbit_path(options.frames, *subject.bounds(), size)


def choose_selectors(texts: tuple[str, ...], model, view) -> tuple:
    """The selectors that the texts of --select stand for; a lens looks along the view."""
    from app.errors import UsageError
    from scene.read_selector import read_selector

    try:
        return tuple(read_selector(text, model.stops, view.world_from_eye) for text in texts)
    except ValueError as error:
        raise UsageError(f"--select {error}") from None


def draw_all(renderer, scenes: list, views: list, paths: list[Path], eye_distance: float) -> None:
    """A picture of each scene from its view; two eyes side by side where they are apart."""
    import numpy as np

    from app.commands.picture_legend import with_legend
    from app.drawing import save_png
    from app.progress import tracked
    from renderer.debug import debug_legend
    from scene.stereo import stereo_pair

    work = list(zip(scenes, views, paths, strict=True))
    for scene, view, path in tracked(work, "drawing"):
        renderer.update(scene)
        eyes = stereo_pair(view, eye_distance) if eye_distance > 0 else [view]
        stats = renderer.draw(eyes)
        picture = np.concatenate([renderer.resolved(i) for i in range(len(eyes))], axis=1)
        save_png(with_legend(picture, debug_legend(renderer.settings.debug, stats)), path)
