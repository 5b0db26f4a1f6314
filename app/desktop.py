"""The viewer: a window loop that draws only when something has changed."""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from app.bodies import attach_bodies
from app.camera_files import camera_reading
from app.camera_panel import KeptViews, attach_cameras
from app.controls import SMOOTH_S
from app.dial import FLOOR_DB, TARGET_MS, Dial
from app.drawing import parse_size
from app.errors import UsageError
from app.export_panel import attach_export
from app.files import Files, first_camera, home_of, named_cameras, opened_scene
from app.hands import is_erasing, is_painting, push, take
from app.legend_panel import draw_legend
from app.objects import attach_objects
from app.opened import read_files
from app.opening import ReadingOptions
from app.outlines import draw_brush, draw_outlines
from app.panel import draw_note, draw_panel, draw_problem, free_area
from app.paths import plain
from app.pictures import write_numbered_png, write_png
from app.readings import Readings
from app.refine import Refiner, attach_refiner
from app.scale_bar import draw_scale_bar
from app.sections import Hooks
from app.shown import Shown, Wish
from app.slider import draw_slider_bar
from app.stage import Stage
from app.status_line import draw_status
from app.stepping import Steps
from app.touch import attach_touch
from app.window import Event, Window
from app.wipe import comparing
from renderer.context import describe
from renderer.debug import debug_legend
from renderer.renderer import Renderer
from scene.pose import View
from scene.read_selector import read_selector
from scene.selector import Selector

DEMO = Path(__file__).resolve().parents[1] / "assets" / "workshop.shift"
WARM_UP = 3  # frames at the start that are drawn anew: the first pays for compilers and caches
NOTE_S = 3.0  # how long a note stays
SLEEP_S = 0.5  # longest wait for input while nothing moves
POLL_S = 0.03  # the same while a thread works at something that the window waits for
LONGEST_STEP_S = 0.25  # of time that passes at once, after a frame that took long


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
    size: str = "1280x720"
    """Of the window, WxH in pixels."""
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
    pictures: Path = Path("pictures")
    """Folder for the pictures that F12 saves and the views that K keeps."""
    screenshot: Path | None = None
    """Write a picture of the whole window here after --frames frames, and end."""
    frames: int = 3
    """How many frames to draw before the --screenshot."""
    compare: str = ""
    """Another scene (or scene@stop, scene@x) to compare with: a line parts the two pictures."""
    play: bool = False
    """Let the things of a scene file fall and be carried from the start; T switches it."""
    panel: Annotated[bool, tyro.conf.arg(help="Show the overlay; H switches it.")] = True


def run(options: Options) -> int:
    """Opens the window and stays until it is closed; 0.  Errors for people say why not."""
    size = parse_size(options.size)
    if options.x is not None and not 0 <= options.x <= 1:
        raise UsageError(f"--x is {options.x}, expected 0 to 1.")
    if options.frames < 1:
        raise UsageError(f"--frames is {options.frames}, expected 1 or more.")
    for name, value in (("--target-ms", options.target_ms), ("--floor-db", options.floor_db)):
        if value is not None and not 0 < value < np.inf:
            raise UsageError(f"{name} is {value}, expected a number above 0.")
    refiner = Refiner(options)
    stage = Stage(refiner.open)
    paths = tuple(map(plain, options.scenes)) or (DEMO,)
    read = read_files(paths, refiner.open, camera_reading(options), None, options.reading())
    found = named_cameras(options, read)
    if not found.sources:
        raise UsageError(f"{paths[0]} holds cameras; name a scene as well.")
    if found.file is not None and options.x is not None:
        raise UsageError(f"--x is for one model; {found.path.name} is a scene of objects.")
    scene, document = opened_scene(found, options.x)
    stage.take(found.sources, scene, home_of(found), document)
    stage.settings = replace(stage.settings, debug=options.debug)
    stage.regions.take(read_selectors(options.select, stage), 0)
    stage.document.saved_regions = stage.regions.version
    with refiner, Window("Shapeshift", size) as window:
        with Renderer(window.ctx, drawing=options.drawing) as renderer:
            viewer = Viewer(window, renderer, stage, options)
            attach_refiner(viewer, refiner)
            viewer.files.read = refiner.open
            viewer.files.started(found, options)
            with comparing(viewer, options):
                viewer.loop()
    return 0


def read_selectors(texts: tuple[str, ...], stage: Stage) -> tuple[Selector, ...]:
    """What --select says about the first object; UsageError, one sentence, for what is none."""
    try:
        stops = stage.scene.objects[0].model.stops
        return tuple(read_selector(text, stops) for text in texts)
    except ValueError as error:
        raise UsageError(f"--select {error}") from None


