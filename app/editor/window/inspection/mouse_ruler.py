"""The mouse and the keys of the tool "Measure", and when the depths of a view are drawn."""

from collections.abc import Callable

import glfw
import numpy as np

from shapeshift.app.editor.panels.inspection.lengths_over import draw_length
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.inspecting import Inspecting
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.state.ruler import Ruler
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.inspection.picture_under import PictureUnder, Seen
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
from shapeshift.runtime_models.model import BadFile

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
