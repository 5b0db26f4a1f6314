"""The panel from frame to frame: when it is open, where it hangs, what hands do to it.

A menu button opens it, and so does the palm of the hand that carries it, turned up as one looks at
a watch, for as long as it is.  What is on it is not known here.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from shapeshift.runtime_models.model import Stop
from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import SIDES, Frame, Hand
from shapeshift.vr.glove import fingertip

PALM_UP, PALM_AWAY = 0.8, 0.55  # of a palm's normal, up: it opens the panel; it closes it again
OPENS_S, CLOSES_S = 0.2, 0.4  # so long
LOOSE = 0.3  # of a squeeze: a hand that holds something turns as it must


# Where it hangs in the room, and where a hand points at it.
#
# Its own frame: the origin in its middle, +X right, +Y up, +Z towards who reads it; metres.  Places
# on it are logical pixels of what draws it, from its upper left corner, right and down.

ASIDE, ABOVE_M = 0.35, 0.03  # from the grip: outwards, of the width; up, metres to the lower edge
BESIDE_HEAD = np.array([0.24, -0.24, -0.5])  # without a hand, metres outwards, up, back of a head
CALM_S = 0.06  # time constant at which it follows: hands tremble
JUMP_M = 0.5  # farther than this it is there at once
RAY_M = 3.0  # as far one can point at it
NEAR_M = 0.09  # a fingertip so close points itself, not the ray
TOUCH_M, LEAVE_M, THROUGH_M = 0.004, 0.016, 0.07  # a finger presses, lets go, is behind it
PRESS, RELEASE = 0.6, 0.4  # of trigger and squeeze

Place = tuple[float, float]  # logical pixels of the panel


@dataclass(frozen=True)
class PanelPlane:
    """How large a panel is: for who draws it, and in the room."""

    size: tuple[int, int]  # logical pixels, width and height
    metres_per_pixel: float

    @property
    def size_m(self) -> tuple[float, float]:
        return self.size[0] * self.metres_per_pixel, self.size[1] * self.metres_per_pixel

    def holds(self, at: Place | None) -> bool:
        """Whether a place lies on it, not beside it."""
        return at is not None and 0 <= at[0] < self.size[0] and 0 <= at[1] < self.size[1]

    def place(self, local: np.ndarray) -> Place:
        """Of a point (3,) of the panel's frame, metres, or of what lies straight below it."""
        x, y = local[0] / self.metres_per_pixel, local[1] / self.metres_per_pixel
        return float(self.size[0] / 2 + x), float(self.size[1] / 2 - y)

    def play_point(self, play_from_panel: Pose, at: Place) -> np.ndarray:
        """(3,) metres of the room of a place."""
        width, height = self.size
        local = np.array([at[0] - width / 2, height / 2 - at[1], 0.0]) * self.metres_per_pixel
        return play_from_panel.matrix()[:3, :3] @ local + play_from_panel.position


@dataclass(frozen=True)
class Pointing:
    """The hand that points at the panel, the one that does not carry it; kept between frames."""

    at: Place | None = None  # where it points, on the plane of the panel; None: away from it
    near: bool = False  # its finger points, not its ray
    down: bool = False  # it presses: trigger, a squeeze at close range, a finger that touches
    full: bool = False  # it squeezed before it came near: something else
    unsure: bool = True  # it was away, and has not been seen open since
    elsewhere: bool = False  # its press began beside the panel, or nobody knows where
    pressing: bool = False  # its press began on the panel and goes on, wherever it points now


NOBODY = Pointing()


def hang(
    before: Pose | None, hand: Hand, head: Pose, size_m: tuple[float, float], seconds: float,
    side: str = SIDES[0],
) -> Pose:  # fmt: skip
    """play_from_panel: beside the hand of a side, outwards, turned to the head; where it was once
    the hand is lost.

    A left hand has it at the lower left: not over what one looks at, and down with the hand.
    """
    outwards = -1.0 if side == SIDES[0] else 1.0
    if hand.grip is None:
        return before or facing(_beside(head, outwards), head)
    right = facing(hand.grip.position, head).matrix()[:3, 0]
    aside = right * outwards * ASIDE * size_m[0]
    place = hand.grip.position + aside + np.array([0.0, ABOVE_M + size_m[1] / 2, 0.0])
    if before is not None and np.linalg.norm(place - before.position) < JUMP_M:
        part = -math.expm1(-max(seconds, 0.0) / CALM_S)
        place = before.position + (place - before.position) * part
    return facing(place, head)


