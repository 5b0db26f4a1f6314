"""Touching in the viewer: play and step the physics, the mouse as a hand, rays, reactions seen."""

from collections import deque
from typing import TYPE_CHECKING

import glfw

from shapeshift.app.editor.panels.sections.touch_panel import draw_touch
from shapeshift.app.editor.state.arrange import steer
from shapeshift.app.editor.window.hands import is_painting
from shapeshift.app.editor.window.hooks import Section
from shapeshift.app.editor.window.touch_marks import Flash, Label, Marks
from shapeshift.app.editor.window.window import (
    DoubleClick,
    Drag,
    Event,
    KeyDown,
    Press,
    Release,
    Wheel,
)
from shapeshift.app.paths import is_bundled
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.pose import View
from shapeshift.scene.world.follow import put_back
from shapeshift.scene.world.mouse_hand import (
    MouseHand,
    moved,
    pose,
    pushed,
    ray,
    rolled,
    take,
    turned,
)
from shapeshift.scene.world.record import Record
from shapeshift.scene.world.rigid_object import middle_of
from shapeshift.scene.world.world import World

if TYPE_CHECKING:
    from shapeshift.app.editor.desktop import Viewer

HAND = "mouse"
HOW, HOW_S = "Drag a thing. X shoots. T stops.", 9.0  # said once, for so many seconds
STILL, MOVING = "things hold still: T lets them move", "drag a thing, X shoots, T stops"
REMEMBERED = 6  # reactions that the panel lists
WORDS = {"collision": "struck", "grab": "taken", "ray": "hit by a ray", "enter": "arrived"}
KEYS = (
    ("T", "let things move, hold them still"),
    ("Shift+T", "one step of 1/90 s"),
    ("R", "put everything back"),
    ("drag a thing", "carry it, while things move"),
    ("wheel, carrying", "farther, nearer"),
    ("Shift, carrying", "drag turns it, wheel rolls it"),
    ("X", "a ray at the mouse"),
    ("J", "show colliders"),
)


def attach_touch(viewer: "Viewer") -> "Touch":
    """Adds the section, keys and mouse to a viewer."""
    touch = Touch(viewer)
    hooks = viewer.hooks
    hooks.takes.append(touch.take)
    hooks.each_frame.append(touch.each_frame)
    hooks.over.append(touch.marks.draw_colliders)
    hooks.marks.append(touch.marks.draw)
    hooks.opened.append(touch.forget)
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


