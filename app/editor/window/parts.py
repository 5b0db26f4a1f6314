"""The mouse and the keys of the tool "Parts": things light up, are chosen, become objects."""

from collections.abc import Sequence

import glfw
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.outlines import draw_brush, draw_segments, segments
from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.sections.objects_panel import FOUR_VIEW_NAMES
from shapeshift.app.editor.panels.sections.parts_panel import DRAG_WORDS, draw_parts
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.parts.parts_tool import ADD, REMOVE, REPLACE, PartsTool
from shapeshift.app.editor.state.parts.selecting import COLOR, LASSO, SPHERE
from shapeshift.app.editor.state.regions import Region
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hands import TURN
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.objects import Objects
from shapeshift.app.editor.window.window import (
    CLICK_PIXELS,
    DoubleClick,
    Drag,
    Event,
    KeyDown,
    Press,
    Release,
    Wheel,
    Window,
)

KEYS = (
    ("O", "take things out of the scene, on and off"),
    ("click", "choose the thing there; Shift adds, Alt removes"),
    ("drag", "a box: the thing in it; right drag orbits"),
    ("U, Shift+U", "drag: a box of all, a lasso, a sphere; click: a colour"),
    ("Ctrl+wheel", "more, less of what lights up"),
    ("B + drag", "add anchors; Shift or Alt removes"),
    ("Enter", "make it an object"),
    ("Delete", "delete what is chosen"),
    ("Esc", "choose nothing, leave"),
    ("I, Shift+I", "full, overlay, background, isolated"),
)


def attach_parts(
    window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks, objects: Objects
) -> PartsTool:
    """Adds the section, keys and mouse of the tool to the hooks."""

    def count_changed() -> None:
        objects.edits.count_changed()
        objects.unfold()

    tool = PartsTool(state, count_changed)
    mouse = MouseParts(tool, state, window, viewpoint)
    hooks.event_handlers.insert(1, mouse.handle_event)  # handles in the picture see it before
    hooks.each_frame.append(mouse.each_frame)
    hooks.marks.append(mouse.draw)
    hooks.opened.append(tool.forget)
    hooks.status.append(tool.status)
    hooks.sections.append(
        Section(
            "Parts",
            lambda scale: draw_parts(
                tool, scale, mouse.how, viewpoint.view().world_from_eye.position
            ),
            opens=mouse.opens,
            in_hand=lambda: tool.on,
        )
    )
    hooks.keys["Parts"] = list(KEYS)
    return tool


