"""launch.py view: opens files in a window; its options, and what they ask of the viewer."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from app.camera_files import camera_reading
from app.drawing import parse_size
from app.errors import UsageError
from app.opening import ReadingOptions
from app.paths import DEMO, TOUCH, config_folder, plain
from app.viewer.files import first_look, named_cameras, opened_scene
from app.viewer.opened import read_files
from app.viewer.own_files import OwnFiles
from app.viewer.refine import Refiner, attach_refiner
from app.viewer.settings import Settings
from app.viewer.split import splitting
from app.viewer.stage import Stage
from app.viewer.viewer import Viewer
from app.viewer.window import Window
from app.viewer.wipe import comparing
from renderer.renderer import Renderer
from scene.read_selector import read_selector
from scene.selector import Selector

SIZE = "1280x720"  # of the window, pixels at a text size of 1


@dataclass(frozen=True)
class Options(ReadingOptions):
    scenes: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Packages, splats of any known format, folders of layers, and files of cameras to step
    through; none: the bundled demo."""
    camera: Path | None = None
    """File or folder of cameras: starts at its first, N and P step; see docs/cameras.md."""
    fov_y: float = 0.0
    """Degrees from top to bottom, for a camera file that says nothing about the lens."""
    x: float | None = None
    """Control value to start at, 0..1; without it the first stop."""
    size: str = ""
    """Of the window, WxH in pixels; without it 1280x720, and as much larger as the text is."""
    drawing: Literal["auto", "quads", "tiles"] = "auto"
    """Back end that draws the splats: OpenGL quads, or OpenCL tiles where there is no GPU."""
    target_ms: float | None = None
    """Choose the setting by this budget, milliseconds a frame; measured once at the start."""
    floor_db: float | None = None
    """Never below this PSNR in dB against the exact picture, whatever the budget."""
    debug: Literal["", "culls", "birdseye", "overdraw", "depth", "object"] = ""
    """Debug view to start in; G goes through them."""
    select: tuple[str, ...] = ()
    """Regions with an x of their own, one after the other: sphere:x,y,z:radius:X[:border],
    box:x,y,z:hx,hy,hz:X[:border], half:x,y,z:nx,ny,nz:X[:border], lens:degrees:X[:border]."""
    pictures: Path | None = None
    """Folder for the pictures that F12 saves and the views that K keeps; scenes and exports go
    beside it.  Without it Shapeshift/pictures among your documents."""
    screenshot: Path | None = None
    """Write a picture of the whole window here after --frames frames, and end."""
    frames: int = 3
    """How many frames to draw before the --screenshot."""
    compare: str = ""
    """Another scene (or scene@stop, scene@x) to compare with: a line parts the two pictures."""
    touch: bool = False
    """Without a scene: the bundled one that can be touched, a table where things move."""
    play: bool = False
    """Let the things of a scene file fall and be carried from the start; T switches it."""
    panel: Annotated[bool, tyro.conf.arg(help="Show the overlay; H switches it.")] = True


def run(options: Options) -> int:
    """Opens the window and stays until it is closed; 0.  Errors for people say why not."""
    size = parse_size(options.size or SIZE)
    if options.x is not None and not 0 <= options.x <= 1:
        raise UsageError(f"--x is {options.x}, expected 0 to 1.")
    if options.frames < 1:
        raise UsageError(f"--frames is {options.frames}, expected 1 or more.")
    for name, value in (("--target-ms", options.target_ms), ("--floor-db", options.floor_db)):
        if value is not None and not 0 < value < np.inf:
            raise UsageError(f"{name} is {value}, expected a number above 0.")
    refiner = Refiner(options)
    stage = Stage(refiner.open)
    paths = tuple(map(plain, options.scenes)) or ((TOUCH if options.touch else DEMO),)
    read = read_files(paths, refiner.open, camera_reading(options), None, options.reading())
    found = named_cameras(options, read)
    if not found.sources and found.file is None:
        raise UsageError(f"{paths[0]} holds cameras; name a scene as well.")
    if found.file is not None and options.x is not None:
        raise UsageError(f"--x is for one model; {found.path.name} is a scene of objects.")
    scene, document = opened_scene(found, options.x)
    stage.take(found.sources, scene, first_look(found), document)
    stage.settings = replace(stage.settings, debug=options.debug)
    stage.regions.take(read_selectors(options.select, stage), 0)
    stage.keep_regions()
    settings = Settings.read(config_folder()) if options.screenshot is None else Settings()
    with refiner, stage.bodies, Window("Shapeshift", size, settings.text_size) as window:
        with Renderer(window.ctx, drawing=options.drawing) as renderer:
            if not options.size and options.screenshot is None:
                window.grow_with_text()
            own_files = OwnFiles(settings.folder)
            viewer = Viewer(window, renderer, stage, options, settings, own_files)
            attach_refiner(viewer, refiner)
            viewer.files.read = refiner.open
            viewer.files.started(found, options)
            with comparing(viewer, options) if options.compare else splitting(
                window, stage, viewer.hooks, stage.messages, lambda: viewer.layout.free,
                lambda: Renderer(window.ctx, drawing=options.drawing),
            ):  # fmt: skip
                viewer.loop()
    return 0


def read_selectors(texts: tuple[str, ...], stage: Stage) -> tuple[Selector, ...]:
    """What --select says about the first object; UsageError, one sentence, for what is none."""
    try:
        things = stage.scene.objects
        stops = things[0].model.stops if things else ()
        return tuple(read_selector(text, stops) for text in texts)
    except ValueError as error:
        raise UsageError(f"--select {error}") from None
