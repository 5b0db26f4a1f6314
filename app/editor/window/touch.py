"""The mouse as a hand: it grabs, carries, turns and throws objects, and shoots a ray."""

import glfw

from shapeshift.app.editor.options import Options
from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.sections.touch_panel import draw_touch
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.touch_state import HAND, Flash, TouchState
from shapeshift.app.editor.window.hands import InputActions
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.touch_marks import Marks
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
from shapeshift.scene.pose import View
from shapeshift.scene.world.mouse_hand import (
    MouseHand,
    hand_at,
    moved,
    pose,
    pushed,
    ray,
    rolled,
    turned,
)
from shapeshift.scene.world.rigid_object import middle_of
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
            return False
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