class MouseParts:
    """What the mouse and the keys do to a `PartsTool`."""

    def __init__(
        self, tool: PartsTool, state: EditorState, window: Window, viewpoint: Viewpoint
    ) -> None:
        self._tool, self._state, self._window, self._viewpoint = tool, state, window, viewpoint
        self._pressed: tuple[float, float] | None = None  # logical pixels; None: no press is ours
        self._way: list[tuple[float, float]] = []  # of a drag, logical pixels: a box is drawn
        self._painting = self._turning = False
        self._pointed: tuple = ()  # where the mouse was looked up last, and from where
        self._was_on = False

    def opens(self) -> bool:
        """Once when the tool is taken: its section unfolds."""
        opened, self._was_on = self._tool.on and not self._was_on, self._tool.on
        return opened

    # ---- input

    @property
    def how(self) -> str:
        """What a click does with the keys that are held."""
        held = self._window.held
        if held(glfw.KEY_LEFT_ALT) or held(glfw.KEY_RIGHT_ALT):
            return REMOVE
        if held(glfw.KEY_LEFT_SHIFT) or held(glfw.KEY_RIGHT_SHIFT):
            return ADD
        return REPLACE

    @property
    def eye(self) -> np.ndarray:
        """(3,) metres, world."""
        return self._viewpoint.view().world_from_eye.position

    @property
    def is_brush(self) -> bool:
        return self._tool.on and self._window.held(glfw.KEY_B)

    def handle_event(self, event: Event) -> bool:
        """True for what concerns the tool, and for the keys that open it and change the view."""
        if isinstance(event, KeyDown):
            return not self._window.popup_open and self._press_key(event)
        if not self._tool.on:
            return False
        match event:
            case Press(button="left"):
                self._pressed, self._way = (event.x, event.y), []
                self._painting = self.is_brush
                if self._painting:
                    self._paint(event.x, event.y, starts=True)
            case Drag(button="left") if self._painting:
                self._paint(event.x, event.y, starts=False)
            case Drag(button="left") if self._pressed is not None:
                x, y = self._pressed
                if self._way or abs(event.x - x) + abs(event.y - y) > CLICK_PIXELS:
                    self._way.append((event.x, event.y))
            case Release(button="left"):
                self._let_go()
            case Drag(button="right"):
                self._viewpoint.leave_camera()
                self._viewpoint.camera.turn(-event.dx * TURN, -event.dy * TURN)
            case Wheel() if self._ctrl:
                self._tool.grow(event.notches)
            case DoubleClick():
                pass  # two clicks: the camera stays
            case _:
                return False
        return True

    @property
    def _ctrl(self) -> bool:
        held = self._window.held
        return bool(held(glfw.KEY_LEFT_CONTROL) or held(glfw.KEY_RIGHT_CONTROL))

    def _press_key(self, event: KeyDown) -> bool:
        tool, state = self._tool, self._state
        match event.key:
            case glfw.KEY_O if not event.ctrl:
                tool.toggle()
            case glfw.KEY_U if tool.on and not event.ctrl:
                tool.selecting.next_drag(-1 if event.shift else 1)
                state.say(said(DRAG_WORDS[tool.selecting.drag]))
            case glfw.KEY_I if not event.ctrl:
                show = state.shown_scene.next_view(-1 if event.shift else 1)
                state.say(said("view: {what}", what=said(FOUR_VIEW_NAMES[show])))
            case glfw.KEY_ENTER | glfw.KEY_KP_ENTER if tool.on and tool.crop is not None:
                tool.apply_crop()
            case glfw.KEY_ENTER | glfw.KEY_KP_ENTER if tool.on:
                tool.make()
            case glfw.KEY_DELETE if tool.on and tool.count:
                tool.delete()
            case glfw.KEY_ESCAPE if tool.on:
                self._escape()
            case _ if event.shortcut == "z" and not event.shift:
                return tool.step_back()
            case _:
                return False
        return True

    def _escape(self) -> None:
        """The box first, then the crop box, then what is chosen, then the tool."""
        tool = self._tool
        if self._way:
            self._pressed, self._way = None, []
        elif tool.crop is not None:
            tool.crop = None
        elif tool.count:
            tool.clear()
        else:
            tool.toggle()

    def _let_go(self) -> None:
        """A click, or the end of a drag."""
        pressed, way = self._pressed, self._way
        self._pressed, self._way = None, []
        if self._painting or pressed is None:
            self._painting = False
            return
        tool, view, start = self._tool, self._viewpoint.view(), self._pixel(pressed)
        drag, select = tool.selecting.drag, tool.selecting
        if not way and drag == COLOR:
            select.alike(view, start, self.how)
        elif not way:
            tool.click(view, start, self.how)
        elif drag == LASSO:
            outline = np.array([start, *map(self._pixel, way)])
            select.lasso(view, outline, self.how)
        elif drag == SPHERE:
            select.sphere(view, start, self._pixel(way[-1]), self.how)
        else:
            tool.box(view, (*start, *self._pixel(way[-1])), self.how)

    def _paint(self, x: float, y: float, starts: bool) -> None:
        window = self._window
        density = window.size[0] / max(window.logical_size[0], 1)
        radius = self._state.regions.brush * window.ui_scale * density
        how = ADD if self.how == REPLACE else REMOVE
        self._tool.brush(self._viewpoint.view(), self._pixel((x, y)), radius, how, starts)

    def _pixel(self, place: tuple[float, float]) -> tuple[float, float]:
        """A place in logical pixels as one of the view, whose pixels may be finer."""
        density = self._window.size[0] / max(self._window.logical_size[0], 1)
        return place[0] * density, place[1] * density

    # ---- frames

    def each_frame(self) -> bool:
        """Looks up what the mouse points at; True while that is looked for."""
        tool, window = self._tool, self._window
        if not tool.on:
            return False
        cameras = self._viewpoint.steps.cameras
        if cameras is not None and not tool.finder.eyes:
            tool.finder.eyes = [view.world_from_eye.position for view in cameras.views]
        view = self._viewpoint.view()
        idle = self._pressed is None and not self.is_brush and tool.crop is None
        idle = idle and tool.selecting.drag != COLOR
        if idle and window.on_scene and not self._viewpoint.moving:
            key = (window.cursor, self.how, view.eye_from_world().tobytes(), self._state.scene)
            if key[:3] != self._pointed[:3] or key[3] is not self._pointed[3]:
                self._pointed = key
                tool.point(view, self._pixel(window.cursor), self.how)
        elif self._pointed or tool.found is not None:
            self._pointed = ()
            tool.look_away()
        tool.how = self.how
        return tool.poll()

    def draw(self, ui_scale: float) -> None:
        """The box, the brush or the crop box, over the picture."""
        tool, window = self._tool, self._window
        if not tool.on:
            return
        if self._pressed is not None and self._way:
            removes = self.how == REMOVE
            draw_drag(tool.selecting.drag, self._pressed, self._way, removes, ui_scale)
        if self.is_brush and window.on_scene:
            erases = self.how != REPLACE
            draw_brush(window.cursor, self._state.regions.brush * ui_scale, erases, ui_scale)
        if tool.crop is not None and tool.index is not None:
            low, high = tool.crop
            box = Region("box", "crop", centre=(low + high) / 2, half=(high - low) / 2)
            obj = self._state.scene.objects[tool.index]
            lines = segments(box, 0.0)
            draw_segments(lines, obj, self._viewpoint.view(), window.logical_size, ui_scale)


# What a drag of the tool "Parts" draws over the picture: a box, a lasso, the edge of a sphere.

Vec = imgui.ImVec2
Place = tuple[float, float]  # logical pixels


def draw_drag(
    drag: str, start: Place, way: Sequence[Place], removes: bool, ui_scale: float
) -> None:
    """From where the button went down, along the way that the mouse has gone since."""
    draw = imgui.get_background_draw_list()
    ink, wide = theme.color(theme.TEXT if removes else theme.ACCENT, 0.9), 1.5 * ui_scale
    if drag == LASSO:
        points: list[imgui.ImVec2Like] = [Vec(*start), *(Vec(x, y) for x, y in way)]
        draw.add_polyline(points, ink, wide, imgui.ImDrawFlags_.closed)
    elif drag == SPHERE:
        radius = float(np.hypot(way[-1][0] - start[0], way[-1][1] - start[1]))
        draw.add_circle(Vec(*start), radius, ink, 0, wide)
        draw.add_circle_filled(Vec(*start), 2.5 * ui_scale, ink)
    else:
        corners = np.array([start, way[-1]])
        low, high = corners.min(axis=0), corners.max(axis=0)
        draw.add_rect(Vec(*low), Vec(*high), ink, 0.0, wide)
