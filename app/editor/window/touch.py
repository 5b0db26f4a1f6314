"""The mouse as a hand: it grabs, carries, turns and throws objects, and shoots a ray."""

from collections.abc import Callable
from typing import TypeAlias

import glfw
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.options import Options
from shapeshift.app.editor.panels.outlines import pixels
from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.sections.touch_panel import draw_touch
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.touch_state import FLASH_S, HAND, LABEL_S, Flash, Label, TouchState
from shapeshift.app.editor.window.hands import InputActions
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.shown import FrameRequest
from shapeshift.app.editor.window.window import (
    DoubleClick,
    Drag,
    Event,
    KeyDown,
    Press,
    Release,
    Wheel,
    Window,
)
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.over_picture import Lines, Wire
from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.colliders.collider_edges import hull_edges, mesh_edges
from shapeshift.scene.document.scene_file import BACKGROUND
from shapeshift.scene.pose import View
from shapeshift.scene.world.grab import (
    MouseHand,
    Size,
    hand_at,
    moved,
    pose,
    pushed,
    ray,
    rolled,
    turned,
)
from shapeshift.scene.world.rigid_object import RigidObject, middle_of
from shapeshift.scene.world.world import World

KEYS = (
    ("T", "let objects move, hold them still"),
    ("Shift+T", "one step of 1/90 s"),
    ("R", "put everything back"),
    ("drag an object", "carry it, while objects move"),
    ("wheel, carrying", "farther, nearer"),
    ("Shift, carrying", "drag turns it, wheel rolls it"),
    ("X", "a ray at the mouse"),
    ("J", "show colliders"),
)


def attach_touch(
    window: Window, state: EditorState, viewpoint: Viewpoint, hands: InputActions, hooks: Hooks,
    options: Options,
) -> TouchState:  # fmt: skip
    """Adds the section, keys and mouse of touching to the hooks."""
    touch = TouchState(state, options.play)
    mouse = MouseTouch(touch, state, window, viewpoint, hands)
    marks = Marks(touch, state, window, viewpoint, mouse.under)
    waits = options.screenshot is None  # for marks to fade
    hooks.event_handlers.append(mouse.handle_event)
    hooks.each_frame.append(lambda: mouse.each_frame() and waits)
    hooks.over.append(marks.draw_colliders)
    hooks.marks.append(marks.draw)
    hooks.opened += [touch.forget, marks.forget]
    hooks.status.append(touch.status)
    hooks.sections.append(
        Section(
            "Touch",
            lambda ui_scale: draw_touch(touch, ui_scale),
            opens=touch.opens,
            waits=True,
            shown=lambda: touch.world is not None,
        )
    )
    hooks.keys["Touch"] = list(KEYS)
    return touch


class MouseTouch:
    """What the mouse and the keys do to a `TouchState`."""

    def __init__(
        self, touch: TouchState, state: EditorState, window: Window, viewpoint: Viewpoint,
        hands: InputActions,
    ) -> None:  # fmt: skip
        self._touch, self._state, self._window = touch, state, window
        self._viewpoint, self._hands = viewpoint, hands

    def handle_event(self, event: Event) -> bool:
        """True for what concerns the hand, its ray and the physics."""
        world, hand = self._touch.world, self._touch.hand
        if world is None:
            asked = isinstance(event, KeyDown) and event.key == glfw.KEY_T and not event.ctrl
            if asked:
                self._touch.toggle()
            return asked
        if isinstance(event, KeyDown):
            return self.press_key(event, world)
        if hand is None:
            return isinstance(event, Press) and event.button == "left" and self.grab(event, world)
        match event:
            case Drag(button="left"):
                self.drag(hand, event.dx, event.dy)
            case Wheel():
                self.turn_wheel(hand, event.notches)
            case Release(button="left"):
                self._touch.release()
            case Press() | DoubleClick():  # another button, or the camera is meant
                self._touch.release()
                return False
            case _:
                return False
        return True

    def press_key(self, event: KeyDown, world: World) -> bool:
        match event.key:
            case glfw.KEY_T if event.shift:
                self._touch.step()
            case glfw.KEY_T:
                self._touch.toggle()
            case glfw.KEY_R:
                self._touch.reset_objects()
            case glfw.KEY_X:
                self.shoot(world)
            case glfw.KEY_J:
                self._touch.colliders = not self._touch.colliders
            case glfw.KEY_ESCAPE if self._touch.hand is not None:
                self._touch.release()
            case _:
                return False
        return True

    def grab(self, press: Press, world: World) -> bool:
        """Takes what lies under the mouse, if it can be carried."""
        regions, window = self._state.regions, self._window
        if world.paused or self._hands.is_painting or regions.placing:
            return False
        view, size = self._viewpoint.view(), window.logical_size
        name = self.under(view, (press.x, press.y))
        if name is None:
            return False
        middle = middle_of(world.objects[name])  # about which it is turned
        hand = self._touch.hand = hand_at(view, size, middle)
        world.move_hand(HAND, pose(hand, view, size))
        world.grab_body(HAND, name, middle)
        self._state.chosen = name
        return True

    def under(self, view: View, place: tuple[float, float]) -> str | None:
        """What could be carried that lies under a place of the picture, logical pixels."""
        world = self._touch.world
        hit = world.aim(*ray(view, place, self._window.logical_size)) if world else None
        if world is None or hit is None:
            return None
        obj = world.objects.get(hit.object)
        return hit.object if obj is not None and obj.moves else None

    def drag(self, hand: MouseHand, dx: float, dy: float) -> None:
        if self._hands.shift:
            self._touch.hand = turned(hand, dx, dy, self._viewpoint.view())
        else:
            self._touch.hand = moved(hand, dx, dy, self._window.logical_size)

    def turn_wheel(self, hand: MouseHand, notches: float) -> None:
        view = self._viewpoint.view()
        self._touch.hand = (rolled if self._hands.shift else pushed)(hand, notches, view)

    def shoot(self, world: World) -> None:
        """A ray from the eye through the mouse: what it meets answers."""
        window = self._window
        if not window.on_scene:
            return
        at = ray(self._viewpoint.view(), window.cursor, window.logical_size)
        hit = world.ray(*at)
        if hit is not None:
            self._touch.flashes.append(Flash(hit.point))
        if world.paused:  # nobody else would let it answer
            self._touch.step()

    def each_frame(self) -> bool:
        """Moves the hand and lets time pass; True while a mark has yet to fade."""
        touch = self._touch
        if not touch.meet_world():
            return False
        if touch.world is not None and touch.hand is not None:
            where = pose(touch.hand, self._viewpoint.view(), self._window.logical_size)
            touch.world.move_hand(HAND, where)
        touch.advance(self._state.seconds)
        return touch.fading


# What touching shows over the picture: the grip, rays, reactions that fade, colliders as lines.

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
