"""The panel of a headset with its scene: what it tells of the world, and its wishes granted."""

from dataclasses import replace
from typing import TYPE_CHECKING

from shapeshift.scene.document.scene_file import named_stops
from shapeshift.scene.world.follow import put_back
from shapeshift.scene.world.world import World
from shapeshift.vr.frame import Frame
from shapeshift.vr.locomotion.stance import resized
from shapeshift.vr.panel.carried import Carried, carry
from shapeshift.vr.panel.panel_state import (
    Exit,
    Facts,
    Pulse,
    PutBack,
    Recentre,
    SetFloor,
    SetQuality,
    SetScale,
    SetX,
    Slider,
    Wish,
)

if TYPE_CHECKING:
    from shapeshift.app.headset.wearing import Wearing

HINT = "menu button or palm up: open, close    stick: slide"


class WornPanel:
    """Keeps the panel between frames; `carried` is what is drawn."""

    def __init__(self, hand: str = "left") -> None:
        self.carried = Carried(home=hand)
        self._held: dict[str, str | None] = {}

    def act(self, wearing: "Wearing", frame: Frame, seconds: float) -> Frame:
        """What hands do to the panel, and what it wishes; the frame with what it leaves of them."""
        facts = facts_of(wearing, HINT)
        self._follow_hands(wearing, facts)
        self.carried, wishes, hands = carry(self.carried, facts, frame, seconds)
        for wish in wishes:
            grant(wish, wearing, frame)
        return replace(frame, hands=hands)

    def _follow_hands(self, wearing: "Wearing", facts: Facts) -> None:
        """The slider of what a hand takes is the one that is shown."""
        held = dict(wearing.person.touched.held)
        names = {slider.name for slider in facts.sliders}
        for side, name in held.items():
            if name in names and self._held.get(side) != name:
                panel = replace(self.carried.panel, chosen=name)
                self.carried = replace(self.carried, panel=panel)
        self._held = held


def facts_of(wearing: "Wearing", note: str = "") -> Facts:
    """What the panel tells in this frame."""
    scale, floor = wearing.standing.scale, wearing.floor_shown
    return Facts(sliders_of(wearing.world), wearing.pacing.quality, scale, note, floor)


def sliders_of(world: World) -> tuple[Slider, ...]:
    """Of the objects that are seen and have somewhere to go, in the scene's order."""
    return tuple(
        Slider(name, stops, thing.drawn.model.blend.place(thing.standing.x))
        for name, thing in world.things.items()
        if thing.drawn.visible and len(stops := named_stops(thing.item, thing.drawn.model)) > 1
    )


def grant(wish: Wish, wearing: "Wearing", frame: Frame) -> None:
    """One wish of the panel."""
    match wish:
        case SetX(name, x):
            wearing.world.control(name, x)
        case SetQuality(name):
            wearing.pacing.quality = name
        case SetScale(scale):
            wearing.standing = resized(wearing.standing, frame.head, scale)
            wearing.person.jumped()
        case Recentre():
            wearing.recentre(frame)
        case PutBack():
            put_back(wearing.world)
        case SetFloor(shown):
            wearing.floor_shown = shown
        case Exit():
            wearing.leave("from the panel")
        case Pulse(side, strength, seconds):
            wearing.pulse(side, strength, seconds)
