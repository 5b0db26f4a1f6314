"""Films in the window: the sections Film and Gallery, and files of paths that are dropped."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from imgui_bundle import imgui

from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    button_row,
    choice,
    item_label,
    slider,
    tip,
)
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.window import Drop, Event, Window
from shapeshift.app.errors import UsageError
from shapeshift.app.film.film_plan import FilmPlan
from shapeshift.app.film.window.gallery import Gallery
from shapeshift.app.film.window.gallery_panel import draw_gallery
from shapeshift.app.film.window.rendering import (
    VIDEOS,
    WANT_PYAV,
    ExtraInstall,
    Rendering,
    origin_on_disk,
)
from shapeshift.app.film.window.style_work import StyleWork
from shapeshift.app.film.window.timeline import CAMERA, STOP, Timeline
from shapeshift.app.paths import WorkFolders
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_weights import StopWeights, control_text
from shapeshift.scene.film.film_path import is_film_file, read_film_file

# The film of the timeline in the window, while it plays or its playhead is dragged.


class Preview:
    """Shows the frame under the playhead; whoever moves the camera or a slider leaves it."""

    def __init__(self, state: EditorState, viewpoint: Viewpoint) -> None:
        self._state, self._viewpoint = state, viewpoint
        self._shown: tuple | None = None  # the keys and the playhead that are on the screen

    @property
    def timeline(self) -> Timeline:
        return self._state.timeline

    @property
    def plan(self) -> FilmPlan | None:
        return self.timeline.plan(self._state.document)

    def toggle(self) -> None:
        """Plays from the playhead on, or stops there."""
        timeline = self.timeline
        timeline.playing = not timeline.playing and self.plan is not None
        if timeline.playing and timeline.at_s >= timeline.keys.seconds:
            timeline.at_s = 0.0

    def show(self) -> None:
        """Puts the frame under the playhead on the screen."""
        plan, state = self.plan, self._state
        if plan is None:
            return
        number = self.timeline.frame(plan)
        self._viewpoint.fly(plan.view(number))
        for index, (path, control) in enumerate(
            zip(plan.paths, plan.controls(number), strict=True)
        ):
            if path is not None and index < len(state.scene.objects):
                state.sweeps[index].playing = False
                state.set_x(index, control)

    def each_frame(self) -> bool:
        """Goes on with what plays; a hand on the camera ends it."""
        timeline = self.timeline
        if not timeline.playing:
            return False
        if self._shown is not None and self._viewpoint.flown is None:
            timeline.playing, self._shown = False, None
            return False
        timeline.advance(self._state.seconds)
        self.show()
        self._shown = (timeline.keys, timeline.at_s)
        return True

    def key_camera(self) -> None:
        """The view of now at the playhead."""
        self.timeline.add_camera(self._viewpoint.plain_view())

    def key_stop(self) -> None:
        """What the first slider's object shows now, at the playhead."""
        state = self._state
        if state.sliders:
            index = state.sliders[0]
            self.timeline.add_stop(self.word(index))

    def word(self, index: int) -> str:
        """What an object shows now, as a style path says it."""
        control = self._state.scene.objects[index].x
        if not isinstance(control, StopWeights):
            for stop in self._state.stops(index):
                if abs(stop.x - control) < 1e-6:
                    return stop.name
        return control_text(control)


