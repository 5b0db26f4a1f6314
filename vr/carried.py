"""The panel from frame to frame: the menu button, where it hangs, what hands do to it."""

from dataclasses import dataclass, field, replace

from scene.pose import Pose
from vr.frame import SIDES, Frame, Hand
from vr.panel import press, push, taken
from vr.panel_layout import TRACK, knob_place, lay_out
from vr.panel_place import NOBODY, Pointing, hang, play_point, point_at
from vr.panel_state import Facts, Panel, Place, Wish, shown_stop


@dataclass(frozen=True)
class Carried:
    """A panel and where it is; open at first, so that everybody finds it."""

    panel: Panel = field(default_factory=lambda: Panel(side="left"))
    home: str = "left"  # the hand that carries it
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
    panel = replace(_toggled(carried, frame.hands), facts=facts)
    menus = frozenset(side for side in SIDES if frame.hands[side].menu)
    carried = replace(carried, panel=panel, menus=menus)
    if not panel.open:
        panel, _ = press(panel, [])
        carried = replace(carried, play_from_panel=None, pointing=NOBODY, places={})
        return replace(carried, panel=panel), [], dict(frame.hands)
    layout = lay_out(panel)
    before = None if frame.recentred else carried.play_from_panel
    pose = hang(before, frame.hands[panel.side], frame.head, layout.size_m, seconds)
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


def _toggled(carried: Carried, hands: dict[str, Hand]) -> Panel:
    """A menu button, of whichever hand has one, closes it and opens it on its hand."""
    panel = carried.panel
    if any(hands[side].menu and side not in carried.menus for side in SIDES):
        side = "" if panel.open else carried.home
        panel = replace(panel, side=side, hovers={}, held={}, stick="", exit_s=0.0)
    return panel


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
