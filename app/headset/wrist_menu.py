"""The panel of a headset with its scene: what it tells of the world, and its wishes granted."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from shapeshift.app.headset.xr_user import XrState
from shapeshift.scene.document.scene_file import named_stops
from shapeshift.scene.world.follow import reset_objects
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

HINT = "menu button or palm up: open, close    stick: slide"


@dataclass(frozen=True)
class MenuActions:
    """What the menu asks of the session that it is in."""

    recentre: Callable[[Frame], None]
    leave: Callable[[str], None]  # why
    pulse: Callable[[str, float, float], None]  # side, strength, seconds


class WristMenu:
    """Keeps the panel between frames; `carried` is what is drawn."""

    def __init__(self, state: XrState, actions: MenuActions, hand: str = "left") -> None:
        self._state, self._actions = state, actions
        self.carried = Carried(home=hand)
        self._held: dict[str, str | None] = {}

    def act(self, frame: Frame, seconds: float) -> Frame:
        """What hands do to the panel, and what it wishes; the frame with what it leaves of them."""
        facts = facts_of(self._state, HINT)
        self._follow_hands(facts)
        self.carried, wishes, hands = carry(self.carried, facts, frame, seconds)
        for wish in wishes:
            grant(wish, self._state, self._actions, frame)
        return replace(frame, hands=hands)

    def _follow_hands(self, facts: Facts) -> None:
        """The slider of what a hand takes is the one that is shown."""
        held = dict(self._state.user.touched.held)
        names = {slider.name for slider in facts.sliders}
        for side, name in held.items():
            if name in names and self._held.get(side) != name:
                panel = replace(self.carried.panel, chosen=name)
                self.carried = replace(self.carried, panel=panel)
        self._held = held


def facts_of(state: XrState, note: str = "") -> Facts:
    """What the panel tells in this frame."""
    scale, floor = state.standing.scale, state.floor_shown
    return Facts(sliders_of(state.world), state.pacing.quality, scale, note, floor)


def sliders_of(world: World) -> tuple[Slider, ...]:
    """Of the objects that are seen and have somewhere to go, in the scene's order."""
    return tuple(
        Slider(name, stops, thing.drawn.model.blend.slider_x(thing.reaction_state.x))
        for name, thing in world.objects.items()
        if thing.drawn.visible and len(stops := named_stops(thing.item, thing.drawn.model)) > 1
    )


def grant(wish: Wish, state: XrState, actions: MenuActions, frame: Frame) -> None:
    """One wish of the panel."""
    match wish:
        case SetX(name, x):
            state.world.control(name, x)
        case SetQuality(name):
            state.pacing.quality = name
        case SetScale(scale):
            state.standing = resized(state.standing, frame.head, scale)
            state.user.jumped()
        case Recentre():
            actions.recentre(frame)
        case PutBack():
            reset_objects(state.world)
        case SetFloor(shown):
            state.floor_shown = shown
        case Exit():
            actions.leave("from the panel")
        case Pulse(side, strength, seconds):
            actions.pulse(side, strength, seconds)
