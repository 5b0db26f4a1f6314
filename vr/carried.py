"""The panel from frame to frame: when it is open, where it hangs, what hands do to it.

A menu button opens it, and so does the palm of the hand that carries it, turned up as one looks at
a watch, for as long as it is.  What is on it is not known here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from shapeshift.runtime_models.model import Stop
from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import SIDES, Frame, Hand
from shapeshift.vr.plane import NOBODY, PanelPlane, Pointing, hang, point

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

    plane: PanelPlane
    home: str = "left"  # the hand that carries it
    open: bool = False
    pinned: bool = False  # open by a menu button, until that closes it
    palm: Palm = Palm()
    play_from_panel: Pose | None = None
    pointing: Pointing = NOBODY
    sticks: dict[str, str] = field(default_factory=dict)  # side -> what its stick does
    menus: frozenset[str] = frozenset()  # sides whose menu button was down

    @property
    def pointer(self) -> str:
        """The side of the hand that points at it."""
        return SIDES[1 - SIDES.index(self.home)]

    @property
    def on_panel(self) -> bool:
        """Whether the pointing hand is over it, or holds something of it."""
        return self.open and (self.pointing.pressing or self.plane.holds(self.pointing.at))

    @property
    def taken(self) -> bool:
        """Whether the pointing hand's presses are the panel's."""
        return self.on_panel and not self.pointing.elsewhere


def carry(carried: Carried, frame: Frame, seconds: float) -> Carried:
    """One frame of `seconds`: open or closed, where it hangs, where the other hand points."""
    carried = _opened(carried, frame.hands, seconds)
    if not carried.open:
        return replace(carried, play_from_panel=None, pointing=NOBODY, sticks={})
    before = None if frame.recentred else carried.play_from_panel
    hand, plane = frame.hands[carried.home], carried.plane
    pose = hang(before, hand, frame.head, plane.size_m, seconds, carried.home)
    side = carried.pointer
    pointing = point(carried.pointing, pose, plane, side, frame.hands[side])
    return replace(carried, play_from_panel=pose, pointing=pointing)


def left_over(carried: Carried, hands: dict[str, Hand]) -> dict[str, Hand]:
    """The hands for the world, with what the panel takes of them at rest: a trigger that presses a
    button there fires nothing here.
    """
    left = dict(hands)
    if carried.taken:
        hand = left[carried.pointer]
        grasps = carried.pointing.near and not carried.pointing.full
        left[carried.pointer] = replace(hand, trigger=0.0, squeeze=0.0 if grasps else hand.squeeze)
    for side in SIDES:
        if carried.open and carried.sticks.get(side, MIDDLE) in OURS:
            left[side] = replace(left[side], stick=(0.0, 0.0))
    return left


def _opened(carried: Carried, hands: dict[str, Hand], seconds: float) -> Carried:
    """Open or closed, by a menu button of whichever hand has one, or by the palm.

    While a hand holds something of the panel, or points at it, it stays.
    """
    palm = turned(carried.palm, carried.home, hands[carried.home], seconds)
    pinned = carried.pinned
    menus = frozenset(side for side in SIDES if hands[side].menu)
    if menus - carried.menus:
        pinned, palm = not carried.open, replace(palm, done=carried.open and palm.up)
        wanted = pinned
    else:
        wanted = pinned or (palm.up and not palm.done) or carried.on_panel
    if wanted != carried.open:
        carried = replace(carried, open=wanted, pointing=NOBODY, sticks={})
    return replace(carried, pinned=pinned, palm=palm, menus=menus)


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


# What thumbsticks do to the panel: the carrying hand's slides x, the pointing hand's scrolls.
#
# What a stick is for is decided when it leaves its middle, and stays so until it is let go: a hand
# that walks does not begin to slide.

# What a stick does since it left its middle; rests: came to a stop and has to be let go.
MIDDLE, SLIDES, RESTS, SCROLLS, MOVES = "", "slides", "rests", "scrolls", "moves"
OURS = (SLIDES, RESTS, SCROLLS)  # of them, those that walk and turn nobody
DEAD = 0.2  # of its way
SLIDE_SPEED = 0.6  # of the slider's range a second, stick at its end
SCROLL_SPEED = 3.0  # notches of a wheel a second, stick at its end
ON_STOP = 1e-3  # of the slider's range

Stick = tuple[float, float]  # -1..1, right and ahead


def slide(
    does: str, stick: Stick, x: float, stops: Sequence[Stop], seconds: float
) -> tuple[str, float]:
    """What the stick does now, and the new x: pushed sideways first it moves x, and rests at every
    stop.
    """
    if at_rest(stick):
        return MIDDLE, x
    does = does or (SLIDES if abs(stick[0]) > abs(stick[1]) else MOVES)
    if does != SLIDES:
        return does, x
    moved = min(max(x + _speed(stick[0]) * SLIDE_SPEED * seconds, 0.0), 1.0)
    low, high = sorted((x, moved))
    passed = [s.x for s in stops if low <= s.x <= high and abs(s.x - x) > ON_STOP]
    if not passed:
        return does, moved
    return RESTS, min(passed, key=lambda stop_x: abs(stop_x - x))


def scroll(does: str, stick: Stick, on_panel: bool, seconds: float) -> tuple[str, float]:
    """What the stick does now, and by how many notches it scrolls, up positive: pushed ahead or
    back first, while its hand points at the panel.
    """
    if at_rest(stick):
        return MIDDLE, 0.0
    does = does or (SCROLLS if on_panel and abs(stick[1]) > abs(stick[0]) else MOVES)
    if does != SCROLLS:
        return does, 0.0
    return does, _speed(stick[1]) * SCROLL_SPEED * seconds


def at_rest(stick: Stick) -> bool:
    """Also where a stick tells no number."""
    return not max(abs(stick[0]), abs(stick[1])) > DEAD


def _speed(pushed: float) -> float:
    """-1..1, 0 within the dead zone."""
    if not abs(pushed) > DEAD:
        return 0.0
    speed = (min(abs(pushed), 1.0) - DEAD) / (1 - DEAD)
    return speed if pushed > 0 else -speed
