"""Touching a scene: its world played and stepped, what a hand holds, what has just answered."""

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shapeshift.app.editor.state.arrange import steer
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.app.paths import is_bundled
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.world.follow import reset_objects
from shapeshift.scene.world.grab import MouseHand
from shapeshift.scene.world.record import Record
from shapeshift.scene.world.settle import begin
from shapeshift.scene.world.world import World

HAND = "mouse"
HOW, HOW_S = "Drag an object. X shoots. T stops.", 9.0  # said once, for so many seconds
STILL, MOVING = "objects hold still: T lets them move", "drag an object, X shoots, T stops"
KEPT = "objects move as soon as they have bodies"
NO_BODIES = "Nothing here can be touched: cut an object out first, with O."
REMEMBERED = 6  # reactions that the panel lists
WORDS = {"collision": "struck", "grab": "taken", "ray": "hit by a ray", "enter": "arrived"}
LABEL_S, FLASH_S = 1.8, 0.4  # how long they are seen


@dataclass
class Label:
    """What an object has just become."""

    object: str
    text: str
    age_s: float = 0.0


@dataclass
class Flash:
    """Where a ray met something."""

    point: np.ndarray  # (3,) metres, world
    age_s: float = 0.0


class TouchState:
    """What the mouse holds, and what has just happened in the scene's world."""

    def __init__(self, state: EditorState, play: bool, keys: bool = True) -> None:
        """`play`: every scene opens with its objects in motion, not only the bundled one; `keys`:
        there is a keyboard, and notes name its keys.
        """
        self._state, self.play, self._keys = state, play, keys
        self.hand: MouseHand | None = None  # while it holds something
        self.pads: dict[str, tuple[float, float]] = {}  # name -> balance, power as last put there
        self.reactions: deque[str] = deque(maxlen=REMEMBERED)  # the last reactions, newest first
        self.colliders = False  # they are shown
        self.labels: list[Label] = []
        self.flashes: list[Flash] = []
        state.renamed.append(self._rename)
        self._known: World | None = None
        self._unfold = False
        self.wanted = False  # that objects move, as soon as they have bodies

    @property
    def world(self) -> World | None:
        """None: nothing of what is open can be touched, or its colliders are being made."""
        return self._state.world

    @property
    def living(self) -> World:
        """The world, for who has seen that there is one."""
        return self._state.bodies.living

    @property
    def held(self) -> str | None:
        return self.world.held(HAND) if self.world and self.hand else None

    @property
    def chosen(self) -> str:
        """Name of the object that is edited."""
        return self._state.chosen

    def forget(self) -> None:
        """Another scene: nothing of the old one is held or listed."""
        self.hand, self._known, self.wanted = None, None, False
        self.pads.clear()
        self.reactions.clear()
        self.labels.clear()
        self.flashes.clear()

    def _rename(self, names: Mapping[str, str]) -> None:
        """Objects of the scene have other names."""
        self.pads = {names.get(name, name): pad for name, pad in self.pads.items()}

    def opens(self) -> bool:
        """Once for every world: its section unfolds."""
        unfold, self._unfold = self._unfold, False
        return unfold

    def meet(self, world: World) -> None:
        """The bodies of what was opened are there, or there anew on another floor."""
        if self._known is None:
            plays = (self.opens_playing or self.wanted) and self.begin(world)
            self._unfold, world.paused = True, not plays
            if plays:
                self._say(said(HOW), HOW_S)
        self._known, self.wanted = world, False

    @property
    def opens_playing(self) -> bool:
        """The scene that the program brings along is there to be touched, not edited."""
        path = self._state.edited.path
        return self.play or (path is not None and is_bundled(path))

    def status(self) -> str:
        """Words for the status line."""
        if self.held:
            return said("carrying {name}", name=self.held)
        if self.world is None:
            return said(KEPT) if self.wanted else ""
        return said(STILL if self.world.paused else MOVING)

    def release(self) -> None:
        """What the mouse holds flies on."""
        if self.hand is not None and self.world is not None:
            self.world.release(HAND)
        self.hand = None

    def toggle(self) -> None:
        """Lets objects move, or holds them still; before they have bodies that is kept for then."""
        self.release()
        world = self.world
        if world is None:
            self._ask_for_bodies()
            return
        if world.paused and not self.begin(world):
            return
        world.paused = not world.paused
        self._say(said("Objects hold still. T lets them move.") if world.paused else said(HOW))

    def _ask_for_bodies(self) -> None:
        """T too early: it is kept and said, a second one takes it back; or why it never can be."""
        bodies = self._state.bodies
        if not bodies.pending:
            self._say(said(bodies.why_none or NO_BODIES))
            return
        self.wanted = not self.wanted
        if self.wanted:
            self._say(said("Objects get their bodies: {status}. They move then.",
                           status=bodies.status), HOW_S)  # fmt: skip
        else:
            self._say(said("Objects hold still. T lets them move."))

    def begin(self, world: World) -> bool:
        """Nothing starts inside another thing; False, and a sentence, where it would."""
        try:
            begin(world)
        except BadFile as error:
            self._state.problem = str(error)
            return False
        return True

    def _say(self, text: str, seconds: float | None = None) -> None:
        if self._keys:
            self._state.say(text, seconds)

    def step(self) -> None:
        """One step by hand; objects hold still after it."""
        self.release()
        if self.world is not None:
            self.world.paused = True
            self.follow([self.world.step()])

    def reset_objects(self) -> None:
        """Everything where it was before it was touched."""
        self.release()
        state = self._state
        state.bodies.follow(state.edited)  # edits that the world has not heard of
        if self.world is not None:
            reset_objects(self.world)
            self.follow([])

    def control(self, name: str, x: Control) -> None:
        """A pad puts an object's x there."""
        names = [obj.name for obj in self._state.scene.objects]
        steer(self._state, names.index(name), x)

    def meet_world(self) -> bool:
        """Once a frame, before time passes; False while nothing can be touched."""
        world = self.world
        if world is None:
            self.hand = None
            if self.wanted and not self._state.bodies.pending:
                self.wanted = False
                self._say(said(self._state.bodies.why_none or NO_BODIES))
            if self._state.bodies.busy and self.opens_playing:
                self._state.messages.hold(
                    said("Getting objects ready to be touched \u2026"), time.perf_counter()
                )
            return False
        if world is not self._known:
            self.meet(world)
        if self.hand is not None and world.held(HAND) is None:
            self.hand = None  # what it held is gone
        return True

    def advance(self, seconds: float) -> list[Record]:
        """Lets time pass in the world, and for what fades over it; what happened."""
        world = self.world
        records: list[Record] = []
        if world is not None:
            records = world.advance(seconds)
            if not world.paused:
                self.follow(records)
        marks: tuple[Label | Flash, ...] = (*self.labels, *self.flashes)
        for mark in marks:
            mark.age_s += seconds
        self.labels = [label for label in self.labels if label.age_s < LABEL_S]
        self.flashes = [flash for flash in self.flashes if flash.age_s < FLASH_S]
        return records

    @property
    def fading(self) -> bool:
        return bool(self.labels or self.flashes)

    def follow(self, records: list[Record]) -> None:
        """Shows where objects are now, and what has answered."""
        self._state.follow_world()
        for record in records:
            for event in record.events:
                after = event["to"] or f"x {event['x']:.2f}"
                self.reactions.appendleft(f"{event['object']}: {WORDS[event['on']]}, now {after}")
                self.labels.append(Label(event["object"], after))
