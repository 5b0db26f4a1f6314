"""The film's timeline over the whole lower edge, and the section "Film": its clock, drawing it."""

from collections.abc import Callable
from dataclasses import dataclass

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    button_row,
    choice,
    item_label,
    slider,
    tip,
)
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint, picture_box
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.layout import Box
from shapeshift.app.editor.texts.table import said
from shapeshift.app.film.film_plan import FilmPlan
from shapeshift.app.film.window.rendering import (
    VIDEOS,
    WANT_PYAV,
    ExtraInstall,
    PageShare,
    Rendering,
)
from shapeshift.app.film.window.timeline import CAMERA, STOP, Timeline
from shapeshift.runtime_models.stop_weights import StopWeights, control_text

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


# The timeline and the section.

Vec = imgui.ImVec2
ROW, RULER, NAMES = 22.0, 13.0, 66.0  # logical pixels: rows of keys, seconds above, names beside
SECOND_PX = 44.0  # least between two numbers of the ruler
STEPS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0)
REACH = 8.0  # so near to a key the mouse is on it
RATES = (12.0, 24.0, 25.0, 30.0, 50.0, 60.0)
SIZES = ((640, 360), (1280, 720), (1920, 1080), (1080, 1080), (1080, 1920), (3840, 2160))
LONGEST_S = 120.0
TRACKS = (CAMERA, STOP)
TRACK_NAMES = ("views", "stops")
SECOND_TEXT_PX = 11.0
BUTTON, WORDS = 92.0, 150.0  # logical pixels, of a button and of what is said beside them


