"""launch.py view: opens files in a window; its options, and what they ask of the viewer."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from shapeshift.app.camera_files import camera_reading
from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL, REGIONS, SIZE, Opt
from shapeshift.app.drawing import parse_size
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import read_files
from shapeshift.app.editor.state.files.refine import Refiner, attach_refiner
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.editor.state.user.settings import Settings
from shapeshift.app.editor.window.files import first_look, named_cameras, opened_scene
from shapeshift.app.editor.window.split import splitting
from shapeshift.app.editor.window.viewer import Viewer
from shapeshift.app.editor.window.window import Window
from shapeshift.app.editor.window.wipe import comparing
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import DEMO, TOUCH, config_folder, plain
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.selectors.read_selector import read_selector
from shapeshift.scene.selectors.selector import Selector

WINDOW_SIZE = "1280x720"  # of the window, pixels at a text size of 1


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Open a scene in a window."""

    scenes: Annotated[tuple[Path, ...], POSITIONAL] = ()
    """Packages, splats of any known format, folders of layers, scene files, and files of cameras to
    step through.  Default: the bundled demo."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands at the start: a stop by its name, or a number from 0 to 1.  Default:
    the first stop."""
    camera: Path | None = None
    """File or folder of cameras: starts at the first, N and P step through them (docs/cameras.md).
    Default: the whole scene in view."""
    size: Annotated[str, SIZE] = ""
    """WIDTHxHEIGHT of the window in pixels.  Default: 1280x720, and as much larger as the text
    is."""
    select: Annotated[tuple[str, ...], REGIONS] = ()
    """Regions with an X of their own (a stop's name or a number): sphere:x,y,z:radius:X[:border]
    box:x,y,z:hx,hy,hz:X[:border] half:x,y,z:nx,ny,nz:X[:border] lens:degrees:X[:border].  Default:
    none."""
    compare: Annotated[str, Opt(metavar="SCENE")] = ""
    """Another scene (or scene@Stop, scene@0.5) to compare with: a line parts the two pictures.
    Default: none."""
    touch: bool = False
    """Open the bundled scene that can be touched, a table with three objects; without a scene."""
    play: bool = False
    """Let the objects of a scene file fall and be carried from the start; T switches it."""
    pictures: Path | None = None
    """Folder for the pictures that F12 saves and the views that K keeps; scenes and exports go
    beside it.  Default: Shapeshift/pictures among your documents."""
    panel: bool = True
    """Show the panel over the picture; H switches it."""
    target_ms: Annotated[float | None, EXPERT] = None
    """Milliseconds that a frame may take: the setting is chosen by a chart that is measured at the
    start.  Default: no limit, the exact picture."""
    floor_db: Annotated[float | None, EXPERT] = None
    """PSNR in dB against the exact picture below which --target-ms never goes.  Default: 35."""
    fov_y: Annotated[float, EXPERT] = 0.0
    """Degrees from top to bottom, for a camera file that says nothing about the lens; 0: not
    known."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    debug: Annotated[Literal["", "culls", "birdseye", "overdraw", "depth", "object"], EXPERT] = ""
    """Debug view to start in; G goes through them.  Default: the picture."""
    screenshot: Annotated[Path | None, EXPERT] = None
    """Write a picture of the whole window to this file after --frames frames, and end.  Default:
    the window stays."""
    frames: Annotated[int, EXPERT] = 3
    """How many frames to draw before the --screenshot."""


def run(options: Options) -> int:
    """Opens the window and stays until it is closed; 0.  Errors for people say why not."""
    size = parse_size(options.size or WINDOW_SIZE)
    if options.frames < 1:
        raise UsageError(f"--frames is {options.frames}, expected 1 or more.")
    for name, value in (("--target-ms", options.target_ms), ("--floor-db", options.floor_db)):
        if value is not None and not 0 < value < np.inf:
            raise UsageError(f"{name} is {value}, expected a number above 0.")
    refiner = Refiner(options)
    state = EditorState(refiner.open)
    paths = tuple(map(plain, options.scenes)) or ((TOUCH if options.touch else DEMO),)
    read = read_files(paths, refiner.open, camera_reading(options), None, options.reading())
    found = named_cameras(options, read)
    if not found.sources and found.file is None:
        raise UsageError(f"{paths[0]} holds cameras; name a scene as well.")
    scene, document = opened_scene(found, options.x)
    state.take(found.sources, scene, first_look(found), document)
    state.settings = replace(state.settings, debug=options.debug)
    state.regions.take(read_selectors(options.select, state), 0)
    state.keep_regions()
    settings = Settings.read(config_folder()) if options.screenshot is None else Settings()
    with refiner, state.bodies, Window("Shapeshift", size, settings.text_size) as window:
        with Renderer(window.ctx, drawing=options.drawing) as renderer:
            if not options.size and options.screenshot is None:
                window.grow_with_text()
            own_files = OwnFiles(settings.folder)
            viewer = Viewer(window, renderer, state, options, settings, own_files)
            attach_refiner(viewer, refiner)
            viewer.files.read = refiner.open
            viewer.files.started(found, options)
            with comparing(viewer, options) if options.compare else splitting(
                window, state, viewer.hooks, state.messages, lambda: viewer.layout.free,
                lambda: Renderer(window.ctx, drawing=options.drawing),
            ):  # fmt: skip
                viewer.loop()
    return 0


def read_selectors(texts: tuple[str, ...], state: EditorState) -> tuple[Selector, ...]:
    """What --select says about the first object; UsageError, one sentence, for what is none."""
    try:
        things = state.scene.objects
        stops = things[0].model.stops if things else ()
        return tuple(read_selector(text, stops) for text in texts)
    except ValueError as error:
        raise UsageError(f"--select {error}") from None