class Films:
    """The parts of films that a viewer has."""

    def __init__(
        self, window: Window, state: EditorState, viewpoint: Viewpoint, folders: WorkFolders,
        open_soon: Callable[[tuple[Path, ...]], None],
    ) -> None:  # fmt: skip
        self._state = state
        folder = folders.pictures.parent / "films"
        self.styles = StyleWork(state, folders.scenes, lambda path: open_soon((path,)))
        self.preview = Preview(state, viewpoint)
        self.rendering = Rendering(state, folder)
        self.gallery = Gallery(state)
        self.panel = FilmPanel(state, viewpoint, self.preview, self.rendering)
        self._textures = window.textures

    def draw_gallery(self, ui_scale: float) -> None:
        draw_gallery(self.gallery, self.styles, self._textures, ui_scale)

    def each_frame(self) -> bool:
        """What plays, is drawn or is waited for; True while there is such."""
        playing = self.preview.each_frame()
        children = [self.rendering.poll(), self.rendering.pyav.poll(), self.styles.poll()]
        return any([playing, *children, self.gallery.each_frame()])

    def handle_event(self, event: Event) -> bool:
        """True for a film that is dropped."""
        if not isinstance(event, Drop) or len(event.paths) != 1:
            return False
        if not is_film_file(event.paths[0]):
            return False
        self.open(event.paths[0])
        return True

    def open(self, path: Path) -> None:
        """Takes the keys of a film file over; it can be undone."""
        state = self._state
        try:
            film = read_film_file(path)
            state.timeline.take_over(film, origin_on_disk(state))
        except (BadFile, UsageError, OSError) as error:
            state.problem = str(error)
        else:
            state.say(said("The keys of {name} are in the section Film.", name=path.name))


def attach_films(
    window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks, folders: WorkFolders,
    open_soon: Callable[[tuple[Path, ...]], None],
) -> Films:  # fmt: skip
    """Adds both sections to a viewer; `open_soon` opens what was made."""
    films = Films(window, state, viewpoint, folders, open_soon)
    hooks.sections += [
        Section("Gallery", films.draw_gallery, shown=lambda: bool(state.scene.objects)),
        Section("Film", films.panel.draw),
    ]
    hooks.each_frame.append(films.each_frame)
    hooks.event_handlers.append(films.handle_event)
    hooks.marks.append(lambda scale: draw_film_edge(state, viewpoint, scale))
    hooks.opened.append(films.gallery.forget)
    hooks.status += [films.rendering.status, films.styles.status]
    return films


# The section "Film": a timeline of cameras and stops, its preview, and drawing it.

Vec = imgui.ImVec2
ROW = 22.0  # logical pixels of a row of keys
REACH = 8.0  # so near to a key the mouse is on it
RATES = (12.0, 24.0, 25.0, 30.0, 50.0, 60.0)
SIZES = ((640, 360), (1280, 720), (1920, 1080), (1080, 1080), (1080, 1920), (3840, 2160))
LONGEST_S = 120.0
TRACKS = (CAMERA, STOP)


