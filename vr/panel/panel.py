"""What hands do to the panel in the room, as a pure step: pointers in, wishes out.

panel_state.py says what it tells, panel_layout.py what lies where, panel_picture.py draws it,
panel_place.py hangs it on a hand.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from shapeshift.scene.control import snap
from shapeshift.vr.panel.panel_layout import KNOB, REACH, TRACK, item_at, knob_place
from shapeshift.vr.panel.panel_state import (
    ON_STOP,
    Exit,
    Panel,
    Place,
    Pulse,
    PutBack,
    Recentre,
    SetFloor,
    SetQuality,
    SetScale,
    SetX,
    Wish,
)

SIZES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)
EXIT_S = 4.0  # Exit asks once more for so long
TICK = (0.25, 0.012)  # strength and seconds of the buzz when something is pointed at
CLICK = (0.6, 0.025)  # when it is pressed, and when the knob comes to a stop
DEAD = 0.2  # of the thumbstick's way
STICK_SPEED = 0.6  # of the slider's range a second, stick at its end


@dataclass(frozen=True)
class Pointer:
    """Where a hand points at the plane of the panel; beside the panel too."""

    side: str  # of vr.frame.SIDES
    at: Place | None  # None: away from the plane
    down: bool = False  # presses: trigger, a squeeze at close range, a finger that touches
    unsure: bool = False  # it was away: where it began to press is not known


def press(
    panel: Panel, pointers: Sequence[Pointer], seconds: float = 0.0
) -> tuple[Panel, list[Wish]]:
    """What the hands do to an open panel in one frame of `seconds`; a hand left out lets go."""
    sides = {pointer.side for pointer in pointers} if panel.open else set()
    panel = replace(
        panel,
        exit_s=max(panel.exit_s - seconds, 0.0) if panel.open else 0.0,
        hovers={side: name for side, name in panel.hovers.items() if side in sides},
        held={side: name for side, name in panel.held.items() if side in sides},
        elsewhere=panel.elsewhere & sides,
    )
    wishes: list[Wish] = []
    for pointer in pointers if panel.open else ():
        panel, more = _pointed(panel, pointer)
        wishes += more
    return panel, wishes


def push(panel: Panel, stick: tuple[float, float], seconds: float) -> tuple[Panel, list[Wish]]:
    """The thumbstick of the hand that carries the panel: sideways it moves x, and rests at every
    stop; first pushed ahead or back it is not the panel's until it is let go.
    """
    slider, (aside, ahead) = panel.slider, stick
    if slider is None or not panel.open or not max(abs(aside), abs(ahead)) > DEAD:
        return replace(panel, stick=""), []
    if not panel.stick:
        panel = replace(panel, stick="slides" if abs(aside) > abs(ahead) else "walks")
    if panel.stick != "slides" or not abs(aside) > DEAD or "track" in panel.held.values():
        return panel, []
    speed = (min(abs(aside), 1.0) - DEAD) / (1 - DEAD) * STICK_SPEED
    moved = min(max(slider.x + (speed if aside > 0 else -speed) * seconds, 0.0), 1.0)
    low, high = sorted((slider.x, moved))
    passed = [s.x for s in slider.stops if low <= s.x <= high and abs(s.x - slider.x) > ON_STOP]
    if not passed:
        return panel, [SetX(slider.name, moved)] if moved != slider.x else []
    stop_x = min(passed, key=lambda x: abs(x - slider.x))
    wishes = [SetX(slider.name, stop_x), Pulse(panel.side, *CLICK)]
    return replace(panel, stick="rests"), wishes


def taken(panel: Panel) -> frozenset[str]:
    """The sides whose presses are the panel's: they point at it and did not press before."""
    return frozenset(panel.held) | (frozenset(panel.hovers) - panel.elsewhere)


def _pointed(panel: Panel, pointer: Pointer) -> tuple[Panel, list[Wish]]:
    """One hand: it drags, lets go, points, presses."""
    side = pointer.side
    if side in panel.held and pointer.down:
        return panel, _dragged(panel, pointer) if panel.held[side] == "track" else []
    held = {other: name for other, name in panel.held.items() if other != side}
    panel = replace(panel, held=held)
    item = item_at(panel, pointer.at) if pointer.at is not None else ""
    if not pointer.down:
        panel = replace(panel, elsewhere=panel.elsewhere - {side})
    elif not item or pointer.unsure:
        panel = replace(panel, elsewhere=panel.elsewhere | {side})
    hovers = {other: name for other, name in panel.hovers.items() if other != side}
    wishes: list[Wish] = []
    if item:
        hovers[side] = item
        if item not in ("plate", panel.hovers.get(side)):
            wishes.append(Pulse(side, *TICK))
    panel = replace(panel, hovers=hovers)
    if not pointer.down or not item or side in panel.elsewhere:
        return panel, wishes
    panel = replace(panel, held={**panel.held, side: item})
    panel, more = _pressed(panel, pointer, item)
    return panel, wishes + more


def _pressed(panel: Panel, pointer: Pointer, item: str) -> tuple[Panel, list[Wish]]:
    """What an item does the moment that it is pressed."""
    click = Pulse(pointer.side, *CLICK)
    if item == "plate":
        return panel, []
    if item == "track":
        others = {s: n for s, n in panel.held.items() if n != item} | {pointer.side: item}
        away = knob_place(panel)[0] - pointer.at[0]
        grip_px = away if abs(away) <= KNOB * REACH else 0.0  # beside the knob: it jumps there
        panel = replace(panel, held=others, grip_px=grip_px)
        return panel, [click, *_dragged(panel, pointer)]
    if item == "exit":
        wishes = [Exit()] if panel.exit_s > 0 else []
        return replace(panel, exit_s=0.0 if wishes else EXIT_S), [click, *wishes]
    panel = replace(panel, exit_s=0.0)
    if item in ("previous", "next"):
        names = [slider.name for slider in panel.facts.sliders]
        step = 1 if item == "next" else -1
        place = (names.index(panel.slider.name) + step) % len(names)
        return replace(panel, chosen=names[place]), [click]
    if item.startswith("quality:"):
        return panel, [click, SetQuality(item.removeprefix("quality:"))]
    wish = {
        "recentre": Recentre(), "put back": PutBack(), "true": SetScale(1.0),
        "floor": SetFloor(not panel.facts.floor),
    }.get(item)  # fmt: skip
    return panel, [click, wish or SetScale(_next_scale(panel.facts.scale, item == "larger"))]


def _dragged(panel: Panel, pointer: Pointer) -> list[Wish]:
    """The knob follows the hand and catches at stops."""
    slider = panel.slider
    if slider is None or pointer.at is None:
        return []
    place = (pointer.at[0] + panel.grip_px - TRACK[0]) / (TRACK[1] - TRACK[0])
    x = snap(place, slider.stops)
    if x == slider.x:
        return []
    on_stop = any(abs(stop.x - x) <= ON_STOP for stop in slider.stops)
    return [SetX(slider.name, x), *([Pulse(pointer.side, *CLICK)] if on_stop else [])]


def _next_scale(scale: float, larger: bool) -> float:
    """The next size of SIZES; larger looking means fewer metres of the world in the room."""
    size, slack = 1 / scale, 1.001
    if larger:
        return 1 / next((s for s in SIZES if s > size * slack), max(size, SIZES[-1]))
    return 1 / next((s for s in reversed(SIZES) if s * slack < size), min(size, SIZES[0]))
