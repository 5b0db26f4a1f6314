"""What touching shows over the picture: the grip, rays, reactions that fade, colliders as lines."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.outlines import pixels
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.touch_state import FLASH_S, LABEL_S, Label, TouchState
from shapeshift.app.editor.window.shown import FrameRequest
from shapeshift.app.editor.window.window import Window
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.lines import Lines, Wire
from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.colliders.collider_edges import hull_edges, mesh_edges
from shapeshift.scene.document.scene_file import BACKGROUND
from shapeshift.scene.pose import View
from shapeshift.scene.world.mouse_hand import MouseHand, Size, pose
from shapeshift.scene.world.rigid_object import RigidObject, middle_of
from shapeshift.scene.world.world import World

Vec: TypeAlias = imgui.ImVec2
RISE = 26.0  # logical pixels that a label goes up meanwhile
MOVES_INK, STAYS_INK = (0.35, 0.9, 0.55), (0.45, 0.65, 1.0)
HELD_INK = theme.ACCENT


class Marks:
    """Draws them, and knows which have yet to fade."""

    def __init__(
        self, touch: TouchState, state: EditorState, window: Window, viewpoint: Viewpoint,
        under: Callable[[View, tuple[float, float]], str | None],
    ) -> None:  # fmt: skip
        """`under` tells what could be carried that lies under a place of a view."""
        self._touch, self._state, self._window = touch, state, window
        self._viewpoint, self._under = viewpoint, under
        self._lines: Lines | None = None
        self._edges: dict[tuple[int, bool], tuple[Collider, np.ndarray]] = {}

    def forget(self) -> None:
        self._edges.clear()

    # ---- colliders

    def draw_colliders(self, request: FrameRequest) -> None:
        """Edges of what is touched, through everything: green moves, blue stays, warm is held."""
        touch = self._touch
        if not (touch.colliders and touch.world):
            return
        gpu_lines = self._lines or Lines(Gpu(self._window.ctx))
        self._lines = gpu_lines
        wires = [
            Wire(self.edges(obj, obj.collider), where(request, obj), self._ink(name, obj))
            for name, obj in touch.world.objects.items()
            if obj.collider is not None
        ]
        gpu_lines.draw(self._window.screen(), request.view, wires)

    def _ink(self, name: str, obj: RigidObject) -> tuple[float, float, float, float]:
        held = name == self._touch.held
        rgb = HELD_INK if held else MOVES_INK if obj.moves else STAYS_INK
        return (*rgb, 0.9 if held else 0.6)

    def edges(self, obj: RigidObject, collider: Collider) -> np.ndarray:
        """(S, 2, 3) of its collider, made once."""
        is_mesh = obj.item.name == BACKGROUND
        key = (id(collider), is_mesh)
        if key not in self._edges:
            made = (mesh_edges if is_mesh else hull_edges)(collider)
            self._edges[key] = collider, made
        return self._edges[key][1]

    # ---- over the picture

    def draw(self, ui_scale: float) -> None:
        """The grip, or what could be taken; flashes of rays; what objects have become."""
        touch = self._touch
        if touch.world is None:
            return
        view, size = self._viewpoint.view(), self._window.logical_size
        if touch.hand is not None:
            self._grip(touch.hand, touch.world, view, size, ui_scale)
        elif not touch.world.paused and self._window.on_scene:
            self._could_take(view, ui_scale)
        for flash in touch.flashes:
            part = flash.age_s / FLASH_S
            ink = theme.color(theme.ACCENT, 1 - part)
            self._circle(view, size, flash.point, (4 + 26 * part) * ui_scale, ink, ui_scale)
        for label in touch.labels:
            draw_label(label, touch.world, view, size, ui_scale)

    def _grip(self, hand: MouseHand, world: World, view: View, size: Size, ui_scale: float) -> None:
        """A disc where the hand is, and a line to what it holds where that is kept back."""
        at = on_picture(view, pose(hand, view, size).position, size)
        if at is None:
            return
        draw, ink = imgui.get_background_draw_list(), theme.color(theme.ACCENT, 0.8)
        held = self._touch.held
        obj = None if held is None else world.objects.get(held)
        middle = on_picture(view, middle_of(obj), size) if obj else None
        if middle is not None:
            draw.add_line(Vec(*middle), Vec(*at), ink, 2 * ui_scale)
        draw.add_circle_filled(Vec(*at), 4 * ui_scale, theme.color(theme.ACCENT))
        draw.add_circle(Vec(*at), 9 * ui_scale, ink, 0, ui_scale)

    def _could_take(self, view: View, ui_scale: float) -> None:
        """A ring at the mouse where it would take something, with its name."""
        cursor = self._window.cursor
        name = self._under(view, cursor)
        if name is None:
            return
        draw, ink = imgui.get_background_draw_list(), theme.color(theme.ACCENT, 0.8)
        draw.add_circle(Vec(*cursor), 9 * ui_scale, ink, 0, 1.5 * ui_scale)
        if self._state.overlay:
            draw_word(name, Vec(cursor[0] + 16 * ui_scale, cursor[1]), 0.8, ui_scale)

    def _circle(self, view: View, size, point, radius: float, ink: int, ui_scale: float) -> None:
        at = on_picture(view, point, size)
        if at is not None:
            draw = imgui.get_background_draw_list()
            draw.add_circle(Vec(*at), radius, ink, 0, 2 * ui_scale)


def where(request: FrameRequest, touched: RigidObject) -> np.ndarray:
    """(4, 4) where the object is drawn, else where it stands."""
    for obj in request.scene.objects:
        if obj.name == touched.item.name:
            return obj.world_from_object.matrix()
    return touched.pose.matrix()


def draw_label(label: Label, world: World, view: View, size: Size, ui_scale: float) -> None:
    """What an object has become, rising from it; nothing where it is gone."""
    obj = world.objects.get(label.object)
    at = on_picture(view, obj.pose.position, size) if obj else None
    if at is not None:
        part = label.age_s / LABEL_S
        left = Vec(at[0], at[1] - (24 + RISE * part) * ui_scale)
        draw_word(label.text, left, min(2 * (1 - part), 1.0), ui_scale)


def on_picture(view: View, point: np.ndarray, size: Size) -> np.ndarray | None:
    """(2,) logical pixels of a point (3,) of the world; None behind the eye."""
    in_eye = (view.eye_from_world() @ np.append(point, 1.0))[:3]
    return pixels(view, in_eye, size) if -in_eye[2] > view.near else None


def draw_word(text: str, at: Vec, alpha: float, ui_scale: float) -> None:
    """A word on a dark ground that can be read over anything; `at` is its left middle."""
    size, pad = imgui.calc_text_size(text), 5 * ui_scale
    top = at.y - size.y / 2
    draw = imgui.get_background_draw_list()
    draw.add_rect_filled(
        Vec(at.x - pad, top - pad / 2), Vec(at.x + size.x + pad, top + size.y + pad / 2),
        theme.color(theme.SURFACE, 0.8 * alpha), pad,
    )  # fmt: skip
    draw.add_text(Vec(at.x, top), theme.color(theme.TEXT, alpha), text)
