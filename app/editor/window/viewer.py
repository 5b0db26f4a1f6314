"""The viewer: a window loop that draws only when something has changed."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.editor.panels.legend_panel import draw_legend
from shapeshift.app.editor.panels.outlines import draw_brush, draw_outlines
from shapeshift.app.editor.panels.panel import draw_panel
from shapeshift.app.editor.panels.scale_bar import draw_scale_bar
from shapeshift.app.editor.panels.sections.camera_panel import KeptViews, attach_cameras
from shapeshift.app.editor.panels.sections.export_panel import attach_export
from shapeshift.app.editor.panels.sections.look_panel import draw_look
from shapeshift.app.editor.panels.sections.performance_panel import draw_performance
from shapeshift.app.editor.panels.sections.regions_panel import draw_regions
from shapeshift.app.editor.panels.sections.stops_panel import draw_stops
from shapeshift.app.editor.panels.slider import draw_slider_bar
from shapeshift.app.editor.panels.status_line import draw_status
from shapeshift.app.editor.state.bodies import attach_bodies
from shapeshift.app.editor.state.camera.camera import EVERYTHING, FIRST, SMOOTH_S
from shapeshift.app.editor.state.camera.stepping import Steps
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.app.editor.state.layout import Layout, lay_out
from shapeshift.app.editor.state.quality_controller import FLOOR_DB, TARGET_MS, QualityController
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.editor.state.user.settings import Settings
from shapeshift.app.editor.window.files import Files, first_camera
from shapeshift.app.editor.window.framed import Framed
from shapeshift.app.editor.window.hands import is_erasing, is_painting, push, take
from shapeshift.app.editor.window.hooks import Hooks, Section
from shapeshift.app.editor.window.objects import attach_objects
from shapeshift.app.editor.window.pictures import write_numbered_png, write_png
from shapeshift.app.editor.window.shell import Shell
from shapeshift.app.editor.window.shown import FrameRequest, Shown
from shapeshift.app.editor.window.touch import attach_touch
from shapeshift.app.editor.window.window import Event, Window
from shapeshift.app.paths import WorkFolders
from shapeshift.renderer.debug.debug import debug_legend
from shapeshift.renderer.gl.context import describe
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.app.editor.desktop import Options

WARM_UP = 3  # frames at the start that are drawn anew: the first pays for compilers and caches
SLEEP_S = 0.5  # longest wait for input while nothing moves
POLL_S = 0.03  # the same while a thread works at something that the window waits for
MOST_SLIDERS, LOW_WINDOW = 2, 420.0  # at the lower edge; one in a window lower than so many units
LONGEST_STEP_S = 0.25  # of time that passes at once, after a frame that took long


class Viewer:
    """One window, one renderer, one state, one camera, and the loop that ties them."""

    def __init__(
        self, window: Window, renderer: Renderer, state: EditorState, options: "Options",
        settings: Settings | None = None, own_files: OwnFiles | None = None,
    ) -> None:  # fmt: skip
        self.window, self.renderer, self.state, self.options = window, renderer, state, options
        self.overlay = options.panel
        self.settings = settings or Settings()  # of the program; state.settings are the picture's
        self.messages = state.messages
        self.folders = WorkFolders.of(options.pictures)
        self.own_files = own_files or OwnFiles()
        self.hooks = Hooks()
        self.shell = Shell(window, self.settings, self.messages, time.perf_counter)
        self._polling = False  # a hook waits for something that is under way
        names = describe(window.ctx) | renderer.backends
        self.readings = FrameStatsView(
            machine={key.replace("_", " "): str(v) for key, v in names.items()},
            drawing=renderer.backends["drawing"],
        )
        self._free = self._free_wanted()  # where the picture's middle is; follows the overlay
        self.camera = first_camera(self)
        self.steps = Steps()
        self.kept = KeptViews(self.folders.pictures)
        self.files = Files(self)
        attach_bodies(self)
        self.objects = attach_objects(self)
        attach_cameras(self)
        attach_export(self)
        self.touch = attach_touch(self)
        self.shown = Shown(renderer, self.readings)
        self.dial = QualityController(
            options.target_ms or TARGET_MS,
            options.floor_db or FLOOR_DB,
            wanted=(options.target_ms or options.floor_db) is not None,
        )
        self._add_sections()
        self._framed = Framed(self.free_size, self._refit)
        self.hooks.each_frame.append(lambda: self._framed.poll(time.perf_counter()))
        self.hooks.opened.append(self._framed.forget)
        self.hooks.takes.insert(0, self.shell.take)
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
            due = self.messages.ended(now) or self._idle_work_due(now)
            if busy or redraw or self._polling or due:
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
        self.messages.ended(start)
        for event in self.window.begin_frame():
            self.take(event)
        self.state.advance(seconds)
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

    def say(self, text: str, seconds: float | None = None) -> None:
        """Shows a note for a few seconds, longer for more lines; "" takes it away."""
        self.messages.say(text, time.perf_counter(), seconds)

    def _add_sections(self) -> None:
        """What of the panel needs no more than the state and what was measured."""
        state, dial, readings = self.state, self.dial, self.readings
        asked = dial.wanted
        self.hooks.sections += [
            Section("Stops", lambda scale: draw_stops(state, scale), open_first=True),
            Section("Look", lambda scale: draw_look(state, scale), open_first=True),
            Section(
                "Regions",
                lambda scale: draw_regions(state, scale),
                open_first=bool(state.regions.items),
            ),
            Section(
                "Performance",
                lambda scale: draw_performance(state, dial, readings, scale),
                open_first=asked,
            ),
        ]

    def _busy(self) -> bool:
        """Whether the next frame is due without waiting for input."""
        waiting = self.options.screenshot is not None
        sliding = not np.array_equal(self._free, self._free_wanted())
        measuring = self.dial.wanted or self.dial.measuring
        first = self.frames < WARM_UP
        return self._moving or waiting or sliding or measuring or first

    @property
    def layout(self) -> Layout:
        """Where the parts of the overlay lie now, logical pixels."""
        window, state = self.window, self.state
        size, scale = window.logical_size, window.ui_scale
        state.most_sliders = MOST_SLIDERS if size[1] >= LOW_WINDOW * scale else 1
        rows, wanted = len(state.sliders), self.settings.panel_open
        both = state.split.on
        return lay_out(size, scale, rows, state.has_legend, wanted, self.overlay, both)

    def _free_wanted(self) -> np.ndarray:
        """(4,) pixels: the part of the window that the overlay leaves free."""
        window = self.window
        return np.array(self.layout.free) * window.size[0] / max(window.logical_size[0], 1)

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

    def _refit(self, size: tuple[int, int]) -> None:
        """The free part has another size: what no hand has moved is fitted into it."""
        if self.steps.standing:
            return
        if self.camera.framed == FIRST and self.state.first_look.home is None:
            self.camera.come_home(self.state.first_view(size))
        elif self.camera.framed == EVERYTHING:
            distance = self.state.fit(self.view(), self.camera.fov_y, size)
            self.camera.frame(self.state.centre, distance)

    def free_size(self) -> tuple[int, int]:
        left, top, right, bottom = self._free_wanted()
        return int(right - left), int(bottom - top)

    def _request(self) -> FrameRequest:
        """What the screen should show now."""
        state, view, moving = self.state, self.view(), self._moving
        settings = self.dial.while_moving(state.settings) if moving else state.settings
        return FrameRequest(state.shown(view), view, settings, moving or self.dial.measuring)

    @property
    def _moving(self) -> bool:
        by_hand = self.camera.moving or push(self.window).any
        state = self.state
        living = state.running and not state.world.resting
        return by_hand or self.steps.moving or state.playing or living

    def _idle_work_due(self, now: float) -> bool:
        """Whether the picture has rested so long that its error is to be measured."""
        return self.shown.due(self._request(), now)

    def _turn_dial(self) -> None:
        """Measures a little for the budget where that is wanted, and takes over what it chose."""
        dial, state = self.dial, self.state
        if dial.wanted:
            view = self.view()
            finish = self.window.ctx.finish
            dial.start(self.renderer, state.shown(view), view, state.centre, finish)
        if dial.measuring:
            self.shown.forget()
            if dial.step():
                state.settings = dial.applied(state.settings)

    def _draw_splats(self) -> bool:
        """Draws the scene into the window; True when the splats had to be drawn anew."""
        request, now = self._request(), time.perf_counter()
        if self.state.measure_now or self.shown.due(request, now):
            self.state.measure_now = False
            self.shown.measure(request)
        force = self.options.screenshot is not None or self.frames < WARM_UP
        fresh = self.shown.draw(request, self.window.screen(), force)
        for draw in self.hooks.over:
            draw(request)
        if fresh:
            self.readings.stats.ms["overlay"] = self._overlay_ms  # of the frame before
        self.shown.read(request, now)
        return fresh

    def _draw_overlay(self) -> None:
        scale, state, layout = self.window.ui_scale, self.state, self.layout
        self.readings.flying = self.camera.flying
        covered = []
        if not self.save_picture:
            self._draw_marks(scale)
        if self.overlay:
            right = state.split.right(state.scene) if state.split.on else state.scene
            for scene, box in ((state.scene, layout.left_legend), (right, layout.legend)):
                if box is not None:
                    draw_scale_bar(scene, box, scale)
            debug, stats = state.settings.debug, self.readings.stats
            draw_legend(debug_legend(debug, stats), layout.free, scale)
            hooks, words = self.hooks, [words() for words in self.hooks.status]
            covered = [
                draw_panel(
                    state.title, hooks.sections, hooks.top, self.shell.actions, layout, scale
                ),
                draw_slider_bar(state, layout.bar, scale),
                draw_status(state, words, layout.status, scale),
                *[box for draw in hooks.cards if (box := draw(layout.free, scale)) is not None],
            ]
        if not self.save_picture:  # what is said is no part of a picture
            covered += self.shell.draw(layout.free, self.hooks.keys, scale)
        self.window.covered = tuple(covered)

    def _draw_marks(self, scale: float) -> None:
        """Outlines of the regions, and the brush while there is one."""
        state, window = self.state, self.window
        for draw in self.hooks.marks:
            draw(scale)
        if self.overlay or state.regions.placing:
            draw_outlines(state.regions, state.scene, self.view(), scale)
        if is_painting(self) and window.on_scene:
            draw_brush(window.cursor, state.regions.brush * scale, is_erasing(self), scale)

    def show_scene(self) -> None:
        """The state has another scene: a new camera, and whoever depends on it is told."""
        self.camera = first_camera(self)
        self.steps.leave()
        self.dial.forget()
        for changed in self.hooks.opened:
            changed()
        self.set_title()

    def set_title(self) -> None:
        mark = "* " if self.objects.unsaved else ""
        name = self.state.title
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
            path = write_numbered_png(self.window.picture(), self.folders.pictures)
            self.say(f"Saved {path}")
