"""The panel from frame to frame: when it is open, where it hangs, what hands do to it.

A menu button opens it, and so does the palm of the hand that carries it, turned up as one looks at
a watch, for as long as it is.
"""

from dataclasses import dataclass, field, replace

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import SIDES, Frame, Hand
from shapeshift.vr.panel.panel import press, push, taken
from shapeshift.vr.panel.panel_layout import TRACK, knob_place, lay_out
from shapeshift.vr.panel.panel_place import NOBODY, Pointing, hang, play_point, point_at
from shapeshift.vr.panel.panel_state import Facts, Panel, Place, Wish, shown_stop

PALM_UP, PALM_AWAY = 0.8, 0.55  # of a palm's normal, up: it opens the panel; it closes it again
OPENS_S, CLOSES_S = 0.2, 0.4  # so long
LOOSE = 0.3  # of a squeeze: a hand that holds something turns as it must


@dataclass(frozen=True)
class Palm:
    """Of the hand that carries the panel."""

    up: bool = False
    doubt_s: float = 0.0  # so long it has been the other way
    done: bool = False  # the panel was put away while it is up: it has to turn away first


@dataclass(frozen=True)
class Carried:
    """A panel and where it is; closed at first, so that the scene is what one sees."""

    panel: Panel = field(default_factory=Panel)
    home: str = "left"  # the hand that carries it
    pinned: bool = False  # open by a menu button, until that closes it
    palm: Palm = Palm()
    play_from_panel: Pose | None = None
    pointing: Pointing = NOBODY
    places: dict[str, Place] = field(default_factory=dict)  # side -> where it points, pixels
    menus: frozenset[str] = frozenset()  # sides whose menu button was down


def carry(
    carried: Carried, facts: Facts, frame: Frame, seconds: float
) -> tuple[Carried, list[Wish], dict[str, Hand]]:
    """One frame of `seconds`: the panel, its wishes, and the hands without what it takes of them.

    Those are for the world: a trigger that presses a button here fires nothing there.
    """
    carried = _opened(carried, frame.hands, seconds)
    panel = replace(carried.panel, facts=facts)
    carried = replace(carried, panel=panel)
    if not panel.open:
        panel, _ = press(panel, [])
        carried = replace(carried, play_from_panel=None, pointing=NOBODY, places={})
        return replace(carried, panel=panel), [], dict(frame.hands)
    layout = lay_out(panel)
    before = None if frame.recentred else carried.play_from_panel
    hand = frame.hands[panel.side]
    pose = hang(before, hand, frame.head, layout.size_m, seconds, panel.side)
    pointing, pointers = point_at(carried.pointing, pose, layout, frame.hands, panel.side)
    panel, wishes = press(panel, pointers, seconds)
    panel, more = push(panel, frame.hands[panel.side].stick, seconds)
    places = {pointer.side: pointer.at for pointer in pointers if pointer.at is not None}
    carried = replace(carried, panel=panel, play_from_panel=pose, pointing=pointing, places=places)
    return carried, wishes + more, left_over(carried, frame.hands)


def left_over(carried: Carried, hands: dict[str, Hand]) -> dict[str, Hand]:
    """The hands with what the panel takes of them at rest."""
    panel, left = carried.panel, dict(hands)
    for side in taken(panel):
        grasps = side in carried.pointing.near - carried.pointing.full
        squeeze = 0.0 if grasps else hands[side].squeeze
        left[side] = replace(hands[side], trigger=0.0, squeeze=squeeze)
    if panel.open and panel.stick in ("slides", "rests"):
        left[panel.side] = replace(left[panel.side], stick=(0.0, 0.0))
    return left


def _opened(carried: Carried, hands: dict[str, Hand], seconds: float) -> Carried:
    """Open or closed, by a menu button of whichever hand has one, or by the palm.

    While a hand holds something of the panel, or points at it, it stays.
    """
    panel, palm = carried.panel, turned(carried.palm, carried.home, hands[carried.home], seconds)
    pinned = carried.pinned
    menus = frozenset(side for side in SIDES if hands[side].menu)
    if menus - carried.menus:
        pinned, palm = not panel.open, replace(palm, done=panel.open and palm.up)
        wanted = pinned
    else:
        in_use = panel.open and bool(panel.held or panel.hovers)
        wanted = pinned or (palm.up and not palm.done) or in_use
    if wanted != panel.open:
        side = carried.home if wanted else ""
        panel = replace(panel, side=side, hovers={}, held={}, stick="", exit_s=0.0)
    return replace(carried, panel=panel, pinned=pinned, palm=palm, menus=menus)


def turned(palm: Palm, side: str, hand: Hand, seconds: float) -> Palm:
    """Whether an open hand's palm is turned up, without trembling between yes and no."""
    up = False
    if hand.grip is not None and hand.squeeze < LOOSE:
        # OpenXR's grip: +X comes out of the left palm and goes into the right one.
        normal = hand.grip.matrix()[1, 0] * (1.0 if side == SIDES[0] else -1.0)
        up = bool(normal >= (PALM_AWAY if palm.up else PALM_UP))
    if up == palm.up:
        return replace(palm, doubt_s=0.0, done=palm.done and up)
    doubt_s = palm.doubt_s + seconds
    if doubt_s < (OPENS_S if up else CLOSES_S):
        return replace(palm, doubt_s=doubt_s)
    return Palm(up, 0.0, palm.done and up)


def panel_row(carried: Carried) -> dict:
    """What a line of a report says of the panel: which stop is shown, and where in the room, (3,)
    metres, its knob, the ends of its slider and the middles of its buttons are.
    """
    panel, pose, slider = carried.panel, carried.play_from_panel, carried.panel.slider
    row = {"open": panel.open, "hand": panel.side, "shown": shown_stop(slider) if slider else ""}
    if pose is None:
        return row
    layout = lay_out(panel)

    def place(at: Place) -> list[float]:
        return [round(float(number), 6) for number in play_point(pose, layout, at)]

    row["object"] = slider.name if slider else ""
    row["taken"] = sorted(taken(panel))
    if slider is not None:
        row["knob"] = place(knob_place(panel))
        row["slider"] = [place((x, layout.track_y)) for x in TRACK]
    row["buttons"] = {
        item.name: place(((item.box[0] + item.box[2]) / 2, (item.box[1] + item.box[3]) / 2))
        for item in layout.items
        if item.name not in ("track", "size")
    }
    return row