@dataclass
class FilmPanel:
    """What timeline and section need; the key that the mouse holds is its own."""

    state: EditorState
    viewpoint: Viewpoint
    preview: Preview
    rendering: Rendering
    held: str = ""  # "playhead", "key", or nothing
    close: Callable[[], None] = lambda: None  # puts the timeline away

    def draw_strip(self, box: Box, ui_scale: float) -> Box:
        """What adds keys, and under it all of the film from the left edge to the right one."""
        left, top, right, low = box
        imgui.set_next_window_pos(Vec(left, top))
        imgui.set_next_window_size(Vec(right - left, low - top))
        flags = imgui.WindowFlags_
        imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
        imgui.begin(
            "##film", None, flags.no_decoration | flags.no_move | flags.no_saved_settings
            | flags.no_focus_on_appearing | flags.no_bring_to_front_on_focus,
        )  # fmt: skip
        self._keys(ui_scale)
        corner, row = imgui.get_cursor_screen_pos(), ROW * ui_scale
        draw, ink = imgui.get_window_draw_list(), theme.color(theme.MUTED)
        line = (row - imgui.get_text_line_height()) / 2
        for number, name in enumerate(TRACK_NAMES):
            y = corner.y + RULER * ui_scale + number * row + line
            draw.add_text(Vec(corner.x, y), ink, said(name))
        imgui.set_cursor_screen_pos(Vec(corner.x + NAMES * ui_scale, corner.y + RULER * ui_scale))
        self._strip(ui_scale)
        imgui.end()
        imgui.pop_style_var()
        return box

    def draw(self, ui_scale: float) -> None:
        """The clock, and the button that draws the film."""
        state, timeline = self.state, self.state.timeline
        if not state.scene.objects:
            imgui.text_disabled(said("There is nothing to film."))
            return
        plan = self.preview.plan
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

        self._seconds(place, corner.y, ui_scale)
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

    def _seconds(self, place: Callable[[float], float], y: float, ui_scale: float) -> None:
        """Numbers of seconds over the tracks, as close as they are legible."""
        draw, all_s = imgui.get_window_draw_list(), self.state.timeline.keys.seconds
        apart = SECOND_PX * ui_scale
        step = next((s for s in STEPS_S if place(s) - place(0.0) >= apart), STEPS_S[-1])
        imgui.push_font(None, SECOND_TEXT_PX * ui_scale)
        for number in range(int(all_s / step + 1e-6) + 1):
            text, x = f"{number * step:g} s", place(number * step)
            room = imgui.calc_text_size(text)
            at = Vec(x - room.x / 2 if number else x - REACH * ui_scale, y - room.y - ui_scale)
            draw.add_text(at, theme.color(theme.MUTED), text)
            draw.add_line(Vec(x, y), Vec(x, y + 3 * ui_scale), theme.color(theme.MUTED))
        imgui.pop_font()

    def _keys(self, ui_scale: float) -> None:
        """What plays, adds and deletes keys, where the playhead is, and the cross."""
        timeline, steps = self.state.timeline, self.viewpoint.steps
        words = said("{now:.2f} of {all:.1f} s", now=timeline.at_s, all=timeline.keys.seconds)
        if timeline.chosen is not None and timeline.chosen[0] == STOP:
            words += f": {timeline.keys.stops[timeline.chosen[1]].word}"
        around = PAST if steps.count > 1 else AROUND
        tips = {
            "Pause" if timeline.playing else "Preview": "Plays it in the window.",
            "Key view": "A key of the camera, as you look now, at the line.",
            "Key stop": "A key of what the slider shows now, at the line.",
            around: "Nine keys of a calm way past the cameras of the scene, or once around it, in "
            "place of the keys of the camera.",
            "Delete key": "The chosen one.",
            "Clear": "Takes all keys away; Ctrl Z brings them back.",
        }
        side, gap = imgui.get_frame_height(), imgui.get_style().item_spacing.x
        start_x, all_room = imgui.get_cursor_pos_x(), imgui.get_content_region_avail().x
        room = all_room - WORDS * ui_scale - side - 2 * gap
        each = min(BUTTON * ui_scale, room / len(tips) - gap)
        clicked, pad = "", 2 * imgui.get_style().frame_padding.x
        for name, what in tips.items():
            wide = max(each, imgui.calc_text_size(said(name)).x + pad)
            if imgui.button(item_label(name), Vec(wide, 0)):
                clicked = name
            tip(what, ui_scale)
            imgui.same_line()
        imgui.text_disabled(words)
        imgui.same_line(start_x + all_room - side)
        if imgui.button("\u00d7", Vec(side, 0)):
            self.close()
        tip("Puts the timeline away; the keys stay.", ui_scale)
        if clicked:
            self._deed(clicked, around)

    def _deed(self, clicked: str, around: str) -> None:
        """What a button of the timeline does."""
        timeline, steps, preview = self.state.timeline, self.viewpoint.steps, self.preview
        if clicked in ("Pause", "Preview"):
            preview.toggle()
        elif clicked == "Key view":
            preview.key_camera()
        elif clicked == "Key stop":
            preview.key_stop()
        elif clicked == around:
            timeline.fill(self.state.document, steps.cameras if steps.count > 1 else None)
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


def draw_page(page: PageShare, state: EditorState, ui_scale: float) -> None:
    """The section "Web page": makes it and opens it, or how far it is."""
    if not state.scene.objects:
        imgui.text_disabled(said("There is nothing to share."))
    elif page.running:
        words, part = page.progress
        imgui.progress_bar(part, Vec(-1, 0), words)
        if imgui.button(item_label("Cancel"), Vec(-1, 0)):
            page.cancel()
    else:
        if imgui.button(item_label("Make the page and open it"), Vec(-1, 0)):
            page.start()
        tip(PAGE_TIP, ui_scale)


PAGE_TIP = (
    "One file with the slider, for any browser, in Shapeshift/exports of your documents. It shows "
    "the scene as it was saved."
)
PAST, AROUND = "Past cameras", "Around"


def draw_film_edge(state: EditorState, viewpoint: Viewpoint, ui_scale: float) -> None:
    """Where the picture of the film ends, while a frame of it is looked at."""
    if viewpoint.flown is None or not state.overlay:
        return
    view = viewpoint.view()
    per_pixel = imgui.get_io().display_size.x / view.size[0]  # logical pixels
    left, top, right, low = (c * per_pixel for c in picture_box(viewpoint.flown, view))
    imgui.get_background_draw_list().add_rect(
        Vec(left, top), Vec(right, low), theme.color(theme.MUTED, 0.6), 0, max(1.0, ui_scale)
    )
