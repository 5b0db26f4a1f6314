"""The panel of a headset with its scene: what it tells of the world, and its wishes granted."""

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

from scene.follow import put_back
from scene.scene_file import named_stops
from scene.world import World
from vr.carried import Carried, carry
from vr.frame import Frame
from vr.panel_state import (
    Exit,
    Facts,
    Panel,
    Pulse,
    PutBack,
    Recentre,
    SetQuality,
    SetScale,
    SetX,
    Slider,
    Wish,
)
from vr.stance import resized

if TYPE_CHECKING:
    from app.headset.wearing import Wearing

HINT = "menu button: open, close    stick: slide"  # where nothing else is to be said
LATE_S = 2.0  # so long it is said that frames were late
LATE = 3  # frames within that time; fewer are nobody's business
ADVICE = {"best": ": try Auto", "balanced": ": try Auto or Fast"}  # by the quality that is chosen


class WornPanel:
    """Keeps the panel between frames; `carried` is what is drawn."""

    def __init__(self, hand: str = "left") -> None:
        self.carried = Carried(Panel(side=hand), hand)
        self._dropped: deque[tuple[float, int]] = deque()  # when, and how many until then
        self._held: dict[str, str | None] = {}

    def act(self, wearing: "Wearing", frame: Frame, seconds: float) -> Frame:
        """What hands do to the panel, and what it wishes; the frame with what it leaves of them."""
        facts = facts_of(wearing, self._note(wearing, frame.seen_s))
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

    def _note(self, wearing: "Wearing", now_s: float) -> str:
        """The lowest line: where frames are late that; few of them nobody wants to hear of.

        There always is one, or else the panel would change its height under a pointing hand.
        """
        seen = self._dropped
        seen.append((now_s, wearing.session.pace.dropped))
        while seen[0][0] < now_s - LATE_S:
            seen.popleft()
        late = seen[-1][1] - seen[0][1] >= LATE
        return f"frames are late{ADVICE.get(wearing.pacing.quality, '')}" if late else HINT


def facts_of(wearing: "Wearing", note: str = "") -> Facts:
    """What the panel tells in this frame."""
    return Facts(sliders_of(wearing.world), wearing.pacing.quality, wearing.standing.scale, note)


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
        case Exit():
            wearing.leave("from the panel")
        case Pulse(side, strength, seconds):
            wearing.pulse(side, strength, seconds)
