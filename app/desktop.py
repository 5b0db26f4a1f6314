"""The viewer: a window loop that draws only when something has changed."""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import glfw
import numpy as np
import tyro

from app.controls import FAST, SLOW, SMOOTH_S, Camera, Push
from app.drawing import make_folder, parse_size, save_png
from app.errors import UsageError
from app.panel import Readings, draw_note, draw_panel, draw_problem, free_area
from app.scale_bar import draw_scale_bar
from app.slider import draw_slider_bar
from app.stage import Stage
from app.window import DoubleClick, Drag, Drop, Event, KeyDown, Wheel, Window
from renderer.context import describe
from renderer.renderer import Renderer
from runtime_models.model import BadFile
from runtime_models.read_scene import read_model
from scene.pose import View

DEMO = Path(__file__).resolve().parents[1] / "assets" / "workshop.shift"
TURN = 0.006  # radians a logical pixel of mouse movement
LOOK = 0.003
WARM_UP = 3  # frames at the start that are drawn anew: the first pays for compilers and caches
NOTE_S = 3.0  # how long a note stays
SLEEP_S = 0.5  # longest wait for input while nothing moves
LONGEST_STEP_S = 0.25  # of time that passes at once, after a frame that took long


@dataclass(frozen=True)
class Options:
    scenes: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Packages, .shift, .ply or .splat files, or folders of PLY layers; none: the bundled demo."""
    x: float | None = None
    """Control value to start at, 0..1; without it the first stop."""
    size: str = "1280x720"
    """Of the window, WxH in pixels."""
    drawing: Literal["auto", "quads", "tiles"] = "auto"
    """Back end that draws the splats: OpenGL quads, or OpenCL tiles where there is no GPU."""
    pictures: Path = Path("pictures")
    """Folder for the pictures that P saves."""
    screenshot: Path | None = None
    """Write a picture of the whole window here after --frames frames, and end."""
    frames: int = 3
    """How many frames to draw before the --screenshot."""
    panel: Annotated[bool, tyro.conf.arg(help="Show the overlay; H switches it.")] = True


def run(options: Options) -> int:
    """Opens the window and stays until it is closed; 0.  Errors for people say why not."""
    size = parse_size(options.size)
    if options.x is not None and not 0 <= options.x <= 1:
        raise UsageError(f"--x is {options.x}, expected 0 to 1.")
    if options.frames < 1:
        raise UsageError(f"--frames is {options.frames}, expected 1 or more.")
    stage = Stage(read_model)
    stage.open(options.scenes or (DEMO,), options.x)
    with Window("Shapeshift", size) as window:
        with Renderer(window.ctx, drawing=options.drawing) as renderer:
            Viewer(window, renderer, stage, options).loop()
    return 0


class Viewer:
    """One window, one renderer, one stage, one camera, and the loop that ties them."""

    def __init__(self, window: Window, renderer: Renderer, stage: Stage, options: Options) -> None:
        self.window, self.renderer, self.stage, self.options = window, renderer, stage, options
        self.overlay = options.panel
        names = describe(window.ctx) | renderer.backends
        self.readings = Readings(
            machine={key.replace("_", " "): str(v) for key, v in names.items()}
        )
        self._free = self._free_wanted()  # where the picture's middle is; follows the overlay
        self.camera = self._first_camera()
        self._drawn: tuple | None = None  # what the splats on screen were drawn from
        self._note_until = 0.0
        self._wanted: Drop | None = None  # files to be opened once the note about them is seen
        self._frames = 0
        self._overlay_ms = 0.0
        self._save_picture = False

    def loop(self) -> None:
        """Input, time, splats if anything changed, overlay, swap; sleeps while all is still."""
        last = time.perf_counter()
        while not self.window.closing:
            busy = self._busy()
            redraw = self.window.wait(0.0 if busy else SLEEP_S)
            now = time.perf_counter()
            if self.window.minimised:
                last = now
                time.sleep(0.05)
                continue
            seconds = min(now - last, LONGEST_STEP_S) if busy else 0.0
            last = now
            if busy or redraw or self._note_ends(now):
                self.frame(seconds)
            if self.options.screenshot and self._frames >= self.options.frames:
                return

    def frame(self, seconds: float) -> None:
        """One frame of the window: `seconds` have passed since the last one."""
        start = time.perf_counter()
        for event in self.window.begin_frame():
            self.take(event)
        self.stage.advance(seconds)
        self.camera.step(seconds, self._push())
        self._follow_overlay(seconds)
        fresh = self._draw_splats()
        drawn = time.perf_counter()
        self._draw_overlay()
        self.window.end_frame()
        self._overlay_ms = (time.perf_counter() - drawn) * 1e3
        self._frames += 1
        self._save_pictures()
        self.window.swap()
        if fresh:
            self.readings.frame_ms = (time.perf_counter() - start) * 1e3
        self.readings.idle = not fresh
        if self._wanted and self._frames > 1:
            self._open_wanted()

    def take(self, event: Event) -> None:
        """Lets one input event act."""
        width, height = self.window.logical_size
        match event:
            case KeyDown():
                self._key(event)
            case Drag(button="middle") | Drag(button="right") if self._pans(event):
                self.camera.pan(-event.dx / height, event.dy / height)
            case Drag():
                rate = LOOK if self.camera.flying else TURN
                self.camera.turn(-event.dx * rate, -event.dy * rate)
            case Wheel():
                self.camera.dolly(event.notches)
            case DoubleClick():
                self._focus(event.x / width, event.y / height)
            case Drop():
                self._wanted = event
                self.say(f"Opening {', '.join(path.name for path in event.paths)} \u2026")

    def say(self, text: str) -> None:
        """Shows a note for a few seconds."""
        self.readings.note = text
        self._note_until = time.perf_counter() + NOTE_S

    def _busy(self) -> bool:
        """Whether the next frame is due without waiting for input."""
        moving = self.camera.moving or self._push().any
        waiting = self._wanted is not None or self.options.screenshot is not None
        sliding = not np.array_equal(self._free, self._free_wanted())
        return moving or waiting or sliding or self.stage.playing or self._frames < WARM_UP

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
        if np.abs(self._free - wanted).max() < 0.5 or self._frames == 0:
            self._free = wanted

    def _view(self) -> View:
        return self.camera.view(self.window.size, tuple(self._free))

    def _free_size(self) -> tuple[int, int]:
        left, top, right, bottom = self._free_wanted()
        return int(right - left), int(bottom - top)

    def _note_ends(self, now: float) -> bool:
        """True once when the note's time is over; it is taken away then."""
        over = bool(self.readings.note) and now >= self._note_until
        if over:
            self.readings.note = ""
        return over

    def _first_camera(self) -> Camera:
        view = self.stage.first_view(self._free_size())
        return Camera(view, self.stage.centre, self.stage.radius)

    def _pans(self, drag: Drag) -> bool:
        return drag.button == "middle" or not self.camera.flying

    def _push(self) -> Push:
        """The movement keys that are held now."""
        held = self.window.held
        fast = held(glfw.KEY_LEFT_SHIFT) or held(glfw.KEY_RIGHT_SHIFT)
        slow = held(glfw.KEY_LEFT_CONTROL) or held(glfw.KEY_RIGHT_CONTROL)
        return Push(
            right=held(glfw.KEY_D) - held(glfw.KEY_A),
            up=held(glfw.KEY_E) - held(glfw.KEY_Q),
            forward=held(glfw.KEY_W) - held(glfw.KEY_S),
            pace=FAST if fast else SLOW if slow else 1.0,
        )

    def _key(self, event: KeyDown) -> None:
        """Keys that act once; the held ones are asked for in `_push`."""
        stage, camera = self.stage, self.camera
        match event.key:
            case glfw.KEY_V:
                camera.toggle_flying()
            case glfw.KEY_F if event.shift:
                camera.reset()
            case glfw.KEY_F:
                distance = stage.fit(self._view(), camera.fov_y, self._free_size())
                camera.frame(stage.centre, distance)
            case glfw.KEY_SPACE:
                stage.toggle_play()
            case glfw.KEY_H | glfw.KEY_TAB:
                self.overlay = not self.overlay
            case glfw.KEY_P | glfw.KEY_F12:
                self._save_picture = True
            case key if glfw.KEY_1 <= key <= glfw.KEY_9:
                stage.go_to_stop(key - glfw.KEY_1)

    def _focus(self, across: float, down: float) -> None:
        """Centres what lies under a place of the picture, both in 0..1 from the top left."""
        view = self._view()
        left, right, low, high = view.tangents
        in_eye = np.array([left + (right - left) * across, high + (low - high) * down, -1.0])
        world_from_eye = view.world_from_eye.matrix()
        point = self.stage.point_under(world_from_eye[:3, 3], world_from_eye[:3, :3] @ in_eye)
        if point is not None:
            self.camera.focus(point)

    def _draw_splats(self) -> bool:
        """Draws the scene into the window; True when the splats had to be drawn anew."""
        view = self._view()
        pose, settings = view.world_from_eye, self.stage.settings
        quality = replace(settings, background=(0.0, 0.0, 0.0))  # the background needs no splats
        wanted = (
            self.stage.scene, pose.position.tobytes(), pose.wxyz.tobytes(), view.tangents,
            view.size, quality,
        )  # fmt: skip
        self.renderer.settings = settings
        fresh = self._drawn != wanted or self.options.screenshot is not None
        fresh = fresh or self._frames < WARM_UP
        if fresh:
            self.renderer.update(self.stage.scene)
            self.readings.stats = self.renderer.draw([view], self.window.screen())
            self.readings.stats.ms["overlay"] = self._overlay_ms  # of the frame before
            self._drawn = wanted
        else:
            self.renderer.present(self.window.screen())
        return fresh

    def _draw_overlay(self) -> None:
        scale = self.window.ui_scale
        self.readings.flying = self.camera.flying
        covered = []
        if self.overlay:
            draw_scale_bar(self.stage.scene, scale)
            left = free_area(self.window.logical_size, len(self.stage.sliders), scale)[0]
            covered = [
                draw_panel(self.stage, self.readings, scale),
                draw_slider_bar(self.stage, left, scale),
            ]
        if not self._save_picture:  # a note is no part of a picture
            draw_note(self.readings.note, scale)
        draw_problem(self.stage, scale)
        self.window.covered = tuple(covered)

    def _open_wanted(self) -> None:
        """Opens the dropped files; after a bad one the old scene is still there."""
        wanted, self._wanted = self._wanted, None
        before = self.stage.scene
        if self.stage.drop(wanted.paths):
            try:
                self.renderer.update(self.stage.scene)
            except BadFile as error:
                self.stage.problem = str(error)
                self.stage.show(before)
        self.readings.note = ""
        if self.stage.scene is not before:
            self.camera = self._first_camera()
            self.window.set_title(f"Shapeshift \u2013 {wanted.paths[0].name}")

    def _save_pictures(self) -> None:
        """Writes the picture that a key or --screenshot asked for, of what is on the screen."""
        last = self._frames >= self.options.frames
        if self.options.screenshot is not None and last:
            write_png(self.window.picture(), self.options.screenshot)
        if self._save_picture:
            self._save_picture = False
            path = write_numbered_png(self.window.picture(), self.options.pictures)
            self.say(f"Saved {path}")


def write_png(picture: np.ndarray, path: Path) -> None:
    """Writes (H, W, 3) uint8 whole or not at all, with the folder that it needs."""
    make_folder(path.parent)
    save_png(picture / 255, path)


def write_numbered_png(picture: np.ndarray, folder: Path) -> Path:
    """Writes shapeshift-0001.png or the next free number; never over a file that is there."""
    make_folder(folder)
    number = 1
    while True:
        path = folder / f"shapeshift-{number:04}.png"
        try:
            path.touch(exist_ok=False)  # claims the name, also against another viewer
        except FileExistsError:
            number += 1
            continue
        write_png(picture, path)
        return path
