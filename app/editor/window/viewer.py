"""The viewer: a window loop that draws only when something has changed."""

import time
from pathlib import Path

import numpy as np

from shapeshift.app.editor.options import Options
from shapeshift.app.editor.panels.legend_panel import draw_legend
from shapeshift.app.editor.panels.outlines import draw_brush, draw_doubts, draw_outlines, draw_ups
from shapeshift.app.editor.panels.panel import Section, draw_panel
from shapeshift.app.editor.panels.scale_bar import draw_scale_bar
from shapeshift.app.editor.panels.sections.camera_panel import (
    draw_cameras,
    draw_edges,
    draw_kept_views,
)
from shapeshift.app.editor.panels.sections.export_panel import draw_export
from shapeshift.app.editor.panels.sections.objects_panel import draw_objects
from shapeshift.app.editor.panels.sections.plain_sections import plain_sections
from shapeshift.app.editor.panels.slider import draw_slider_bar
from shapeshift.app.editor.panels.status_line import draw_status
from shapeshift.app.editor.state.arrange import poll_bodies
from shapeshift.app.editor.state.camera.camera import FIRST
from shapeshift.app.editor.state.camera.framed import Framed
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.exporting import Exporting
from shapeshift.app.editor.state.files.saving import Saving
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.app.editor.state.layout import Box, Layout, lay_out
from shapeshift.app.editor.state.object_edits import ObjectEdits
from shapeshift.app.editor.state.quality_controller import FLOOR_DB, TARGET_MS, QualityController
from shapeshift.app.editor.state.user.kept_palette import KeptPalette
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.devices.input_devices import InputDevices
from shapeshift.app.editor.window.files import Files, OpenActions
from shapeshift.app.editor.window.gizmo import Gizmo
from shapeshift.app.editor.window.hands import InputActions
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.objects import KEYS as OBJECT_KEYS
from shapeshift.app.editor.window.objects import Adding, Objects
from shapeshift.app.editor.window.parts import attach_parts
from shapeshift.app.editor.window.pictures import write_numbered_png, write_png
from shapeshift.app.editor.window.recovering import Recovering
from shapeshift.app.editor.window.section_handles import attach_sections
from shapeshift.app.editor.window.shell import Shell
from shapeshift.app.editor.window.shown import FrameRequest, Shown
from shapeshift.app.editor.window.touch import attach_touch
from shapeshift.app.editor.window.window import Event, Window
from shapeshift.app.film.window.films import attach_films
from shapeshift.app.inspection.window.attach_inspection import attach_inspection
from shapeshift.app.inspection.window.attach_ruler import attach_ruler
from shapeshift.app.inspection.window.picture_under import Seen
from shapeshift.app.paths import WorkFolders
from shapeshift.renderer.debug.debug import debug_legend
from shapeshift.renderer.gl.context import describe
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.four_views import OVERLAY

WARM_UP = 3  # frames at the start that are drawn anew: the first pays for compilers and caches
SLEEP_S = 0.5  # longest wait for input while nothing moves
POLL_S = 0.03  # the same while a thread works at something that the window waits for
MOST_SLIDERS, LOW_WINDOW = 2, 420.0  # at the lower edge; one in a window lower than so many units
LONGEST_STEP_S = 0.25  # of time that passes at once, after a frame that took long


