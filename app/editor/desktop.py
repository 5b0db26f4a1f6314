"""launch.py view: opens files in a window, as its options ask."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace

import glfw
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.camera_files import camera_reading
from shapeshift.app.charts.comparison import MOST_DB, Comparison
from shapeshift.app.commands.compared import SceneSide, open_side
from shapeshift.app.drawing import parse_size, read_cuts
from shapeshift.app.editor.options import Options
from shapeshift.app.editor.panels.empty_panel import draw_opening
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.journal import Journal
from shapeshift.app.editor.state.files.open_scene import first_look, named_cameras, opened_scene
from shapeshift.app.editor.state.files.opened import read_files
from shapeshift.app.editor.state.layout import Box
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.shell import speak_first
from shapeshift.app.editor.window.shown import FrameRequest, picture_key
from shapeshift.app.editor.window.two_pictures import TwoPictures, splitting
from shapeshift.app.editor.window.viewer import Viewer
from shapeshift.app.editor.window.window import Event, KeyDown, Window
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import TOUCH, config_folder, data_folder, plain
from shapeshift.app.streaming.refine import Refiner, show_level
from shapeshift.rasterizer.program import compiling
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import BadFile, SplatLayers
from shapeshift.runtime_models.program import program
from shapeshift.scene.cameras.camera_list import moved
from shapeshift.scene.metrics import psnr
from shapeshift.scene.scene import Scene
from shapeshift.scene.selectors.selector import Selector
from shapeshift.scene.selectors.selector_texts import read_selector

SAY_AGAIN_S = 0.5  # between two pictures of what a first start does
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
    paths = tuple(map(plain, options.scenes)) or (TOUCH,)
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
        if not options.size and options.screenshot is None and window.stand(settings.place):
            settings.panel_open = None  # that was for a larger window
        card = OpeningCard(window, state.title if options.screenshot is None else None)
        with card, Renderer(window.ctx, drawing=options.drawing) as renderer:
            own_files = OwnFiles(settings.folder)
            viewer = Viewer(window, renderer, state, options, settings, own_files)
            if options.screenshot is None:
                journal = Journal(state, data_folder() / "journals")
                viewer.objects.recovering.begin(journal, viewer.hooks)
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
                if options.screenshot is None:
                    viewer.draw_splats()  # all that is compiled for them is
                    viewer.is_drawn = True
                card.end()
                viewer.loop()
            viewer.shell.keep_place()
            viewer.objects.recovering.close()
    return 0


class OpeningCard:
    """What the window shows until it has a picture: no black one, and what is compiled, once.

    Use it in a `with`; nothing else may draw into the window until `end`.
    """

    def __init__(self, window: Window, title: str | None) -> None:
        """`title` None: nobody watches, so nothing is shown."""
        self._window, self._title = window, title
        self._began = self._shown = time.perf_counter()
        self._count = 0  # compilers that have begun

    def __enter__(self) -> "OpeningCard":
        if self._title is not None:
            compiling.append(self._compile)
            self._show(said("Opening {name}", name=self._title or "Shapeshift"))
        return self

    def __exit__(self, *failure) -> None:
        self.end()

    def end(self) -> None:
        """The window has its first picture; called again, nothing."""
        if self._compile in compiling:
            compiling.remove(self._compile)

    def _compile(self, name: str) -> None:
        """A start that finds everything compiled is over before there is something to read."""
        self._count += 1
        now = time.perf_counter()
        if now - self._shown < SAY_AGAIN_S:
            return
        seconds = round(now - self._began)
        done = {"name": name, "count": self._count, "seconds": seconds}
        self._show(
            said("Preparing this graphics device, once"),
            said("Compiling {name} ({count} so far, {seconds} s)", **done),
            said("The next start finds it ready."),
        )

    def _show(self, *lines: str) -> None:
        window = self._window
        window.wait(0.0)  # the desktop sees that the program is alive
        for last in (False, True):  # ImGui knows the size of a text once it has laid it out
            window.begin_frame(early=True)
            draw_opening(window.logical_size, lines, window.ui_scale)
            if not last:
                imgui.end_frame()
        window.screen().clear()
        window.end_frame()
        window.swap()
        self._shown = time.perf_counter()


def read_selectors(texts: tuple[str, ...], state: EditorState) -> tuple[Selector, ...]:
    """What --select says about the first object; UsageError, one sentence, for what is none."""
    try:
        objects = state.scene.objects
        stops = objects[0].model.stops if objects else ()
        return tuple(read_selector(text, stops) for text in texts)
    except ValueError as error:
        raise UsageError(f"--select {error}") from None


# Levels of detail in the window: finer ones are shown as they come, if the device holds them.


def attach_budget(renderer: Renderer, state: EditorState, hooks: Hooks) -> None:
    """Draws leaves as they come, and says how many of the splats in sight are there."""
    renderer.streaming.converges = False
    told: list[str] = []

    def go_on() -> bool:
        stats = renderer.streaming.stats
        if stats is not None and stats.problem and stats.problem not in told:
            told.append(stats.problem)
            state.problem = stats.problem
        return stats is not None and stats.pending

    def words() -> str:
        stats = renderer.streaming.stats
        if stats is None or not stats.whole:
            return ""
        counts = {"shown": short_count(stats.shown), "all": short_count(stats.in_sight)}
        text = said("{shown} of {all} in sight", **counts)
        return f"{text} …" if stats.pending else text

    hooks.each_frame.append(go_on)
    hooks.status.append(words)


def short_count(count: int) -> str:
    """ "2.0 M": millions from a million on."""
    return f"{count / 1e6:.1f} M" if count >= 999_950 else number(count)


def attach_refiner(
    refiner: Refiner, state: EditorState, hooks: Hooks, upload: Callable[[Scene], None],
    scene_changed: Callable[[], None],
) -> None:  # fmt: skip
    """Shows finer levels as they come; camera, x and settings stay.

    `upload` gives a scene to the device and raises BadFile where it does not fit; `scene_changed`
    hears that another number of splats is drawn.
    """

    def swap() -> bool:
        if (pair := refiner.next_level()) is not None:
            before, after = pair
            places = [i for i, obj in enumerate(state.scene.objects) if obj.model is before]
            for index in places:
                show(index, before, after)
        if refiner.problem:
            state.problem, refiner.problem = refiner.problem, ""
        return refiner.running

    def show(index: int, before: SplatLayers, after: SplatLayers) -> None:
        show_level(state, index, after)
        try:
            upload(state.scene)
        except BadFile as error:  # more than the driver holds: the level before stays
            show_level(state, index, before)
            refiner.stop_at(before)
            state.problem = said("no finer level can be shown: {error}", error=error)
        scene_changed()

    def follow() -> None:
        refiner.follow([obj.model for obj in state.scene.objects])

    hooks.each_frame.append(swap)
    hooks.opened.append(follow)
    hooks.status.append(lambda: refiner.status)
    follow()


# Another scene compared with the open one: a line parts the two pictures, PSNR is shown.

KEYS = (
    (", .", "move the line of the wipe"),
    ("C", "wipe on, off"),
)


@contextmanager
def comparing(
    window: Window, renderer: Renderer, state: EditorState, hooks: Hooks, options: Options,
    free: Callable[[], Box],
) -> Iterator["Wipe"]:  # fmt: skip
    """Adds a wipe over what `renderer` has drawn, in the middle of what is `free` of the window,
    logical pixels.  Raises BadFile, UsageError.
    """
    side = open_side(options.compare, options)
    if not isinstance(side, SceneSide):
        raise UsageError(
            f"--compare is {options.compare}, a folder of pictures; the viewer compares scenes, "
            f"`{program()} compare` also pictures."
        )
    drawing = renderer.backends["drawing"].split()[0]
    with Renderer(window.ctx, drawing) as other:
        wipe = Wipe(window, (renderer, other), state, side, free())
        wipe.attach(hooks)
        state.say(said("Drag the line, or press , and . for it; C takes it away"))
        try:
            yield wipe
        finally:
            wipe.release()


class Wipe(TwoPictures):
    """B is another scene, seen by A's camera; how alike the two are is measured at rest."""

    def __init__(
        self, window: Window, renderers: tuple[Renderer, Renderer], state: EditorState,
        side: SceneSide, free: Box,
    ) -> None:  # fmt: skip
        """`renderers` are A's, which the window has, and B's."""
        super().__init__(window, renderers[1], (free[0] + free[2]) / 2 / window.logical_size[0])
        self._of_a, self._state, self._side = renderers[0], state, side
        self._scene = side.subject.scene
        self._scene_file = state.edited.path  # that A is; None: models
        self._comparison = Comparison()
        self._waiting = False  # the picture has not rested long enough to be measured
        self.on = True

    def attach(self, hooks: Hooks) -> None:
        hooks.over.append(self.draw)
        hooks.marks.append(self.draw_marks)
        hooks.event_handlers.append(self.handle_event)
        hooks.status.append(self.status)
        hooks.keys["Comparing"] = list(KEYS)
        hooks.each_frame.append(lambda: self.on and self._waiting)

    def draw(self, request: FrameRequest) -> None:
        """Lays B over the right part of the window, in which A's picture is."""
        if not self.on or not request.scene.objects:
            return
        (view,) = moved([request.view], self._offset(request.scene).tolist())
        same = FrameRequest(self._scene_at(request.scene), view, request.settings, request.moving)
        self.draw_right(same)
        self._measure(request, same)

    def _offset(self, scene: Scene) -> np.ndarray:
        """(3,) metres from A's own coordinates to B's: both say where their zero lies."""
        model = None if self._scene_file else scene.objects[0].model
        of_a = np.array(getattr(model, "origin", (0.0, 0.0, 0.0)))
        return of_a - self._side.subject.origin

    def _scene_at(self, scene: Scene) -> Scene:
        """B at its own x where that was given, else at A's; the same object until x changes."""
        x = scene.objects[0].x
        if not self._side.stated and x != self._scene.objects[0].x:
            self._scene = self._side.subject.at(x)
        return self._scene

    def _measure(self, request: FrameRequest, same: FrameRequest) -> None:
        """PSNR of the two whole pictures, once each time that they have come to rest."""
        key = (
            request.scene,
            id(same.scene),
            *picture_key(request.scene, request.view, request.settings)[1:],
        )
        if self._comparison.due(key, time.perf_counter(), request.moving):
            pictures = (self._of_a.resolved(0), self._renderer.resolved(0))
            self._comparison.measured(key, min(psnr(*pictures), MOST_DB))
        self._waiting = self._comparison.is_old(key)

    def status(self) -> str:
        if not self.on or self._waiting or self._comparison.db is None:
            return ""
        db = self._comparison.db
        return "A = B" if db == MOST_DB else said("A to B {db:.1f} dB", db=db)

    def handle_event(self, event: Event) -> bool:
        """True for what concerns the line: dragging it, the keys , . and C."""
        if isinstance(event, KeyDown) and event.key == glfw.KEY_C:
            self.on = not self.on
            return True
        return self.on and self.handle_line_event(event)

    def draw_marks(self, ui_scale: float) -> None:
        """The line and the two names beside it."""
        if not self.on:
            return
        scene = self._state.scene
        of_a = scene.objects[0].name if scene.objects else ""
        of_a = self._scene_file.name if self._scene_file else of_a
        names = (f"A  {of_a}".rstrip(), f"B  {self._side.name}")
        self.draw_line(names, (theme.TEXT, theme.TEXT), ui_scale)