class Viewer:
    """One window, one renderer, one stage, one camera, and the loop that ties them."""

    def __init__(self, window: Window, renderer: Renderer, stage: Stage, options: Options) -> None:
        self.window, self.renderer, self.stage, self.options = window, renderer, stage, options
        self.overlay = options.panel
        self.hooks = Hooks()
        self._polling = False  # a hook waits for something that is under way
        names = describe(window.ctx) | renderer.backends
        self.readings = Readings(
            machine={key.replace("_", " "): str(v) for key, v in names.items()},
            drawing=renderer.backends["drawing"],
        )
        self._free = self._free_wanted()  # where the picture's middle is; follows the overlay
        self.camera = first_camera(self)
        self.steps = Steps()
        self.kept = KeptViews(options.pictures)
        self.files = Files(self)
        attach_bodies(self)
        self.objects = attach_objects(self)
        attach_cameras(self)
        attach_export(self)
        self.touch = attach_touch(self)
        self.shown = Shown(renderer, self.readings)
        self.dial = Dial(
            options.target_ms or TARGET_MS,
            options.floor_db or FLOOR_DB,
            wanted=(options.target_ms or options.floor_db) is not None,
        )
        self._note_until = 0.0
        self.seconds = 0.0  # that the frame which is under way lets pass
        self.frames = 0  # drawn since the window opened
        self._overlay_ms = 0.0
        self.save_picture = False

    def loop(self) -> None:
        """Input, time, splats if anything changed, overlay, swap; sleeps while all is still."""
        last = time.perf_counter()
        while not (self.window.closing and self._may_close()):
            busy = self._busy()
            redraw = self.window.wait(0.0 if busy else POLL_S if self._polling else SLEEP_S)
            now = time.perf_counter()
            if self.window.minimised:
                last = now
                time.sleep(0.05)
                continue
            seconds = min(now - last, LONGEST_STEP_S) if busy else 0.0
            last = now
            if busy or redraw or self._polling or self._note_ends(now) or self._idle_work_due(now):
                self.frame(seconds)
            if self.options.screenshot and self._last_frame:
                return

    def _may_close(self) -> bool:
        """Whether nothing would be lost; else the window stays, and a box asks."""
        may = all([asked() for asked in self.hooks.closing])
        if not may:
            self.window.keep_open()
        return may

    def frame(self, seconds: float) -> None:
        """One frame of the window: `seconds` have passed since the last one."""
        start, self.seconds = time.perf_counter(), seconds
        for event in self.window.begin_frame():
            self.take(event)
        self.stage.advance(seconds)
        pushed = push(self.window)
        if pushed.any:
            self.leave_camera()
        self.camera.step(seconds, pushed)
        self.steps.advance(seconds)
        self._polling = any([work() for work in self.hooks.each_frame])
        self._follow_overlay(seconds)
        self._turn_dial()
        fresh = self._draw_splats()
        drawn = time.perf_counter()
        self._draw_overlay()
        self.window.end_frame()
        self._overlay_ms = (time.perf_counter() - drawn) * 1e3
        self.frames += 1
        self._save_pictures()
        self.window.swap()
        now = self.readings.now = time.perf_counter()
        if fresh:
            self.readings.meter.note(now, (now - start) * 1e3, self.readings.stats)
            self.dial.seen((now - start) * 1e3, self._moving)
        self.readings.idle = not fresh

    def take(self, event: Event) -> None:
        """Lets one input event act."""
        take(self, event)

    def open_soon(self, paths: tuple[Path, ...]) -> None:
        """Opens files and folders, scenes or cameras, while the window goes on."""
        self.files.open_soon(paths)

    def say(self, text: str) -> None:
        """Shows a note for a few seconds, longer for more lines; "" takes it away."""
        self.readings.note = text
        self._note_until = time.perf_counter() + NOTE_S * (1 + text.count("\n"))

    def _busy(self) -> bool:
        """Whether the next frame is due without waiting for input."""
        waiting = self.options.screenshot is not None
        sliding = not np.array_equal(self._free, self._free_wanted())
        measuring = self.dial.wanted or self.dial.measuring
        first = self.frames < WARM_UP
        return self._moving or waiting or sliding or measuring or first

    def _free_wanted(self) -> np.ndarray:
        """(4,) pixels: the part of the window that the overlay leaves free."""
        window = self.window
        pixels = window.ui_scale * window.size[0] / max(window.logical_size[0], 1)
        if not self.overlay:
            return np.array([0.0, 0.0, *window.size])
        return np.array(free_area(window.size, len(self.stage.sliders), pixels))

    def _follow_overlay(self, seconds: float) -> None:
        """The picture moves over when the overlay comes or goes, in the same soft way."""
        wanted = self._free_wanted()
        self._free = wanted + (self._free - wanted) * np.exp(-seconds / SMOOTH_S)
        if np.abs(self._free - wanted).max() < 0.5 or self.frames == 0:
            self._free = wanted

    def view(self) -> View:
        """What the window shows: a camera that was stepped to, or what the hand has turned to."""
        view = self.camera.view(self.window.size, tuple(self._free))
        if self.steps.standing:
            return self.steps.view(view.size, tuple(self._free), view.near, view.far)
        return view

    def plain_view(self) -> View:
        """The same without what the overlay covers: a camera as filed, or centred."""
        if self.steps.standing and not self.steps.moving:
            return self.steps.cameras.views[self.steps.index]
        return self.camera.view(self.free_size())

    def leave_camera(self) -> None:
        """From the camera that was stepped to, where it stands, to moving freely."""
        if self.steps.standing:
            view, (_, top, _, bottom) = self.view(), self._free
            height = (view.tangents[3] - view.tangents[2]) * (bottom - top) / view.size[1]
            self.camera.stand(view.world_from_eye, 2 * float(np.arctan(height / 2)))
            self.steps.leave()

    def free_size(self) -> tuple[int, int]:
        left, top, right, bottom = self._free_wanted()
        return int(right - left), int(bottom - top)

    def _note_ends(self, now: float) -> bool:
        """True once when the note's time is over; it is taken away then."""
        over = bool(self.readings.note) and now >= self._note_until
        if over:
            self.readings.note = ""
        return over

    def _wish(self) -> Wish:
        """What the screen should show now."""
        stage, view, moving = self.stage, self.view(), self._moving
        settings = self.dial.while_moving(stage.settings) if moving else stage.settings
        return Wish(stage.shown(view), view, settings, moving or self.dial.measuring)

    @property
    def _moving(self) -> bool:
        by_hand = self.camera.moving or push(self.window).any
        stage = self.stage
        living = stage.running and not stage.world.resting
        return by_hand or self.steps.moving or stage.playing or living

    def _idle_work_due(self, now: float) -> bool:
        """Whether the picture has rested so long that its error is to be measured."""
        return self.shown.due(self._wish(), now)

    def _turn_dial(self) -> None:
        """Measures a little for the budget where that is wanted, and takes over what it chose."""
        dial, stage = self.dial, self.stage
        if dial.wanted:
            view = self.view()
            finish = self.window.ctx.finish
            dial.start(self.renderer, stage.shown(view), view, stage.centre, finish)
        if dial.measuring:
            self.shown.forget()
            if dial.step():
                stage.settings = dial.applied(stage.settings)

    def _draw_splats(self) -> bool:
        """Draws the scene into the window; True when the splats had to be drawn anew."""
        wish, now = self._wish(), time.perf_counter()
        if self.stage.measure_now or self.shown.due(wish, now):
            self.stage.measure_now = False
            self.shown.measure(wish)
        force = self.options.screenshot is not None or self.frames < WARM_UP
        fresh = self.shown.draw(wish, self.window.screen(), force)
        for draw in self.hooks.over:
            draw(wish)
        if fresh:
            self.readings.stats.ms["overlay"] = self._overlay_ms  # of the frame before
        self.shown.read(wish, now)
        return fresh

    def _draw_overlay(self) -> None:
        scale = self.window.ui_scale
        self.readings.flying = self.camera.flying
        covered = []
        free = free_area(self.window.logical_size, len(self.stage.sliders), scale)
        left = free[0] if self.overlay else 0.0
        if not self.save_picture:
            self._draw_marks(scale)
        if self.overlay:
            draw_scale_bar(self.stage.scene, scale)
            debug, stats = self.stage.settings.debug, self.readings.stats
            draw_legend(debug_legend(debug, stats), left, scale)
            covered = [
                draw_panel(self.stage, self.dial, self.readings, scale, self.hooks),
                draw_slider_bar(self.stage, left, scale),
                draw_status(self.stage, [words() for words in self.hooks.status], scale),
            ]
        if not self.save_picture:  # a note is no part of a picture
            draw_note(self.readings.note, left, scale)
        draw_problem(self.stage, scale)
        self.window.covered = tuple(covered)

    def _draw_marks(self, scale: float) -> None:
        """Outlines of the regions, and the brush while there is one."""
        stage, window = self.stage, self.window
        for draw in self.hooks.marks:
            draw(scale)
        if self.overlay or stage.regions.placing:
            draw_outlines(stage.regions, stage.scene, self.view(), scale)
        if is_painting(self) and window.on_scene:
            draw_brush(window.cursor, stage.regions.brush * scale, is_erasing(self), scale)

    def show_scene(self) -> None:
        """The stage has another scene: a new camera, and whoever depends on it is told."""
        self.camera = first_camera(self)
        self.steps.leave()
        self.dial.forget()
        for changed in self.hooks.opened:
            changed()
        self.set_title()

    def set_title(self) -> None:
        mark = "* " if self.objects.unsaved else ""
        name = self.stage.title
        self.window.set_title(f"{mark}{name} \u2013 Shapeshift" if name else "Shapeshift")

    @property
    def _last_frame(self) -> bool:
        """Whether a --screenshot is due: enough frames, the budget has chosen, all is read."""
        measuring = self.dial.wanted or self.dial.measuring
        return self.frames >= self.options.frames and not measuring and not self._polling

    def _save_pictures(self) -> None:
        """Writes the picture that a key or --screenshot asked for, of what is on the screen."""
        if self.options.screenshot is not None and self._last_frame:
            write_png(self.window.picture(), self.options.screenshot)
        if self.save_picture:
            self.save_picture = False
            path = write_numbered_png(self.window.picture(), self.options.pictures)
            self.say(f"Saved {path}")