class Viewer:
    """One window, one renderer, one state, one viewpoint, and the loop that ties them; makes the
    parts, each of which is handed the state that it reads and what it may call.
    """

    def __init__(
        self, window: Window, renderer: Renderer, state: EditorState, options: Options,
        settings: ProgramSettings | None = None, own_files: OwnFiles | None = None,
    ) -> None:  # fmt: skip
        self.window, self.renderer, self.state, self.options = window, renderer, state, options
        state.overlay = options.panel
        self.settings = settings or ProgramSettings()  # state.settings are the picture's
        folders = WorkFolders.of(options.pictures)
        self._pictures = folders.pictures
        self.hooks = Hooks()
        self.shell = Shell(window, self.settings, state.messages, time.perf_counter)
        self.polling = False  # a hook waits for something that is under way
        names = describe(window.ctx) | renderer.backends
        self.readings = FrameStatsView(
            machine={key.replace("_", " "): str(v) for key, v in names.items()},
            drawing=renderer.backends["drawing"],
        )
        self.viewpoint = Viewpoint(state, lambda: window.size, self._free_wanted, self._pictures)
        self.shown, renderer.taker = Shown(renderer, self.readings), window.presented.take_picture
        target_ms, floor_db = options.target_ms or TARGET_MS, options.floor_db or FLOOR_DB
        wanted = (options.target_ms or options.floor_db) is not None
        self.dial = QualityController(target_ms, floor_db, wanted=wanted)
        self.hands = InputActions(window, state, self.viewpoint, self.hooks, self.open_soon)
        self.devices = InputDevices(window, state, self.viewpoint, self.hands, self.hooks)
        self.files = self._attach_files()
        self.objects = self._attach_objects(folders, own_files or OwnFiles())
        self._attach_cameras_and_export(folders)
        more = (self.hooks, folders, self.open_soon, self.shell.actions)
        self.films = attach_films(window, state, self.viewpoint, *more)
        self.touch = attach_touch(window, state, self.viewpoint, self.hands, self.hooks, options)
        self.parts = attach_parts(window, state, self.viewpoint, self.hooks, self.objects)
        self.sections = attach_sections(window, state, self.viewpoint, self.hooks)
        seen = Seen(
            renderer, self.shown.forget, lambda: self._moving, lambda: self.layout,
            lambda: self.settings.temperature,
        )  # fmt: skip
        self.inspecting = attach_inspection(
            window, state, self.viewpoint, self.hooks, self.parts, seen,
            self.objects.saving.save, folders.exports,
        )  # fmt: skip
        self.ruler = attach_ruler(
            window, state, self.viewpoint, self.hooks, self.parts, seen, self.inspecting,
            self.settings, self.shell.keep, self.objects.saving.save, folders.exports,
        )  # fmt: skip
        drawn = (self.shell.draw_settings, self.dial, self.readings)
        self.hooks.sections += plain_sections(state, *drawn)
        kept = KeptPalette(state, self.settings, self.shell.keep)
        self.hooks.opened.append(kept.use)
        self.hooks.each_frame.append(kept.poll)
        self._framed = Framed(self.viewpoint.free_size, self.viewpoint.refit)
        self.hooks.each_frame.append(lambda: self._framed.poll(time.perf_counter()))
        self.hooks.opened.append(self._framed.forget)
        self.hooks.event_handlers.insert(0, self.shell.handle_event)
        self.hooks.asked += [self.files.asked, lambda: state.timeline.problem]
        self._title = ""  # what the window's title says
        self.is_drawn = False  # what the next frame shows, before it began
        self._told: tuple = ()  # what is said and asked, as it was drawn last
        self.frames, self._overlay_ms = 0, 0.0  # drawn since the window opened, of the last one

    def _attach_files(self) -> Files:
        hooks, state = self.hooks, self.state
        actions = OpenActions(
            self.shown.upload, lambda then: self.objects.saving.before_losing(then), self.show_scene
        )
        files = Files(state, self.viewpoint, self.options, actions, self.window.textures)
        hooks.each_frame += [files.poll, lambda: poll_bodies(state)]
        hooks.top.append(files.draw_row)
        hooks.marks.append(files.draw_box)
        hooks.cards.append(files.draw_empty)
        hooks.event_handlers.append(files.handle_event)
        hooks.status.append(lambda: state.bodies.status)
        return files

    def _attach_objects(self, folders: WorkFolders, own_files: OwnFiles) -> Objects:
        """The section, its keys, clicks and boxes; handles see the mouse before all else does."""
        hooks, state, files = self.hooks, self.state, self.files
        edits = ObjectEdits(state, self.viewpoint, self.dial.scene_changed)
        saving = Saving(state, own_files, folders.scenes, files.remember)
        adding = Adding(
            state, self.options, self.shown.upload, self.dial.scene_changed,
            lambda: files.recent.paths if files.recent else (),
        )  # fmt: skip
        self.gizmo = gizmo = Gizmo(state, self.viewpoint, self.window)
        recovering = Recovering(state, saving, self.shown.upload, self.dial.scene_changed)
        objects = Objects(self.window, self.hands, edits, saving, adding, recovering)
        hooks.event_handlers.insert(0, gizmo.handle_event)
        hooks.event_handlers.append(objects.handle_event)
        hooks.marks += [gizmo.draw, objects.draw_boxes]
        hooks.each_frame.append(objects.each_frame)
        hooks.status.append(objects.status)
        hooks.asked.append(objects.asked)
        hooks.opened += [objects.forget, gizmo.release]
        if self.options.screenshot is None:
            hooks.closing.append(objects.may_close)
        hooks.sections.append(
            Section(
                "Objects",
                lambda scale: draw_objects(edits, saving, adding.ask, scale),
                opens=objects.opens,
            )
        )
        hooks.keys["Objects"] = list(OBJECT_KEYS)
        return objects

    def _attach_cameras_and_export(self, folders: WorkFolders) -> None:
        hooks, state, viewpoint = self.hooks, self.state, self.viewpoint
        hooks.status.append(lambda: viewpoint.steps.text)
        hooks.marks.append(lambda scale: draw_edges(state, viewpoint, scale))
        exporting = self.exporting = Exporting(state, viewpoint, folders.exports)
        hooks.sections += [
            Section("Views", lambda scale: draw_cameras(state, viewpoint, scale), open_first=True),
            Section("Export", lambda scale: draw_export(exporting, state, scale)),
            Section("Cameras", lambda scale: draw_kept_views(viewpoint, scale), open_first=True),
        ]
        hooks.each_frame.append(exporting.poll)
        hooks.opened.append(exporting.forget)
        hooks.status.append(exporting.status)

    def loop(self) -> None:
        """Input, time, splats if anything changed, overlay, swap; sleeps while all is still."""
        last = time.perf_counter()
        while not (self.window.closing and self.may_close()):
            if self._told != self._says():
                self.window.note()
            busy = self.busy()
            watched = self.polling or self.devices.connected
            redraw = self.window.wait(0.0 if busy else POLL_S if watched else SLEEP_S)
            now = time.perf_counter()
            if self.window.hidden:  # no time passes either
                last = now
                continue
            seconds = min(now - last, LONGEST_STEP_S) if busy else 0.0
            last = now
            due = self.state.messages.ended(now) or self.idle_work_due(now)
            if busy or redraw or self.polling or due or self.devices.poll():
                self.frame(seconds)
            if self.options.screenshot and self._last_frame:
                return

    def _says(self) -> tuple:
        """All that is said or asked; whoever changes it, the loop sees it and draws."""
        messages, hooks = self.state.messages, self.hooks
        asked, words = (tuple(each() for each in row) for row in (hooks.asked, hooks.status))
        return messages.note, *messages.problems, self.objects.unsaved, asked, words

    def may_close(self) -> bool:
        """Whether nothing would be lost; else the window stays, and a box asks."""
        may = all([asked() for asked in self.hooks.closing])
        if not may:
            self.window.keep_open()
        return may

    def frame(self, seconds: float) -> None:
        """One frame of the window: `seconds` have passed since the last one."""
        start, viewpoint = time.perf_counter(), self.viewpoint
        self.state.messages.ended(start)
        for event in self.window.begin_frame():
            self.handle_event(event)
        self.state.advance(seconds)
        pushed = self.hands.push
        if pushed.any:
            viewpoint.leave_camera()
        viewpoint.camera.step(seconds, pushed)
        viewpoint.steps.advance(seconds)
        self.polling = any([work() for work in self.hooks.each_frame])
        self.set_title()
        viewpoint.follow_overlay(seconds)
        self._turn_dial()
        fresh = self.draw_splats()
        drawn = time.perf_counter()
        self.draw_overlay()
        self.window.end_frame()
        self._overlay_ms = (time.perf_counter() - drawn) * 1e3
        self.frames += 1
        viewpoint.seen = True
        self._save_pictures()
        self.window.swap()
        now = self.readings.now = time.perf_counter()
        if fresh:
            ms = self.readings.meter.note(now, (now - start) * 1e3, self.readings.stats)
            self.dial.seen(ms, self._moving)
        self.readings.idle = not fresh
        if self.files.picture_due is not None and not fresh:
            self.files.keep_picture(self.renderer.resolved(0))

    def handle_event(self, event: Event) -> None:
        """Lets one input event act."""
        self.hands.handle_event(event)

    def open_soon(self, paths: tuple[Path, ...]) -> None:
        """Opens files and folders, scenes or cameras, while the window goes on."""
        self.files.open_soon(paths)

    def busy(self) -> bool:
        """Whether the next frame is due without waiting for input."""
        waiting = self.options.screenshot is not None
        measuring = self.dial.wanted or self.dial.measuring
        first = self.frames < WARM_UP
        return self._moving or waiting or self.viewpoint.sliding or measuring or first

    @property
    def layout(self) -> Layout:
        """Where the parts of the overlay lie now, logical pixels."""
        window, state = self.window, self.state
        size, scale = window.logical_size, window.ui_scale
        state.most_sliders = MOST_SLIDERS if size[1] >= LOW_WINDOW * scale else 1
        rows, wanted = len(state.sliders), self.settings.panel_open
        shown = (wanted, state.overlay, state.split.on, self.hooks.film())
        return lay_out(size, scale, rows, state.has_legend, *shown)

    def _free_wanted(self) -> np.ndarray:
        """(4,) pixels: the part of the window that the overlay leaves free."""
        window = self.window
        return np.array(self.layout.free) * window.size[0] / max(window.logical_size[0], 1)

    def free(self) -> Box:
        """The part of the window that nothing covers, logical pixels."""
        return self.layout.free

    def _request(self) -> FrameRequest:
        """What the screen should show now."""
        state, view, moving = self.state, self.viewpoint.view(), self._moving
        settings = self.dial.while_moving(state.settings) if moving else state.settings
        settings = self.viewpoint.limits(settings)
        shown = state.shown(self.viewpoint.eye_view())
        beside = None if self.dial.measuring else self.hooks.beside(shown, view.size[0])
        return FrameRequest(shown, view, settings, moving or self.dial.measuring, beside)

    @property
    def _moving(self) -> bool:
        by_hand = self.viewpoint.moving or self.hands.push.any or self.devices.moving
        state = self.state
        living = state.world is not None and state.running and not state.world.resting
        return by_hand or state.playing or living

    def idle_work_due(self, now: float) -> bool:
        """Whether the picture has rested so long that its error is to be measured."""
        return self.shown.due(self._request(), now)

    def _turn_dial(self) -> None:
        """Measures a little for the budget where that is wanted, and takes over what it chose."""
        dial, state = self.dial, self.state
        if dial.wanted:
            view = self.viewpoint.view()
            finish = self.window.ctx.finish
            dial.start(self.renderer, state.shown(view), view, state.centre, finish)
        if dial.measuring:
            self.shown.forget()
            if dial.step():
                state.settings = dial.applied(state.settings)

    def draw_splats(self) -> bool:
        """Draws the scene into the window; True when the splats had to be drawn anew."""
        request, now = self._request(), time.perf_counter()
        if self.state.measure_now or self.shown.due(request, now):
            self.state.measure_now = False
            self.shown.measure(request)
        cold = self.frames < WARM_UP and not self.is_drawn
        force, self.is_drawn = self.options.screenshot is not None or cold, False
        screen, presented = self.window.screen(), self.window.presented
        fresh = self.shown.draw(request, screen, force, presented.show_picture_again)
        if not fresh:
            presented.keep_picture()
        for draw in self.hooks.over:
            draw(request)
        if fresh:
            self.readings.stats.ms["overlay"] = self._overlay_ms  # of the frame before
        self.shown.read(request, now)
        return fresh

    def draw_overlay(self) -> None:
        scale, state, layout = self.window.ui_scale, self.state, self.layout
        self._told = self._says()
        self.readings.flying = self.viewpoint.camera.flying
        covered = []
        if not state.save_picture:
            self._draw_marks(scale)
        if state.overlay and layout.status is not None:
            right = state.split.right(state.scene, state.chain) if state.split.on else state.scene
            for scene, box in ((state.scene, layout.left_legend), (right, layout.legend)):
                if box is not None:
                    unit, ends = self.settings.temperature, state.settings.heat_ends
                    draw_scale_bar(scene, box, scale, wanted=unit, ends=ends)
            debug, stats = state.settings.debug, self.readings.stats
            draw_legend(debug_legend(debug, stats), layout.free, scale)
            hooks, words = self.hooks, [words() for words in self.hooks.status]
            covered = [
                draw_panel(
                    state.title, hooks.sections, hooks.top, self.shell.actions, layout, scale
                ),
                draw_slider_bar(state, layout.bar, scale),
                draw_status(state, words, layout.status, scale),
                *([self.films.panel.draw_strip(layout.strip, scale)] if layout.strip else ()),
                *[box for draw in hooks.cards if (box := draw(layout.free, scale)) is not None],
            ]
        if not state.save_picture:  # what is said is no part of a picture
            covered += self.shell.draw(layout.free, self.hooks.keys, scale)
        self.window.covered = tuple(covered)

    def _draw_marks(self, scale: float) -> None:
        """Outlines of the regions, and the brush while there is one."""
        state, window = self.state, self.window
        for draw in self.hooks.marks:
            draw(scale)
        if state.overlay or state.regions.placing:
            draw_outlines(state.regions, state.scene, self.viewpoint.view(), scale)
        if state.overlay and state.shown_scene.show == OVERLAY:
            draw_doubts(state.edited.file, state.scene, self.viewpoint.view(), scale)
        upright, camera = state.edited.file.upright, self.viewpoint.camera
        if state.overlay and upright is not None and camera.framed == FIRST:
            draw_ups(upright, state.centre, self.viewpoint.view(), scale)
        if self.hands.is_painting and window.on_scene:
            erasing = self.hands.is_erasing
            draw_brush(window.cursor, state.regions.brush * scale, erasing, scale)

    def show_scene(self) -> None:
        """The state has another scene: a new camera, and the parts that depend on it hear of it."""
        self.viewpoint.start_anew()
        self.dial.forget()
        for changed in self.hooks.opened:
            changed()
        self.set_title()

    def set_title(self) -> None:
        """The window says what is open, and whether something of it is not saved."""
        mark = "* " if self.objects.unsaved else ""
        name = self.state.title
        title = f"{mark}{name} \u2013 Shapeshift" if name else "Shapeshift"
        if title != self._title:
            self._title = title
            self.window.set_title(title)

    @property
    def _last_frame(self) -> bool:
        """Whether a --screenshot is due: enough frames, the budget has chosen, all is read."""
        measuring = self.dial.wanted or self.dial.measuring
        return self.frames >= self.options.frames and not measuring and not self.polling

    def _save_pictures(self) -> None:
        """Writes the picture that a key or --screenshot asked for, of what is on the screen."""
        if self.options.screenshot is not None and self._last_frame:
            write_png(self.window.picture(), self.options.screenshot)
        if self.state.save_picture:
            self.state.save_picture = False
            path = write_numbered_png(self.window.picture(), self._pictures)
            self.state.say(said("Saved {path}", path=path))