@dataclass
class FilmPanel:
    """What the section needs; the key that the mouse holds is its own."""

    state: EditorState
    viewpoint: Viewpoint
    preview: Preview
    rendering: Rendering
    held: str = ""  # "playhead", "key", or nothing

    def draw(self, ui_scale: float) -> None:
        """The timeline, what adds keys, the clock, and the button that draws the film."""
        state, timeline = self.state, self.state.timeline
        if not state.scene.objects:
            imgui.text_disabled(said("There is nothing to film."))
            return
        self._strip(ui_scale)
        plan = self.preview.plan
        self._keys(ui_scale)
        self._clock(timeline, ui_scale)
        if timeline.problem:
            imgui.text_wrapped(timeline.problem)
        if plan is None and not timeline.problem:
            imgui.push_text_wrap_pos(0)
            imgui.text_disabled(said("Key a view, or begin with a way around the scene."))
            imgui.pop_text_wrap_pos()
        if plan is not None:
            self._render(ui_scale)

    def _strip(self, ui_scale: float) -> None:
        """Seconds from left to right, a row of cameras, a row of stops, and the playhead."""
        timeline, high = self.state.timeline, 2 * ROW * ui_scale
        corner, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        imgui.invisible_button("timeline", Vec(width, high))
        tip(
            "Cameras above, stops below. Drag a key to another time, or the line to look at the "
            "film; a click on a key chooses it.",
            ui_scale,
        )
        pad = REACH * ui_scale
        span, seconds = max(width - 2 * pad, 1.0), timeline.keys.seconds
        mouse = imgui.get_mouse_pos()
        at_s = min(max((mouse.x - corner.x - pad) / span, 0.0), 1.0) * seconds
        row = TRACKS[int(mouse.y > corner.y + high / 2)]
        if imgui.is_item_activated():
            self._grab(timeline, row, at_s, pad / span * seconds)
        if imgui.is_item_active():
            if self.held == "key" and timeline.chosen is not None:
                if imgui.is_mouse_dragging(0):
                    timeline.move(*timeline.chosen, at_s)
            elif timeline.at_s != at_s or imgui.is_item_activated():
                timeline.at_s, timeline.playing = at_s, False
                self.preview.show()
        else:
            self.held = ""
        self._paint(timeline, corner, width, ui_scale)

    def _grab(self, timeline: Timeline, track: str, at_s: float, reach_s: float) -> None:
        """What a press takes: a key, or the playhead."""
        times = timeline.keys.times(track)
        near = [n for n, t in enumerate(times) if abs(t - at_s) <= reach_s]
        self.held = "key" if near else "playhead"
        timeline.chosen = None
        if near:
            number = min(near, key=lambda n: abs(times[n] - at_s))
            timeline.chosen = (track, number)
            timeline.at_s, timeline.playing = times[number], False
            self.preview.show()

    def _paint(
        self, timeline: Timeline, corner: imgui.ImVec2, width: float, ui_scale: float
    ) -> None:
        drawing, pad, row = imgui.get_window_draw_list(), REACH * ui_scale, ROW * ui_scale
        end = Vec(corner.x + width, corner.y + 2 * row)
        drawing.add_rect_filled(corner, end, theme.color(theme.RAISED), 3 * ui_scale)
        span, keys = max(width - 2 * pad, 1.0), timeline.keys

        def place(at_s: float) -> float:
            return corner.x + pad + span * at_s / keys.seconds

        drawing.push_clip_rect(corner, end, True)
        for number, track in enumerate(TRACKS):
            middle = corner.y + (number + 0.5) * row
            times = keys.times(track)
            if len(times) > 1:
                line = theme.color(theme.MUTED, 0.6)
                drawing.add_line(Vec(place(times[0]), middle), Vec(place(times[-1]), middle), line)
            for which, at_s in enumerate(times):
                lit = timeline.chosen == (track, which)
                ink = theme.color(theme.ACCENT if lit else theme.TEXT)
                x, r = place(at_s), 4.5 * ui_scale
                drawing.add_quad_filled(
                    Vec(x - r, middle), Vec(x, middle - r), Vec(x + r, middle), Vec(x, middle + r),
                    ink,
                )  # fmt: skip
        x = place(timeline.at_s)
        ink = theme.color(theme.ACCENT)
        drawing.add_line(Vec(x, corner.y), Vec(x, end.y), ink, max(1.5, 1.5 * ui_scale))
        drawing.pop_clip_rect()

    def _keys(self, ui_scale: float) -> None:
        """Where the playhead is, playing, and keys."""
        timeline, steps = self.state.timeline, self.viewpoint.steps
        words = said("{now:.2f} of {all:.1f} s", now=timeline.at_s, all=timeline.keys.seconds)
        if timeline.chosen is not None and timeline.chosen[0] == STOP:
            words += f": {timeline.keys.stops[timeline.chosen[1]].word}"
        imgui.text_disabled(words)
        tips = {
            "Pause" if timeline.playing else "Preview": "Plays it in the window.",
            "Key view": "A key of the camera, as you look now, at the line.",
            "Key stop": "A key of what the slider shows now, at the line.",
        }
        deeds = {
            "Pause": self.preview.toggle,
            "Preview": self.preview.toggle,
            "Key view": self.preview.key_camera,
            "Key stop": self.preview.key_stop,
        }
        if clicked := button_row(tips, ui_scale, 3):
            deeds[clicked]()
        around = PAST if steps.count > 1 else AROUND
        tips = {
            around: "Nine keys of a calm way past the cameras of the scene, or once around it, in "
            "place of the keys of the camera.",
            "Delete key": "The chosen one.",
            "Clear": "Takes all keys away; Ctrl Z brings them back.",
        }
        if clicked := button_row(tips, ui_scale, 3):
            if clicked == around:
                cameras = steps.cameras if steps.count > 1 else None
                timeline.fill(self.state.document, cameras)
            elif clicked == "Clear":
                timeline.clear()
            elif not timeline.delete():
                self.state.say(said("Choose a key first: click on it."))

    def _clock(self, timeline: Timeline, ui_scale: float) -> None:
        keys = timeline.keys
        imgui.push_item_width(-1)
        seconds = slider("length", keys.seconds, 1.0, LONGEST_S, "length: %.1f s")
        tip("Keys stay at their parts of it.", ui_scale)
        rates = RATES if keys.fps in RATES else (*RATES, keys.fps)
        fps = choice(
            "rate", keys.fps, rates, [said("{rate:g} frames a second", rate=r) for r in rates]
        )
        tip("24 as in the cinema, 30 as on the web.", ui_scale)
        sizes = SIZES if keys.size in SIZES else (*SIZES, keys.size)
        size = choice("picture", keys.size, sizes, [f"{w} x {h}" for w, h in sizes])
        tip("Pixels of the film; the line in the preview is its edge.", ui_scale)
        imgui.pop_item_width()
        if (seconds, fps, size) != (keys.seconds, keys.fps, keys.size):
            timeline.set_clock(seconds, fps, size)

    def _render(self, ui_scale: float) -> None:
        rendering = self.rendering
        if rendering.running:
            words, part = rendering.progress
            imgui.progress_bar(part, Vec(-1, 0), words)
            if imgui.button(item_label("Cancel"), Vec(-1, 0)):
                rendering.cancel()
            tip("Its frames stay, and the same command goes on with them.", ui_scale)
            return
        imgui.push_item_width(-1)
        rendering.ending = choice("ending", rendering.ending, VIDEOS, VIDEOS)
        tip(".mp4 and .webm want PyAV, an optional part; .webp and .gif go without.", ui_scale)
        imgui.pop_item_width()
        if rendering.ending in WANT_PYAV and rendering.pyav.missing:
            self._install(rendering.pyav, ui_scale)
            return
        tips = {
            "Render": "Draws it beside the window, which goes on.",
            "Save path": "Keeps the keys as NAME.film.json, for `film --cameras` and to drop here.",
        }
        clicked = button_row(tips, ui_scale, 2)
        if clicked == "Render":
            rendering.start()
        elif clicked:
            rendering.save_path()

    def _install(self, pyav: ExtraInstall, ui_scale: float) -> None:
        if pyav.running:
            words, part = pyav.progress
            imgui.progress_bar(part, Vec(-1, 0), words)
            if imgui.button(item_label("Cancel"), Vec(-1, 0)):
                pyav.cancel()
            return
        words = said("Install ({size} MB)", size=pyav.megabytes)
        if imgui.button(f"{words}##install", Vec(-1, 0)):
            pyav.start()
        tip("Puts PyAV beside the program; the window goes on.", ui_scale)


PAST, AROUND = "Past cameras", "Around"


def draw_film_edge(state: EditorState, viewpoint: Viewpoint, ui_scale: float) -> None:
    """Where the picture of the film ends, while a frame of it is looked at."""
    from shapeshift.app.editor.state.camera.viewpoint import picture_box

    if viewpoint.flown is None or not state.overlay:
        return
    view = viewpoint.view()
    per_pixel = imgui.get_io().display_size.x / view.size[0]  # logical pixels
    left, top, right, low = (c * per_pixel for c in picture_box(viewpoint.flown, view))
    imgui.get_background_draw_list().add_rect(
        Vec(left, top), Vec(right, low), theme.color(theme.MUTED, 0.6), 0, max(1.0, ui_scale)
    )