class Touch:
    """What the mouse holds, and what has just happened in the state's world."""

    def __init__(self, viewer: "Viewer") -> None:
        self.viewer = viewer
        self.hand: MouseHand | None = None  # while it holds something
        self.pads: dict[str, tuple[float, float]] = {}  # name -> balance, power as last put there
        self.told: deque[str] = deque(maxlen=REMEMBERED)  # the last reactions, newest first
        self.marks = Marks(self)
        self._known: World | None = None
        self._unfold = False

    @property
    def world(self) -> World | None:
        """None: nothing of what is open can be touched, or its colliders are being made."""
        return self.viewer.state.world

    @property
    def held(self) -> str | None:
        return self.world.held(HAND) if self.world and self.hand else None

    def forget(self) -> None:
        """Another scene: nothing of the old one is held or told."""
        self.hand = self._known = None
        self.pads.clear()
        self.told.clear()
        self.marks.forget()

    def opens(self) -> bool:
        """Once for every world: its section unfolds."""
        unfold, self._unfold = self._unfold, False
        return unfold

    def meet(self, world: World) -> None:
        """The bodies of what was opened are there, or there anew on another floor."""
        if self._known is None:
            self._unfold, world.paused = True, not self.opens_playing
            if self.opens_playing:
                self.viewer.say(HOW, HOW_S)
        self._known = world

    @property
    def opens_playing(self) -> bool:
        """The scene that the program brings along is there to be touched, not edited."""
        path = self.viewer.state.document.path
        return self.viewer.options.play or (path is not None and is_bundled(path))

    def status(self) -> str:
        """Words for the status line."""
        if self.held:
            return f"carrying {self.held}"
        if self.world is None:
            return ""
        return STILL if self.world.paused else MOVING

    # ---- input

    def take(self, event: Event) -> bool:
        """True for what concerns the hand, its ray and the physics."""
        if self.world is None:
            return False
        if isinstance(event, KeyDown):
            return self.press_key(event)
        if self.hand is None:
            return isinstance(event, Press) and event.button == "left" and self.grab(event)
        match event:
            case Drag(button="left"):
                self.drag(event.dx, event.dy)
            case Wheel():
                self.turn_wheel(event.notches)
            case Release(button="left"):
                self.let_go()
            case Press() | DoubleClick():  # another button, or the camera is meant
                self.let_go()
                return False
            case _:
                return False
        return True

    def press_key(self, event: KeyDown) -> bool:
        match event.key:
            case glfw.KEY_T if event.shift:
                self.step()
            case glfw.KEY_T:
                self.toggle()
            case glfw.KEY_R:
                self.put_back()
            case glfw.KEY_X:
                self.shoot()
            case glfw.KEY_J:
                self.marks.colliders = not self.marks.colliders
            case glfw.KEY_ESCAPE if self.hand is not None:
                self.let_go()
            case _:
                return False
        return True

    def grab(self, press: Press) -> bool:
        """Takes what lies under the mouse, if it can be carried."""
        viewer = self.viewer
        regions = viewer.state.regions
        if self.world.paused or is_painting(viewer) or regions.placing:
            return False
        view, size = viewer.view(), viewer.window.logical_size
        name = self.under(view, (press.x, press.y))
        if name is None:
            return False
        middle = middle_of(self.world.things[name])  # about which it is turned
        self.hand = take(view, size, middle)
        self.world.move_hand(HAND, pose(self.hand, view, size))
        self.world.grab_body(HAND, name, middle)
        viewer.state.chosen = name
        return True

    def under(self, view: View, place: tuple[float, float]) -> str | None:
        """What could be carried that lies under a place of the picture, logical pixels."""
        hit = self.world.aim(*ray(view, place, self.viewer.window.logical_size))
        thing = self.world.things.get(hit.object) if hit else None
        return hit.object if thing is not None and thing.moves else None

    def drag(self, dx: float, dy: float) -> None:
        viewer = self.viewer
        if self.shift:
            self.hand = turned(self.hand, dx, dy, viewer.view())
        else:
            self.hand = moved(self.hand, dx, dy, viewer.window.logical_size)

    def turn_wheel(self, notches: float) -> None:
        view = self.viewer.view()
        self.hand = (rolled if self.shift else pushed)(self.hand, notches, view)

    @property
    def shift(self) -> bool:
        held = self.viewer.window.held
        return bool(held(glfw.KEY_LEFT_SHIFT) or held(glfw.KEY_RIGHT_SHIFT))

    def let_go(self) -> None:
        """What the mouse holds flies on."""
        if self.hand is not None and self.world is not None:
            self.world.release(HAND)
        self.hand = None

    # ---- the world

    def toggle(self) -> None:
        """Lets things move, or holds them still."""
        self.let_go()
        self.world.paused = not self.world.paused
        self.viewer.say("Things hold still. T lets them move." if self.world.paused else HOW)

    def step(self) -> None:
        """One step by hand; things hold still after it."""
        self.let_go()
        self.world.paused = True
        self.follow([self.world.step()])

    def put_back(self) -> None:
        """Everything where it was before it was touched."""
        self.let_go()
        state = self.viewer.state
        state.bodies.follow(state.document)  # edits that the world has not heard of
        put_back(self.world)
        self.follow([])

    def control(self, name: str, x: Control) -> None:
        """A pad puts an object's x there."""
        state = self.viewer.state
        names = [thing.name for thing in state.scene.objects]
        steer(state, names.index(name), x)

    def shoot(self) -> None:
        """A ray from the eye through the mouse: what it meets answers."""
        viewer = self.viewer
        if not viewer.window.on_scene:
            return
        hit = self.world.ray(*ray(viewer.view(), viewer.window.cursor, viewer.window.logical_size))
        if hit is not None:
            self.marks.flashes.append(Flash(hit.point))
        if self.world.paused:  # nobody else would let it answer
            self.step()

    def each_frame(self) -> bool:
        """Moves the hand and lets time pass; True while a mark has yet to fade."""
        world, viewer = self.world, self.viewer
        if world is None:
            self.hand = None
            if viewer.state.bodies.busy and self.opens_playing:
                viewer.say("Getting things ready to be touched \u2026")
            return False
        if world is not self._known:
            self.meet(world)
        if self.hand is not None and world.held(HAND) is None:
            self.hand = None  # what it held is gone
        if self.hand is not None:
            world.move_hand(HAND, pose(self.hand, viewer.view(), viewer.window.logical_size))
        records = world.advance(viewer.seconds)
        if not world.paused:
            self.follow(records)
        self.marks.fade(viewer.seconds)
        return self.marks.fading and viewer.options.screenshot is None

    def follow(self, records: list[Record]) -> None:
        """Shows where things are now, and what has answered."""
        self.viewer.state.follow_world()
        for record in records:
            for event in record.events:
                after = event["to"] or f"x {event['x']:.2f}"
                self.told.appendleft(f"{event['object']}: {WORDS[event['on']]}, now {after}")
                self.marks.labels.append(Label(event["object"], after))
