"""Adds the tool "Measure" to the viewer: its section, keys, lines over the picture, reports."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import glfw
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.drawing import make_folder
from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.window import (
    CLICK_PIXELS,
    DoubleClick,
    Drag,
    Event,
    KeyDown,
    Press,
    Release,
    Window,
)
from shapeshift.app.inspection.draw_values import depth_picture
from shapeshift.app.inspection.inspect_view import length_words
from shapeshift.app.inspection.length_report import SeenLengths, length_report
from shapeshift.app.inspection.report_pdf import write_report
from shapeshift.app.inspection.window.attach_inspection import REPORT_PX
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.app.inspection.window.marks_over import NOWHERE, draw_words
from shapeshift.app.inspection.window.picture_under import PictureUnder, Seen
from shapeshift.app.inspection.window.ruler import Ruler
from shapeshift.app.inspection.window.ruler_panel import RulerActions, draw_ruler
from shapeshift.app.inspection.window.view_report import free_path
from shapeshift.app.paths import file_name
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.lengths import UNITS
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View


def attach_ruler(
    window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks, parts: PartsTool,
    seen: Seen, inspecting: Inspecting, settings: ProgramSettings, keep: Callable[[], None],
    save: Callable[[], object], folder: Path,
) -> Ruler:  # fmt: skip
    """Adds it to the hooks, after the tool "Inspect".  keep: writes the settings; save:
    all that is not saved; folder: of reports.
    """

    def unit() -> str:
        return settings.lengths if settings.lengths in UNITS else "m"

    def choose_unit(name: str) -> None:
        settings.lengths = name
        keep()

    ruler = Ruler(inspecting)
    mouse = MouseRuler(ruler, inspecting, state, window, viewpoint, parts, seen, unit)
    reports = LengthReports(inspecting, state, viewpoint, seen, unit, folder)
    actions = RulerActions(mouse.toggle, save, reports.write, unit, choose_unit)
    hooks.event_handlers.insert(1, mouse.handle_event)
    hooks.each_frame.append(mouse.each_frame)
    hooks.marks.append(mouse.draw)
    hooks.opened.append(mouse.forget)
    hooks.status.append(mouse.status)
    hooks.sections.append(
        Section("Measure", lambda scale: draw_ruler(ruler, actions, scale), opens=mouse.opens)
    )
    hooks.keys["Measure"] = list(KEYS)
    return ruler


@dataclass
class LengthReports:
    """Reports of what was measured in what is seen, one HTML file each, never over another."""

    inspecting: Inspecting
    state: EditorState
    viewpoint: Viewpoint
    seen: Seen
    unit: Callable[[], str]
    folder: Path

    def write(self) -> None:
        """The view of now with all lengths."""
        state, inspecting, view = self.state, self.inspecting, self.viewpoint.view()
        part = min(1.0, REPORT_PX / max(view.size))
        width, height = (max(round(side * part), 1) for side in view.size)
        view = replace(view, size=(width, height))
        renderer = self.seen.renderer
        renderer.settings = RenderSettings(background=state.settings.background)
        try:
            renderer.update(state.scene)
            renderer.draw([view])
            picture = renderer.resolved(0).copy()
            scene = (inspecting.source or Path(state.title)).name
            measured = length_words(inspecting.file, self.unit())
            seen = SeenLengths(picture, view, measured, inspecting.file.scale)
            report = length_report(state.title, scene, seen, inspecting.document.origin)
            make_folder(self.folder)
            path = free_path(self.folder, file_name(state.title))
            write_report(report, path)
        except (BadFile, ValueError, OSError) as error:
            state.problem = said("No report was written: {error}", error=error)
            return
        finally:
            self.seen.forget()
        state.say(said("Saved {path}", path=path))


# The mouse and the keys of the tool "Measure", and when the depths of a view are drawn.

KEYS = (
    ("Shift+Y", "measure lengths, on and off"),
    ("click", "a point on the surface; a drag orbits"),
    ("Enter", "end a way or an area; a double click, too"),
    ("Ctrl+Z", "take the last point back"),
    ("Delete", "delete what is chosen"),
    ("Esc", "lay no more points, leave"),
)
OPEN_KINDS = ("polyline", "area")  # of as many points as somebody wants
Y_OR_Z = (glfw.KEY_Y, glfw.KEY_Z)  # a German keyboard has the one in the other's place


class MouseRuler:
    """What hands do to a `Ruler`, and what it has over the picture."""

    def __init__(
        self, ruler: Ruler, inspecting: Inspecting, state: EditorState, window: Window,
        viewpoint: Viewpoint, parts: PartsTool, seen: Seen, unit: Callable[[], str],
    ) -> None:  # fmt: skip
        self._ruler, self._inspecting, self._state = ruler, inspecting, state
        self._window, self._viewpoint, self._parts, self._seen = window, viewpoint, parts, seen
        self._unit, self._under = unit, PictureUnder(window, viewpoint, seen)
        self._pressed: tuple[float, float] | None = None  # logical pixels
        self._drags = False
        self._drawn: tuple = ()  # key of what the ruler's picture is of
        self._scene: object = None  # of that: no other gets its id
        self._was_on = False

    # ---- input

    def handle_event(self, event: Event) -> bool:
        """True for what concerns the tool: clicks, not what moves the camera."""
        if isinstance(event, KeyDown):
            return not self._window.popup_open and self._press_key(event)
        if not self._ruler.on:
            return False
        match event:
            case Press(button="left"):
                self._pressed, self._drags = (event.x, event.y), False
            case Drag(button="left") if self._pressed is not None:
                x, y = self._pressed
                self._drags |= abs(event.x - x) + abs(event.y - y) > CLICK_PIXELS
                if self._drags:
                    self._under.turn(event)
            case Release(button="left") if self._pressed is not None:
                place, self._pressed = self._pressed, None
                if not self._drags:
                    self._click(place)
            case DoubleClick():  # comes between the second press and its release
                self._pressed = None
                if self._ruler.kind in OPEN_KINDS:
                    self._ruler.finish()
            case _:
                return False
        return True

    def _click(self, place: tuple[float, float]) -> None:
        """A point; in the place of the first one an area is closed, of the last one a way ends."""
        ruler = self._ruler
        self.measure()
        if len(ruler.points) > 1 and ruler.kind in OPEN_KINDS:
            end = ruler.points[-1 if ruler.kind == "polyline" else 0].metres
            picture = ruler.picture
            if picture is not None and self._under.point_at(picture, end[None], place) == 0:
                ruler.finish()
                return
        ruler.pick(self._under.pixel(place))

    def _press_key(self, event: KeyDown) -> bool:
        ruler = self._ruler
        match event.key:
            case key if key in Y_OR_Z and event.shift and not event.ctrl:
                self.toggle()
            case glfw.KEY_ENTER | glfw.KEY_KP_ENTER if ruler.on and ruler.points:
                ruler.finish()
            case glfw.KEY_DELETE | glfw.KEY_BACKSPACE if ruler.on and ruler.points:
                ruler.undo()
            case glfw.KEY_DELETE if ruler.on and ruler.chosen:
                ruler.delete(ruler.chosen)
            case glfw.KEY_ESCAPE if ruler.on and ruler.points:
                ruler.points = []
            case glfw.KEY_ESCAPE if ruler.on and ruler.chosen:
                ruler.chosen = ""
            case glfw.KEY_ESCAPE if ruler.on:
                ruler.on = False
            case _ if ruler.on and event.shortcut == "z" and not event.shift:
                return ruler.undo()
            case _:
                return False
        return True

    def toggle(self) -> None:
        """The tool, in the place of another that has the mouse."""
        self._ruler.toggle()
        self._pressed = None
        if self._ruler.on:
            self._inspecting.on = False
            if self._parts.on:
                self._parts.toggle()

    def opens(self) -> bool:
        """Once when the tool is taken: its section unfolds."""
        opened, self._was_on = self._ruler.on and not self._was_on, self._ruler.on
        return opened

    # ---- frames

    def each_frame(self) -> bool:
        """Draws the depths of the view once it is still; True while that is waited for."""
        ruler = self._ruler
        if self._inspecting.on or self._parts.on:
            ruler.on = False
        ruler.pointed = None
        if not ruler.on:
            return False
        key = self._seen_now()
        still = self._under.is_still(key)
        waits = self._drawn != key and not self._seen.moving()
        if waits and still:
            self.measure()
            waits = False
        if self._drawn == key and ruler.picture is not None and self._window.on_scene:
            there = ruler.picture.pick(self._under.pixel(self._window.cursor))
            ruler.pointed = there if np.isfinite(there).all() else None
        return waits

    def _seen_now(self) -> tuple:
        """What depths depend on, x among it."""
        view = self._viewpoint.view()
        eye = view.world_from_eye.matrix().tobytes()
        return eye, view.tangents, view.size, id(self._state.scene)

    def measure(self) -> None:
        """Depths of what is seen now, unless they are there."""
        ruler, key = self._ruler, self._seen_now()
        if self._drawn == key and ruler.picture is not None:
            return
        self._drawn, self._scene = key, self._state.scene
        try:
            ruler.picture = self._under.draw(
                lambda renderer, view: depth_picture(renderer, self._state.scene, view)
            )
        except BadFile as error:
            ruler.on = False
            self._state.problem = str(error)

    def forget(self) -> None:
        """Another scene."""
        self._drawn, self._pressed = (), None
        self._ruler.opened()

    def status(self) -> str:
        """For the line at the lower edge."""
        if not self._ruler.on:
            return ""
        if self._ruler.kind in OPEN_KINDS:
            return said("click: points on the surface, Enter: done, drag: orbit")
        return said("click: points on the surface, drag: orbit")

    def draw(self, ui_scale: float) -> None:
        """What was measured, and what is being laid."""
        ruler = self._ruler
        if not self._state.overlay or not (ruler.lengths or ruler.points):
            return
        view, unit = self._under.logical_view(), self._unit()
        for each in ruler.lengths:
            words = f"{each.name}  {ruler.measured(each).words(unit)}"
            chosen = each.name == ruler.chosen
            draw_length(each.kind, each.points, view, words, chosen, ui_scale)
        if ruler.points:
            places, found = ruler.being_laid()
            words = found.words(unit) if found is not None else ""
            draw_length(ruler.kind, places, view, words, True, ui_scale)


# Measured lengths, angles and areas over the picture, each with its value.

Vec = imgui.ImVec2
DOT = 4.0  # logical pixels


def draw_length(
    kind: str, points: np.ndarray, view: View, words: str, chosen: bool, ui_scale: float
) -> None:
    """points (n, 3) metres in the world; view: of the window, its size in logical pixels."""
    pixels, _ = ValuePicture(view, NOWHERE, NOWHERE).pixel_of(points)
    if not np.isfinite(pixels).all():
        return  # behind the eye, in whole or in part
    ink = theme.color(theme.ACCENT if chosen else theme.TEXT)
    ground = theme.color(theme.SURFACE, 0.7)
    draw = imgui.get_background_draw_list()
    corners: list[imgui.ImVec2Like] = [Vec(*place) for place in pixels.tolist()]
    closed = kind == "area" and len(corners) > 2
    if closed:
        draw.add_concave_poly_filled(corners, theme.color(theme.ACCENT, 0.15))
    for color, width in ((ground, 4.0), (ink, 1.6)):
        flags = imgui.ImDrawFlags_.closed if closed else 0
        draw.add_polyline(corners, color, width * ui_scale, flags)
    for corner in corners:
        draw.add_circle_filled(corner, (DOT + 1.5) * ui_scale, ground)
        draw.add_circle_filled(corner, DOT * ui_scale, ink)
    if words:
        x, y = label_place(kind, pixels)
        draw_words(words, (x + 8 * ui_scale, y + 4 * ui_scale), ink)


def label_place(kind: str, pixels: np.ndarray) -> tuple[float, float]:
    """Where its words go, of points (n, 2) pixels: at an angle's vertex, else in the middle."""
    if kind == "angle" and len(pixels) == 3:
        x, y = pixels[1]
    elif kind == "polyline":
        x, y = pixels[-1]
    else:
        x, y = pixels.mean(axis=0)
    return float(x), float(y)
