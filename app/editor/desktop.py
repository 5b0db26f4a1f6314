"""launch.py view: opens files in a window, as its options ask."""

from contextlib import AbstractContextManager
from dataclasses import replace

import numpy as np

from shapeshift.app.camera_files import camera_reading
from shapeshift.app.drawing import parse_size, read_cuts
from shapeshift.app.editor.options import Options
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import first_look, named_cameras, opened_scene
from shapeshift.app.editor.state.files.opened import read_files
from shapeshift.app.editor.state.files.refine import Refiner
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.window.levels import attach_budget, attach_refiner
from shapeshift.app.editor.window.shell import speak_first
from shapeshift.app.editor.window.split import splitting
from shapeshift.app.editor.window.viewer import Viewer
from shapeshift.app.editor.window.window import Window
from shapeshift.app.editor.window.wipe import comparing
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import DEMO, TOUCH, config_folder, plain
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.selectors.read_selector import read_selector
from shapeshift.scene.selectors.selector import Selector

WINDOW_SIZE = "1280x720"  # of the window, pixels at a text size of 1


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
    found = named_cameras(options.camera, options, read)
    if not found.sources and found.file is None:
        raise UsageError(f"{paths[0]} holds cameras; name a scene as well.")
    cuts = read_cuts(options.section, [source.model for source in found.sources])
    scene, edited = opened_scene(found, options.x, cuts)
    state.open_sources(found.sources, scene, first_look(found), edited)
    state.settings = replace(state.settings, debug=options.debug)
    state.regions.add_selectors(read_selectors(options.select, state), 0)
    state.keep_regions()
    settings = (
        ProgramSettings.read(config_folder()) if options.screenshot is None else ProgramSettings()
    )
    speak_first(settings, state.messages)
    with refiner, state.bodies, Window("Shapeshift", size, settings.text_size) as window:
        with Renderer(window.ctx, drawing=options.drawing) as renderer:
            if not options.size and options.screenshot is None:
                window.stand(settings.place)
            own_files = OwnFiles(settings.folder)
            viewer = Viewer(window, renderer, state, options, settings, own_files)
            hooks, upload = viewer.hooks, viewer.shown.upload
            attach_budget(renderer, state, hooks)
            attach_refiner(refiner, state, hooks, upload, viewer.dial.scene_changed)
            viewer.files.read = refiner.open
            viewer.files.started(found)
            two: AbstractContextManager[object]
            if options.compare:
                two = comparing(window, renderer, state, hooks, options, viewer.free)
            else:
                two = splitting(
                    window, state, hooks, viewer.free,
                    lambda: Renderer(window.ctx, drawing=options.drawing),
                )  # fmt: skip
            with two, viewer.parts.finder:
                viewer.loop()
            viewer.shell.keep_place()
    return 0


def read_selectors(texts: tuple[str, ...], state: EditorState) -> tuple[Selector, ...]:
    """What --select says about the first object; UsageError, one sentence, for what is none."""
    try:
        objects = state.scene.objects
        stops = objects[0].model.stops if objects else ()
        return tuple(read_selector(text, stops) for text in texts)
    except ValueError as error:
        raise UsageError(f"--select {error}") from None
