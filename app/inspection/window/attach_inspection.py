"""Adds the tool "Inspect" to the viewer: its section, keys, marks over the picture, reports."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import glfw
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.scale_bar import handle_at, has_scale, share_at
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.window import (
    CLICK_PIXELS,
    DoubleClick,
    Drag,
    Drop,
    Event,
    KeyDown,
    Press,
    Release,
    Window,
)
from shapeshift.app.inspection.draw_values import draw_values
from shapeshift.app.inspection.inspect_view import first_photo, inspect_view
from shapeshift.app.inspection.window.inspect_panel import InspectActions, draw_inspect
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.app.inspection.window.marks_over import (
    MarkLabel,
    alarm_layer,
    draw_labels,
    draw_mark,
    draw_rubber,
    draw_words,
    label_words,
    plate_size,
    words_of,
)
from shapeshift.app.inspection.window.picture_under import PictureUnder, Seen
from shapeshift.app.inspection.window.view_report import write_view_report
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.marks import Kind

REPORT_PX = 1280  # longer side of a report's pictures


def attach_inspection(
    window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks, parts: PartsTool,
    seen: Seen, save: Callable[[], object], folder: Path,
) -> Inspecting:  # fmt: skip
    """Adds it to the hooks; save: all that is not saved; folder: of reports."""
    tool = Inspecting(state)
    mouse = MouseMarks(tool, state, window, viewpoint, parts, seen)
    reports = Reports(tool, state, viewpoint, seen, folder)
    actions = InspectActions(mouse.toggle, tool.auto, save, reports.write)
    hooks.event_handlers.insert(1, mouse.handle_event)  # handles in the picture see it before
    hooks.each_frame.append(mouse.each_frame)
    hooks.marks.append(mouse.draw)
    hooks.opened.append(mouse.forget)
    hooks.status.append(mouse.status)
    hooks.sections.append(
        Section(
            "Inspect",
            lambda scale: draw_inspect(tool, actions, seen.unit(), scale),
            opens=mouse.opens,
            shown=lambda: state.has_legend,
        )
    )
    hooks.keys["Inspect"] = list(KEYS)
    tool.opened()
    return tool


@dataclass
class Reports:
    """Reports of what is seen, one HTML file each, never over another."""

    tool: Inspecting
    state: EditorState
    viewpoint: Viewpoint
    seen: Seen
    folder: Path

    def write(self) -> None:
        """The view of now with all its marks."""
        tool, state, measured = self.tool, self.state, self.tool.measured
        if measured is None:
            return
        document, view = tool.document, self.viewpoint.view()
        part = min(1.0, REPORT_PX / max(view.size))
        width, height = (max(round(side * part), 1) for side in view.size)
        renderer = self.seen.renderer
        renderer.settings = RenderSettings(background=state.settings.background)
        photo = first_photo(document, measured)
        try:
            view = replace(view, size=(width, height))
            inspected = inspect_view(renderer, document, measured, photo, view)
            path = write_view_report(tool, measured, state.title, inspected, self.folder)
        except (BadFile, ValueError, OSError) as error:
            state.problem = said("No report was written: {error}", error=error)
            return
        finally:
            self.seen.forget()
        state.say(said("Saved {path}", path=path))


# The mouse and the keys of the tool "Inspect", and when a view is measured.

KEYS = (
    ("Y", "lay marks, on and off"),
    ("click, drag", "a spot, a box; right drag orbits"),
    ("Shift+drag", "a line on the surface"),
    ("Ctrl+drag", "a circle about a place"),
    ("Delete", "delete the chosen mark"),
    ("Esc", "choose no mark, leave"),
    ("scale", "drag a handle: an end of the palette"),
)
PHOTOS = (".jpg", ".jpeg", ".png")  # that are dropped onto the window while a mark is chosen


class MouseMarks:
    """What hands do to an `Inspecting`, and what it has over the picture."""

    def __init__(
        self, tool: Inspecting, state: EditorState, window: Window, viewpoint: Viewpoint,
        parts: PartsTool, seen: Seen,
    ) -> None:  # fmt: skip
        self._tool, self._state, self._window = tool, state, window
        self._viewpoint, self._parts, self._seen = viewpoint, parts, seen
        self._under = PictureUnder(window, viewpoint, seen)
        self._handle: int | None = None  # of the scale, that the mouse holds
        self._pressed: tuple[float, float] | None = None  # logical pixels
        self._end: tuple[float, float] | None = None  # of a drag; None: still a click
        self._kind: Kind = "box"  # that a drag lays
        self._measured: tuple = ()  # key of what was measured last
        self._models: tuple = ()  # of that: no other gets the id of one of them
        self._cursor = window.cursor  # where the mouse was looked up last
        self._layer: tuple = (None, (), np.zeros((1, 1, 4), np.uint8))
        self._was_on = False

    # ---- input

    def handle_event(self, event: Event) -> bool:
        """True for what concerns the tool, its key and the handles of the scale."""
        if self._tool.measured is None:
            return False
        if isinstance(event, KeyDown):
            return not self._window.popup_open and self._press_key(event)
        if self._drags_handle(event):
            return True
        if not self._tool.on:
            return False
        match event:
            case Press(button="left"):
                held = self._window.held
                shift = held(glfw.KEY_LEFT_SHIFT) or held(glfw.KEY_RIGHT_SHIFT)
                ctrl = held(glfw.KEY_LEFT_CONTROL) or held(glfw.KEY_RIGHT_CONTROL)
                self._kind = "line" if shift else "circle" if ctrl else "box"
                self._pressed, self._end = (event.x, event.y), None
            case Drag(button="left") if self._pressed is not None:
                x, y = self._pressed
                if self._end or abs(event.x - x) + abs(event.y - y) > CLICK_PIXELS:
                    self._end = (event.x, event.y)
            case Release(button="left") if self._pressed is not None:
                self._let_go(self._pressed, self._end)
                self._pressed = self._end = None
            case Drag(button="right"):
                self._under.turn(event)
            case DoubleClick():
                pass  # two clicks: the camera stays
            case Drop(paths=(path,)) if self._tool.chosen and path.suffix.lower() in PHOTOS:
                self._tool.attach_photo(self._tool.chosen, path)
            case _:
                return False
        return True

    def _press_key(self, event: KeyDown) -> bool:
        tool = self._tool
        match event.key:
            # A key is named after a US keyboard; on a German one Y is printed on its Z.
            case glfw.KEY_Y | glfw.KEY_Z if not event.ctrl:
                self.toggle()
            case glfw.KEY_DELETE if tool.on and tool.chosen:
                tool.delete(tool.chosen)
            case glfw.KEY_ESCAPE if tool.on and self._pressed is not None:
                self._pressed = self._end = None
            case glfw.KEY_ESCAPE if tool.on and tool.chosen:
                tool.chosen = ""
            case glfw.KEY_ESCAPE if tool.on:
                tool.on = False
            case _:
                return False
        return True

    def toggle(self) -> None:
        """The tool, in the place of another that has the mouse."""
        self._tool.on = not self._tool.on
        self._pressed = self._end = None
        if self._tool.on and self._parts.on:
            self._parts.toggle()

    def opens(self) -> bool:
        """Once when the tool is taken: its section unfolds."""
        opened, self._was_on = self._tool.on and not self._was_on, self._tool.on
        return opened

    def _drags_handle(self, event: Event) -> bool:
        state, layout = self._state, self._seen.layout()
        box, scale = layout.legend, self._window.ui_scale
        if box is None or not has_scale(state.scene):
            self._handle = None
            return False
        match event:
            case Press(button="left"):
                ends = state.settings.heat_ends
                self._handle = handle_at(event.x, event.y, box, ends, scale)
                return self._handle is not None
            case Drag(button="left") if self._handle is not None:
                low, high = self._tool.value_range
                first, last = self._tool.ends
                here = low + share_at(event.y, box, scale) * (high - low)
                self._tool.ends = (first, here) if self._handle else (here, last)
                return True
            case Release(button="left") if self._handle is not None:
                self._handle = None
                return True
        return False

    def _let_go(self, start: tuple[float, float], end: tuple[float, float] | None) -> None:
        """A click chooses the mark that is there, else lays a spot; a drag lays a box or a line."""
        tool = self._tool
        under = self._mark_at(start) if end is None else ""
        if under:
            tool.chosen = under
            return
        self._measure()
        kind: Kind = self._kind if end is not None else "spot"
        tool.lay(kind, self._under.pixel(start), self._under.pixel(end or start))

    def _mark_at(self, place: tuple[float, float]) -> str:
        """The name of a mark whose middle is seen there, logical pixels; "": none is."""
        marks = self._tool.file.marks
        if not marks or self._tool.picture is None:
            return ""
        places = np.array([mark.place for mark in marks])
        number = self._under.point_at(self._tool.picture, places, place)
        return "" if number is None else marks[number].name

    # ---- frames

    def each_frame(self) -> bool:
        """Measures the view once it is still; True while that is waited for.

        A window in which nothing moves, the mouse neither, measures nothing.
        """
        tool, state = self._tool, self._state
        if self._parts.on:
            tool.on = False
        if not state.has_legend or tool.measured is None:
            return False
        key = self._seen_now()
        still = self._under.is_still(key)
        tool.is_current = self._measured == key
        cursor, on_scene = self._window.cursor, self._window.on_scene
        moved, self._cursor = cursor != self._cursor, cursor
        shows = state.overlay and on_scene and has_scale(state.scene)
        asks = tool.on or bool(tool.file.marks or tool.file.isotherms) or (shows and moved)
        waits = asks and not tool.is_current and not self._seen.moving()
        if waits and still:
            self._measure()
            waits = False
        pointing = tool.is_current and on_scene and (tool.on or shows)
        tool.point(self._under.pixel(cursor) if pointing else None)
        if waits and shows:
            self._cursor = (-1.0, -1.0)  # it has moved: asked until it is answered
        return waits

    def _seen_now(self) -> tuple:
        """What values and depths depend on; not on x."""
        view, objects = self._viewpoint.view(), self._state.scene.objects
        poses = tuple((o.world_from_object.matrix().tobytes(), o.visible) for o in objects)
        eye = view.world_from_eye.matrix().tobytes()
        return eye, view.tangents, view.size, poses, tuple(id(o.model) for o in objects)

    def _measure(self) -> None:
        """Values and depths of what is seen now, unless they are there."""
        tool, measured, key = self._tool, self._tool.measured, self._seen_now()
        if measured is None or (self._measured == key and tool.picture is not None):
            return
        self._measured = key
        self._models = tuple(obj.model for obj in self._state.scene.objects)
        try:
            tool.saw(self._under.draw(lambda renderer, view: draw_values(renderer, measured, view)))
        except BadFile as error:
            tool.on = False
            self._state.problem = str(error)

    def forget(self) -> None:
        """Another scene."""
        self._measured, self._handle, self._pressed, self._end = (), None, None, None
        self._tool.opened()

    def status(self) -> str:
        """For the line at the lower edge."""
        if self._tool.on:
            return said("click: a spot, drag: a box, Shift+drag: a line")
        return ""

    def draw(self, ui_scale: float) -> None:
        """Alarms, marks, and what lies under the mouse."""
        tool, state = self._tool, self._state
        if not state.overlay or tool.measured is None:
            return
        if tool.is_current and tool.picture is not None and tool.file.isotherms:
            self._draw_alarms()
        view, unit = self._under.logical_view(), self._seen.unit()
        labels: list[MarkLabel | None] = []
        for mark in tool.file.marks:
            reading = tool.readings.get(mark.name)
            if not tool.is_current and mark.laid is None:  # it has a value in a still view alone
                reading = None
            words = label_words(mark, reading, tool.picture, unit, tool.is_current)
            chosen = mark.name == tool.chosen
            labels.append(draw_mark(mark, reading, view, words, chosen, ui_scale))
        draw_labels([each for each in labels if each is not None], view.size)
        if self._pressed is not None and self._end is not None:
            draw_rubber(self._kind, self._pressed, self._end)
        self._draw_pointed(ui_scale)

    def _draw_pointed(self, ui_scale: float) -> None:
        """Degrees and metres under the mouse, on a plate at it, inside of the window."""
        tool, box = self._tool, self._seen.layout().legend
        if not tool.is_current or tool.picture is None or not self._window.on_scene:
            return
        if not (tool.on or (box is not None and has_scale(self._state.scene))):
            return
        (x, y), (value, depth) = self._window.cursor, tool.pointed
        ends = tool.picture.ends_at(self._under.pixel((x, y)))
        words = words_of(value, tool.picture, self._seen.unit(), ends)
        if np.isfinite(value):
            words += f"  {depth * tool.file.metres_per_unit:.2f} m"
        (width, height), (wide, high) = self._window.logical_size, plate_size(words)
        beside = 14 * ui_scale
        left = x + beside if x + beside + wide <= width else x - beside - wide
        top = y + beside if y + beside + high <= height else y - beside - high
        draw_words(words, (left, top))

    def _draw_alarms(self) -> None:
        picture, isotherms = self._tool.picture, self._tool.file.isotherms
        assert picture is not None  # draw has seen to it
        if self._layer[0] is not picture or self._layer[1] != isotherms:
            self._layer = (picture, isotherms, alarm_layer(picture, isotherms))
        reference = self._window.textures.reference("alarms", self._layer[2])
        width, height = self._window.logical_size
        corner, end = imgui.ImVec2(0, 0), imgui.ImVec2(width, height)
        imgui.get_background_draw_list().add_image(reference, corner, end)
