"""The panel of a headset with its scene: the editor's own sections, pointed at with a ray."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from imgui_bundle import imgui

from shapeshift.app.editor.panels.messages_panel import draw_note
from shapeshift.app.editor.panels.panel import Section, draw_sections, in_order
from shapeshift.app.editor.panels.scale_bar import has_scale
from shapeshift.app.editor.panels.sections.objects_panel import draw_object_list
from shapeshift.app.editor.panels.sections.parts_panel import draw_parts
from shapeshift.app.editor.panels.sections.plain_sections import draw_look
from shapeshift.app.editor.panels.sections.stops_panel import draw_stops
from shapeshift.app.editor.panels.sections.touch_panel import draw_touch
from shapeshift.app.editor.panels.slider import track_ends
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import item_label, subsection
from shapeshift.app.editor.state.arrange import steer_by_hand
from shapeshift.app.editor.state.files.saving import unsaved
from shapeshift.app.editor.state.object_edits import ObjectEdits
from shapeshift.app.editor.state.track import ON_STOP, shown_words
from shapeshift.app.editor.texts.table import said
from shapeshift.app.film.window.gallery import Gallery
from shapeshift.app.film.window.gallery_panel import draw_gallery
from shapeshift.app.film.window.style_work import StyleWork
from shapeshift.app.headset.over.glass_state import stop_names
from shapeshift.app.headset.panel_picture import PANEL, UI_SCALE, PanelPicture
from shapeshift.app.headset.save_start import save_scene
from shapeshift.app.headset.scene_shelf import SceneShelf
from shapeshift.app.headset.sections.comfort_section import (
    draw_comfort,
    draw_foveation,
    draw_see_through,
    lit_button,
)
from shapeshift.app.headset.sections.performance_section import draw_figures
from shapeshift.app.headset.sections.room_section import (
    Foot,
    RoomActions,
    SceneActions,
    draw_head,
    draw_help,
    draw_room,
    draw_scale,
    draw_scenes,
    tool_sections,
)
from shapeshift.app.headset.session.recorder import Recorder
from shapeshift.app.headset.worn_journal import WornJournal
from shapeshift.app.headset.xr_user import XrState
from shapeshift.app.paths import WorkFolders
from shapeshift.vr.frame import Frame
from shapeshift.vr.panel import (
    MIDDLE,
    NOBODY,
    Carried,
    Palm,
    Place,
    carry,
    left_over,
    scroll,
    slide,
)
from shapeshift.vr.play_space import resized

TICK = (0.25, 0.012)  # strength and seconds of the buzz when something is pointed at
CLICK = (0.6, 0.025)  # when it is pressed, and when the knob comes to a stop
SURE = "This is not saved. Choose it again to leave; it is offered when you come back."
SETTLE_FRAMES = 4  # after a change: what it changes in turn, and ImGui's own fading
Vec = imgui.ImVec2


@dataclass(frozen=True)
class MenuActions:
    """What the menu asks of the session that it is in."""

    recentre: Callable[[Frame], None]
    leave: Callable[[str], None]  # why
    pulse: Callable[[str, float, float], None]  # side, strength, seconds
    shelf: SceneShelf = field(default_factory=SceneShelf)
    picture: Callable[[], None] = lambda: None  # the next frame is one
    start_here: Callable[[Frame], None] = lambda frame: None
    recorder: Recorder | None = None
    journal: WornJournal | None = None


class WristMenu:
    """Keeps the panel between frames; `carried` is where it is, `picture` what is on it."""

    def __init__(self, state: XrState, actions: MenuActions, picture: PanelPicture) -> None:
        self._state, self._actions, self.picture = state, actions, picture
        self.shelf = actions.shelf
        self.carried = Carried(PANEL, home=state.worn.now.carries)
        self._frame: Frame | None = None  # that is under way
        self._seconds = 0.0
        self._held: dict[str, str | None] = {}
        room = RoomActions(self._recentre, self._resize, lambda: actions.leave("from the panel"))
        self._foot = Foot(room)
        self.gallery = Gallery(state.editor)
        self.styles = StyleWork(state.editor, WorkFolders.of().scenes)
        self._sections = self._make_sections(room)
        self._key: tuple = ()  # what the picture was drawn of
        self._unsettled = 0
        self._sure_of: Path | None = None  # chosen though work would be lost by it
        self._figures_seen = False  # the section of the figures is unfolded

    def _make_sections(self, room: RoomActions) -> list[Section]:
        """The headset's own, and those of the desktop's panel that need no keys and no window."""
        state, editor = self._state, self._state.editor
        objects = ObjectEdits(editor, None, lambda: None)
        scenes = SceneActions(
            self._open, self._start_here, self._actions.picture, self._record, self._recording
        )

        def draw_objects(scale: float) -> None:
            draw_object_list(objects, scale)
            draw_parts(state.parts, scale)

        def draw_looks(scale: float) -> None:
            draw_glass(state)  # first: looks are long, and it is the headset's own
            draw_look(editor, scale)

        left: list[Section] = []
        if (journal := self._actions.journal) is not None:
            offers = lambda: journal.offers  # noqa: E731
            left = [Section("Unsaved work", journal.draw, open_first=True, shown=offers)]
        return [
            *left,
            Section("Room", lambda scale: draw_room(state, room), open_first=True),
            Section(
                "Scale",
                lambda scale: draw_scale(editor, scale),
                open_first=True,
                shown=lambda: has_scale(editor.scene),
            ),
            Section("Touch", lambda scale: draw_touch(state.touch, scale, False), open_first=True),
            Section("Stops", lambda scale: draw_stops(editor, scale)),
            Section("Gallery", self._draw_gallery, shown=lambda: bool(editor.scene.objects)),
            Section("Look", draw_looks),
            Section("Objects", draw_objects),
            Section("Performance", self._draw_figures),
            Section("Scenes", lambda scale: self._draw_scenes(scenes, scale)),
            Section("Comfort", self._draw_comfort),
            Section("Help", lambda scale: draw_help()),
            *tool_sections(state.tools, self._save),
        ]

    def act(self, frame: Frame, seconds: float) -> Frame:
        """What hands do to the panel; the frame with what it leaves of them."""
        self._frame, self._seconds = frame, seconds
        self._follow_hands()
        self._follow_settings()
        self.gallery.each_frame()
        self.styles.poll()
        carried = self.carried = carry(self.carried, frame, seconds)
        if carried.open:
            notches = self._push_sticks(frame, seconds)
            self._draw(notches, seconds)
        else:
            self._foot.sure_s, self._key = 0.0, ()
        return replace(frame, hands=left_over(self.carried, frame.hands))

    def _push_sticks(self, frame: Frame, seconds: float) -> float:
        """The carrying hand's stick slides; returns the notches that the other one scrolls."""
        carried, editor = self.carried, self._state.editor
        sticks = dict(carried.sticks)
        home, other = carried.home, carried.pointer
        before = sticks.get(home, MIDDLE)
        if editor.sliders and not carried.pointing.pressing:
            index = editor.sliders[0]
            x = editor.scene.objects[index].slider_x
            stick = frame.hands[home].stick
            sticks[home], moved = slide(before, stick, x, editor.stops(index), seconds)
            if moved != x:
                steer_by_hand(editor, index, moved)
                self._pulse_at_stop(home, index)
        does, notches = scroll(
            sticks.get(other, MIDDLE), frame.hands[other].stick, carried.on_panel, seconds
        )
        sticks[other] = does
        self.carried = replace(carried, sticks=sticks)
        return notches

    def _draw(self, notches: float, seconds: float) -> None:
        """Only while something changes, or a hand is on it."""
        pointing, picture = self.carried.pointing, self.picture
        key = self._shown()
        if self.carried.on_panel or notches or key != self._key:
            self._key, self._unsettled = key, SETTLE_FRAMES
        if self._unsettled == 0:
            return
        self._unsettled -= 1
        editor, side = self._state.editor, self.carried.pointer
        before = picture.hovered, picture.active
        xs = [obj.slider_x for obj in editor.scene.objects]
        picture.draw(self._fill, pointing, notches, seconds)
        if picture.active and not before[1] and before[0]:
            self._actions.pulse(side, *CLICK)
        elif picture.hovered not in (0, before[0]) and not picture.active:
            self._actions.pulse(side, *TICK)
        for index, (obj, x) in enumerate(zip(editor.scene.objects, xs, strict=False)):
            if picture.active and obj.slider_x != x:
                self._pulse_at_stop(side, index)

    def _shown(self) -> tuple:
        """What the panel tells; equal as long as its picture is right."""
        state, editor = self._state, self._state.editor
        objects = tuple((t.name, t.visible, t.slider_x) for t in editor.scene.objects)
        playing = tuple(sweep.playing for sweep in editor.sweeps)
        return (
            objects, playing, editor.chosen, editor.palette, editor.settings.debug,
            editor.settings.background, tuple(editor.messages.problems),
            tuple(state.touch.reactions), editor.shown_scene.show, editor.shown_scene.lit is None,
            state.parts.on, state.parts.count, state.parts.factor,
            state.world.paused, state.pacing.quality, state.play_space.scale, state.floor_shown,
            self._foot.sure_s > 0, editor.messages.note, self.gallery.shown, self.styles.progress,
            state.figures if self._figures_seen else None, state.worn.now,
            self.shelf.opening, self.shelf.shown, self._recording(), state.glass.stop,
            state.tools.key(),
            self._actions.journal is not None and self._actions.journal.offers,
        )  # fmt: skip

    def _fill(self) -> None:
        """All of the panel: its head and foot stay, the sections between them scroll."""
        flags, style = imgui.WindowFlags_, imgui.get_style()
        imgui.set_next_window_pos(Vec(0, 0))
        imgui.set_next_window_size(Vec(*PANEL.size))
        still = flags.no_decoration | flags.no_move | flags.no_saved_settings
        imgui.begin("##panel", None, still | flags.no_scroll_with_mouse)
        self._figures_seen = False
        draw_head(self._state.editor, UI_SCALE)
        foot = imgui.get_frame_height() + style.item_spacing.y
        imgui.begin_child("sections", Vec(0, -foot))
        draw_sections(in_order(self._sections), UI_SCALE)
        imgui.end_child()
        self._foot.draw(self._seconds)
        imgui.end()
        if note := self._state.editor.messages.note:
            width, height = PANEL.size
            imgui.push_style_color(imgui.Col_.window_bg, imgui.ImVec4(*theme.RAISED, 1))
            draw_note(note, Vec(width / 2, height / 2), 0.94 * width)
            imgui.pop_style_color()

    def _draw_gallery(self, scale: float) -> None:
        draw_gallery(self.gallery, self.styles, self.picture.textures, scale)

    def _draw_comfort(self, _: float) -> None:
        state = self._state
        draw_comfort(state.worn.now, self._choose)
        draw_foveation(state.worn.now, state.has_insets, state.offers_insets, self._choose)
        draw_see_through(state.through, state.sees_through, self._choose)

    def _draw_scenes(self, actions: SceneActions, scale: float) -> None:
        draw_scenes(self.shelf, actions, self.picture.textures, scale)

    def _open(self, path: Path) -> None:
        """Another scene; where work would be lost, once it has been chosen twice."""
        messages = self._state.editor.messages
        if unsaved(self._state.editor) and path != self._sure_of:
            self._sure_of = path
            messages.say(said(SURE), time.perf_counter())
            return
        self.shelf.open(path)

    def _start_here(self) -> None:
        if self._frame is not None:
            self._actions.start_here(self._frame)

    def _save(self) -> None:
        if save_scene(self._state.editor):
            self.shelf.remember(self._state.editor.edited.path)

    def _record(self) -> None:
        if self._actions.recorder is not None:
            self._actions.recorder.toggle(self._state.editor.messages, time.perf_counter())

    def _recording(self) -> bool:
        return self._actions.recorder is not None and self._actions.recorder.recording

    def _draw_figures(self, _: float) -> None:
        self._figures_seen = True
        draw_figures(self._state.figures)

    def _recentre(self) -> None:
        if self._frame is not None:
            self._actions.recentre(self._frame)

    def _resize(self, scale: float) -> None:
        state = self._state
        if self._frame is not None:
            state.play_space = resized(state.play_space, self._frame.head, scale)
            state.user.jumped()

    def _pulse_at_stop(self, side: str, index: int) -> None:
        editor = self._state.editor
        x = editor.scene.objects[index].slider_x
        if any(abs(stop.x - x) <= ON_STOP for stop in editor.stops(index)):
            self._actions.pulse(side, *CLICK)

    def _choose(self, **values: Any) -> None:
        """A setting of the section Comfort, which stays."""
        try:
            self._state.worn.choose(**values)
        except OSError as why:
            self._state.editor.messages.fail(said("The settings cannot be kept: {why}.", why=why))

    def _follow_settings(self) -> None:
        """The panel is at the hand, and as large, as the settings have it."""
        worn, carried = self._state.worn.now, self.carried
        plane = replace(PANEL, metres_per_pixel=PANEL.metres_per_pixel * worn.text_size)
        if plane != carried.plane:
            self.carried = carried = replace(carried, plane=plane)
        if worn.carries != carried.home:
            self.carried = replace(
                carried, home=worn.carries, pinned=carried.open, palm=Palm(), pointing=NOBODY,
                play_from_panel=None, sticks={},
            )  # fmt: skip

    def _follow_hands(self) -> None:
        """The slider of what a hand takes is the one that is shown."""
        held, editor = dict(self._state.user.touched.held), self._state.editor
        names = {editor.scene.objects[index].name for index in editor.movable}
        for side, name in held.items():
            if name is not None and name in names and self._held.get(side) != name:
                editor.chosen = name
        self._held = held

    def row(self) -> dict:
        """What a line of a report says of the panel: which stop is shown, and where in the room,
        (3,) metres, its knob, the ends of its slider and the middles of its items are.
        """
        carried, editor = self.carried, self._state.editor
        obj, shown = None, ""
        for index in editor.sliders[:1]:
            obj = editor.scene.objects[index]
            shown = shown_words(editor.stops(index), obj.x, obj.slider_x)
        side = carried.home if carried.open else ""
        row: dict = {"open": carried.open, "hand": side, "shown": shown}
        pose = carried.play_from_panel
        if pose is None:
            return row

        def place(at: Place) -> list[float]:
            return [round(float(number), 6) for number in carried.plane.play_point(pose, at)]

        boxes = dict(self.picture.boxes)
        row["object"] = obj.name if obj is not None else ""
        row["taken"] = [carried.pointer] if carried.taken else []
        box = boxes.pop("track", None)
        if obj is not None and box is not None:
            first, last = track_ends(box, theme.FONT_SIZE * UI_SCALE)
            along = first[0] + obj.slider_x * (last[0] - first[0])
            row["knob"] = place((along, first[1]))
            row["slider"] = [place(first), place(last)]
        row["buttons"] = {
            name: place(((left + right) / 2, (top + bottom) / 2))
            for name, (left, top, right, bottom) in boxes.items()
        }
        return row


# Of the panel's section "Look": which stop is seen through a round glass in the hand.

COLUMNS = 3
NONE, HELP = "no glass", "It is in the hand of the panel once the panel is closed."


def draw_glass(state: XrState) -> None:
    """A button for no glass and one for each stop, lit where it is chosen."""
    names = stop_names(state.editor)
    if not names or not subsection("Glass", bool(state.glass.stop)):
        return
    glass, gap = state.glass, imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap * (COLUMNS - 1)) / COLUMNS
    imgui.push_id("glass")
    if lit_button(item_label(NONE), not glass.stop, width):
        glass.stop = ""
    for number, name in enumerate(names, 1):
        if number % COLUMNS:
            imgui.same_line()
        if lit_button(f"{name}###glass {number}", glass.stop == name, width):
            glass.stop = name
    imgui.pop_id()
    if glass.stop:
        imgui.push_text_wrap_pos(0)
        imgui.text_disabled(said(HELP))
        imgui.pop_text_wrap_pos()
