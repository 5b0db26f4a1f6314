"""The handles of a section in the picture, the key of the tool, and what the mouse does to them."""

import glfw
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.cuts_panel import draw_cuts
from shapeshift.app.editor.panels.outlines import moved, on_screen, pixels, plane, segments
from shapeshift.app.editor.panels.panel import Section as PanelSection
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.regions import Region
from shapeshift.app.editor.state.section_tool import TURNS, SectionHandle, SectionTool
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.window import (
    DoubleClick,
    Drag,
    Event,
    KeyDown,
    Press,
    Release,
    Window,
)
from shapeshift.scene.pose import View
from shapeshift.scene.sections.section import PlaneShape

Vec = imgui.ImVec2
KEYS = (
    ("Shift+O", "sections: planes and boxes that cut, on and off"),
    ("drag a dot", "moves a side; the arrow's tip turns a plane"),
    ("Delete", "delete what is chosen"),
    ("Esc", "leave"),
)
GRASP = 14.0  # logical pixels about a handle that take hold of it
DOT = 6.0  # logical pixels
GRID_PART = 0.6  # of the scene's radius: how far a plane is drawn to either side


def attach_sections(
    window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks
) -> SectionTool:
    """Adds the section of the panel, the keys and the handles to the hooks."""
    tool = SectionTool(state)
    handles = SectionHandles(tool, state, window, viewpoint)
    hooks.event_handlers.insert(1, handles.handle_event)  # before the camera
    hooks.marks.append(handles.draw)
    hooks.opened.append(tool.forget)
    hooks.sections.append(
        PanelSection(
            "Sections",
            lambda scale: draw_cuts(tool, state, scale),
            opens=handles.opens,
            in_hand=lambda: tool.on,
        )
    )
    hooks.keys["Sections"] = list(KEYS)
    return tool


class SectionHandles:
    """Draws the chosen section's handles and lets the mouse drag them."""

    def __init__(
        self, tool: SectionTool, state: EditorState, window: Window, viewpoint: Viewpoint
    ) -> None:
        self._tool, self._state, self._window, self._viewpoint = tool, state, window, viewpoint
        self._held: SectionHandle | None = None  # as it was when it was taken hold of
        self._was_on = False

    def opens(self) -> bool:
        """Once when the tool is taken: its section unfolds."""
        opened, self._was_on = self._tool.on and not self._was_on, self._tool.on
        return opened

    def handle_event(self, event: Event) -> bool:
        """True for what concerns the tool."""
        tool = self._tool
        if isinstance(event, KeyDown):
            return not self._window.popup_open and self._press_key(event)
        match event:
            case Press(button="left") if tool.on and (held := self.at(event.x, event.y)):
                self._held = held
            case Drag(button="left") if self._held is not None:
                origin, ray = self._ray(event.x, event.y)
                tool.drag(self._held, origin, ray)
            case Release(button="left") if self._held is not None:
                self._held = None
                self._state.rest()
            case DoubleClick() if self._held is not None:
                pass
            case _:
                return False
        return True

    def _press_key(self, event: KeyDown) -> bool:
        tool = self._tool
        match event.key:
            case glfw.KEY_O if event.shift and not event.ctrl:
                tool.toggle()
            case glfw.KEY_ESCAPE if tool.on:
                tool.on = False
            case glfw.KEY_DELETE if tool.on and tool.current is not None:
                tool.remove(tool.number)
            case _:
                return False
        return True

    def at(self, x: float, y: float) -> SectionHandle | None:
        """The handle nearest to logical pixels, within reach of them."""
        near = []
        for handle, place in self._places(self._viewpoint.view()):
            away = float(np.hypot(place[0] - x, place[1] - y))
            if away <= GRASP * self._window.ui_scale:
                near.append((away, handle))
        return min(near, key=lambda pair: pair[0])[1] if near else None

    def _places(self, view: View) -> list[tuple[SectionHandle, np.ndarray]]:
        """The handles before the eye, and where they are, logical pixels."""
        out, matrix = [], view.eye_from_world()
        for handle in self._tool.handles():
            in_eye = matrix[:3, :3] @ handle.place + matrix[:3, 3]
            if -in_eye[2] > view.near:
                out.append((handle, pixels(view, in_eye, self._window.logical_size)))
        return out

    def _ray(self, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        """The eye (3,) and the direction (3,), unit, of logical pixels."""
        view = self._viewpoint.view()
        left, right, down, up = view.tangents
        width, height = self._window.logical_size
        way = np.array([left + x / width * (right - left), up - y / height * (up - down), -1.0])
        ray = view.world_from_eye.matrix()[:3, :3] @ way
        return view.world_from_eye.position, ray / np.linalg.norm(ray)

    def draw(self, ui_scale: float) -> None:
        """The outline of the chosen section and its dots, over the picture."""
        tool, shape = self._tool, self._tool.shape
        if not tool.on or shape is None or not self._state.overlay:
            self._held = None if not tool.on else self._held
            return
        view, size = self._viewpoint.view(), self._window.logical_size
        reach = GRID_PART * self._state.radius
        if isinstance(shape, PlaneShape):
            lines = tool.pivot + plane(np.array(shape.normal), reach)[:-1]
            face, tip = tool.handles()
            lines = np.concatenate([lines, np.array([[face.place, tip.place]])])
        else:
            turned = np.eye(4)
            turned[:3, :3], turned[:3, 3] = shape.axes, shape.centre
            lines = moved(segments(Region("box", "", half=np.array(shape.half)), 0.0), turned)
        self._draw_lines(np.clip(on_screen(view, lines, size), -1e5, 1e5), ui_scale)
        held = self._held.key if self._held is not None else None
        for handle, place in self._places(view):
            self._draw_dot(handle, place, handle.key == held, ui_scale)

    def _draw_lines(self, lines: np.ndarray, ui_scale: float) -> None:
        draw, ink = imgui.get_background_draw_list(), theme.color(theme.ACCENT, 0.55)
        for (x0, y0), (x1, y1) in lines:
            draw.add_line(Vec(x0, y0), Vec(x1, y1), ink, 1.2 * ui_scale)

    def _draw_dot(
        self, handle: SectionHandle, place: np.ndarray, held: bool, ui_scale: float
    ) -> None:
        x, y = self._window.cursor
        near = np.hypot(place[0] - x, place[1] - y) <= GRASP * ui_scale
        draw, middle = imgui.get_background_draw_list(), Vec(*map(float, place))
        radius = (1.3 if held or near else 1.0) * DOT * ui_scale
        draw.add_circle_filled(middle, radius, theme.color(theme.ACCENT, 0.95))
        ring = theme.color(theme.TEXT if handle.key == TURNS else theme.SURFACE, 0.95)
        draw.add_circle(middle, radius, ring, 24, 2 * ui_scale)