def point(
    pointing: Pointing, play_from_panel: Pose, plane: PanelPlane, side: str, hand: Hand
) -> Pointing:
    """Where the hand of a side points in this frame, and whether it presses; a lost hand does
    neither, and what it held is let go.
    """
    if hand.grip is None:
        return NOBODY
    panel_from_play = np.linalg.inv(play_from_panel.matrix())
    near = _near(panel_from_play, fingertip(side, hand), plane, pointing.near)
    full = hand.squeeze >= RELEASE and (near is None or pointing.full)
    if near is None:
        at = ray_place(panel_from_play, hand.aim, plane)
        down = _firm(hand.trigger, pointing.down)
    else:
        at, height = near
        touches = height < (LEAVE_M if pointing.down else TOUCH_M)
        squeeze = 0.0 if full else hand.squeeze
        down = touches or _firm(max(hand.trigger, squeeze), pointing.down)
    unsure = down and pointing.unsure
    now = replace(pointing, at=at, near=near is not None, down=down, full=full, unsure=unsure)
    return _pressed(now, plane)


def _pressed(pointing: Pointing, plane: PanelPlane) -> Pointing:
    """Only what begins on the panel presses there: a hand that fires while it sweeps across, or
    carries something over it, does not.
    """
    if not pointing.down:
        return replace(pointing, elsewhere=False, pressing=False)
    if pointing.pressing:
        return pointing
    begins = plane.holds(pointing.at) and not pointing.unsure and not pointing.elsewhere
    return replace(pointing, elsewhere=not begins, pressing=begins)


def _near(
    panel_from_play: np.ndarray, tip: np.ndarray, plane: PanelPlane, was: bool
) -> tuple[Place, float] | None:
    """The place below a fingertip close to the panel, and its height over it, metres."""
    local = panel_from_play[:3, :3] @ tip + panel_from_play[:3, 3]
    slack = 1.3 if was else 1.0  # no trembling between finger and ray
    half = np.array(plane.size_m) / 2 + (0.03 if was else 0.0)
    if not (-THROUGH_M < local[2] < NEAR_M * slack and (np.abs(local[:2]) <= half).all()):
        return None
    return plane.place(local), float(local[2])


def ray_place(panel_from_play: np.ndarray, aim: Pose | None, plane: PanelPlane) -> Place | None:
    """Where a ray along -Z of a pose meets the plane from its front; None where it does not."""
    if aim is None:
        return None
    origin = panel_from_play[:3, :3] @ aim.position + panel_from_play[:3, 3]
    along = panel_from_play[:3, :3] @ -aim.matrix()[:3, 2]
    if not (origin[2] > 0 and along[2] < -1e-3 and -origin[2] / along[2] <= RAY_M):
        return None
    return plane.place(origin - along * origin[2] / along[2])


def _firm(value: float, was: bool) -> bool:
    return value >= (RELEASE if was else PRESS)


def _beside(head: Pose, outwards: float) -> np.ndarray:
    """(3,) a place before the head, below and aside, -1 left, 1 right; it may look up or down."""
    back = head.matrix()[:3, 2] * (1, 0, 1)
    length = np.linalg.norm(back)
    back = back / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])
    right = np.array([back[2], 0.0, -back[0]])
    x, y, z = BESIDE_HEAD
    return head.position + right * (x * outwards) + np.array([0.0, y, 0.0]) + back * z


def facing(place: np.ndarray, head: Pose) -> Pose:
    """A pose at a place (3,), upright, its +Z to where the head is."""
    normal = head.position - place
    length = np.linalg.norm(normal)
    normal = normal / length if length > 1e-6 else head.matrix()[:3, 2]
    right = np.cross([0.0, 1.0, 0.0], normal)
    if not np.linalg.norm(right) > 1e-3:  # straight below or above the head
        right = head.matrix()[:3, 0] - normal * (head.matrix()[:3, 0] @ normal)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(normal, right), normal], axis=1)
    matrix[:3, 3] = place
    return Pose.from_matrix(matrix)


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
