"""How one moves in the world: structs in, a standing out.  No OpenXR, no clock, no world.

One stick walks where the head looks; the other turns sideways and flies up and down.  A held A or
X aims a jump that its release makes, unless the hand squeezes.  Empty hands that squeeze hold the
world.  B or Y brings the world back to its true size, held a second longer all is as at first.
Callers put hands to rest that a panel or an object has.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import SIDES, Frame, grip_of
from shapeshift.vr.one_hand import shared_stick
from shapeshift.vr.play_space import (
    PlaySpace,
    heading,
    moved,
    pinned,
    resized,
    scaled,
    turned,
    underfoot,
    yaw,
)

# Taking hold of the world: one hand draws it along, two turn and stretch it as well.
#
# Each hand pins a point of the world to itself; one is kept exactly, of two the middle, the
# direction seen from above and the distance.

LEAST_APART = 0.05  # metres between two hands: nearer, their distance and direction say nothing

Grips = tuple[tuple[str, np.ndarray], ...]  # side, (3,) metres of the world that it holds


def held_points(play_space: PlaySpace, frame: Frame, sides: frozenset[str]) -> Grips:
    """What these hands hold now."""
    return tuple(
        (side, play_space.point(grip_of(frame.hands[side]).position)) for side in sorted(sides)
    )


def drawn_along(play_space: PlaySpace, frame: Frame, grips: Grips) -> PlaySpace:
    """The standing in which the hands hold what they took."""
    here = [grip_of(frame.hands[side]).position for side, _ in grips]  # (3,) metres, room
    there = [world for _, world in grips]
    if len(grips) == 1:
        return pinned(play_space, here[0], there[0])
    middle = (here[0] + here[1]) / 2
    apart, apart_world = here[1] - here[0], there[1] - there[0]
    length = float(np.linalg.norm(apart))
    if length >= LEAST_APART:
        play_space = scaled(play_space, float(np.linalg.norm(apart_world)) / length, middle)
    across, across_world = (math.hypot(v[0], v[2]) for v in (apart, apart_world))
    if across >= LEAST_APART and across_world >= LEAST_APART * play_space.scale:
        now = play_space.world_from_play.matrix()[:3, :3] @ apart
        angle = _bearing(apart_world) - _bearing(now)
        play_space = turned(play_space, math.remainder(angle, math.tau), middle)
    return pinned(play_space, middle, (there[0] + there[1]) / 2)


def _bearing(direction: np.ndarray) -> float:
    """Radians about up."""
    return math.atan2(direction[0], direction[2])


# Where a thrown arc comes down: points in the room, a landing, and whether one can stand there.

SPEED = 6.0  # m/s of the room at which the arc leaves the hand: 3.7 m far on level ground, and more
FALL = 9.81  # m/s2
STEP_S, STEPS = 0.05, 40  # of the arc
SLIVER = 0.02  # metres: from so far above a floor is looked for where a wall was met

# ground(start, end), (3,) metres of the world each -> (point, can be stood on), or None
Ground = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, bool] | None]


@dataclass(frozen=True)
class Arc:
    """What is drawn while one aims."""

    points: np.ndarray  # (n, 3) metres, room
    landing: np.ndarray | None  # (3,) metres, room
    fine: bool  # one can stand there


def level_ground(floor_y: float) -> Ground:
    """An endless floor in the world."""

    def ground(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, bool] | None:
        if not start[1] >= floor_y > end[1]:
            return None
        part = (start[1] - floor_y) / (start[1] - end[1])
        return start + part * (end - start), True

    return ground


def ground_of(world, level_y: float | None = None) -> Ground:
    """What does not move in a scene.world.World, and a level where that has no floor.

    At a wall one lands at its foot; on what can be carried away nobody stands.
    """
    level = level_ground(level_y) if level_y is not None else None

    def ground(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, bool] | None:
        way = end - start
        length = float(np.linalg.norm(way))
        hit = world.aim(start, way) if length > 0 else None
        if hit is None or hit.distance_m > length:
            return level(start, end) if level else None
        above = hit.point - way / length * SLIVER + [0.0, SLIVER, 0.0]
        below = world.aim(above, np.array([0.0, -1.0, 0.0]))
        if below is None:
            return hit.point, False
        stands = all(
            met.object not in world.objects or not world.objects[met.object].moves
            for met in (hit, below)
        )
        return below.point, stands

    return ground


def throw_arc(aim: Pose, play_space: PlaySpace, ground: Ground) -> Arc:
    """The arc of a hand that aims."""
    along = -aim.matrix()[:3, 2]
    if not math.isfinite(float(along.sum())):
        return Arc(aim.position[None], None, False)
    seconds = np.arange(STEPS + 1)[:, None] * STEP_S
    points = aim.position + along * SPEED * seconds  # (n, 3) metres, room
    points[:, 1] -= FALL / 2 * seconds[:, 0] ** 2
    room = play_space.world_from_play
    world = room.position + play_space.scale * points @ room.matrix()[:3, :3].T  # (n, 3)
    for number in range(STEPS):
        met = ground(world[number], world[number + 1])
        if met is not None:
            landing = _into_room(play_space, met[0])
            return Arc(np.vstack([points[: number + 1], landing]), landing, met[1])
    return Arc(points, None, False)


def _into_room(play_space: PlaySpace, world: np.ndarray) -> np.ndarray:
    room = play_space.world_from_play
    return room.matrix()[:3, :3].T @ (world - room.position) / play_space.scale


TURNINGS = ("snap", "smooth", "none")
LONGEST_S = 0.1  # of a frame: after a hitch nobody is thrown far
GRIPS_AT, LETS_GO_AT = 0.6, 0.4  # of a squeeze
TURNS_AT, REARMS_AT = 0.6, 0.3  # of a stick pushed aside, for one snap
RISES_S, FALLS_S = 0.12, 0.35  # time constants of the vignette
BLINK_S = 0.2  # so long the dark after a jump fades
HOME_S = 1.0  # so long B or Y is held to begin anew


@dataclass(frozen=True)
class Rules:
    """What a user chooses."""

    walks: str = "left"  # the hand whose stick walks; the other turns and flies
    turning: str = "snap"  # of TURNINGS
    snap_rad: float = math.radians(30)
    turn_rad_s: float = math.radians(90)  # smooth, at a full stick
    walk_m_s: float = 1.6  # of the room, at a full stick
    fly_m_s: float = 1.0
    dead: float = 0.15  # of a stick that drifts
    vignette: float = 0.8  # at full speed; 0: none
    obstacles: bool = True  # the head in one of them sees nothing
    one_hand: str = ""  # the side of the only one, which walks; "": both are there

    def __post_init__(self) -> None:
        if self.walks not in SIDES or self.one_hand not in ("", self.walks):
            raise ValueError(f"the hand that walks is '{self.walks}'; {' or '.join(SIDES)}.")
        if self.turning not in TURNINGS:
            raise ValueError(f"turning is '{self.turning}'; {', '.join(TURNINGS)} are there.")


@dataclass(frozen=True)
class Travel:
    """Between two frames."""

    armed: bool = True  # the stick that snaps has come back since
    squeezing: frozenset[str] = frozenset()
    grips: Grips = ()  # of the world
    aims: str | None = None  # the hand that aims a jump
    pressed: frozenset[str] = frozenset()  # hands whose A or X is down
    resets: tuple[str, float] | None = None  # the hand whose B or Y is down, and seconds of it
    vignette: float = 0.0
    blink: float = 0.0


@dataclass(frozen=True)
class Comfort:
    """What is shown, and what else has to follow."""

    vignette: float = 0.0  # 0..1, how far the edge of the picture is dark
    blink: float = 0.0  # 0..1, how dark all of it is
    arc: Arc | None = None
    jumps: bool = False  # the room is elsewhere at once: what is held jumps along
    home: bool = False  # the room is to be where it was at first; the caller knows where


RULES = Rules()


def move(
    play_space: PlaySpace,
    travel: Travel,
    frame: Frame,
    seconds: float,
    rules: Rules = RULES,
    ground: Ground | None = None,
) -> tuple[PlaySpace, Travel, Comfort]:
    """The room a frame later; without a ground one jumps along the level that one stands on."""
    seconds = min(seconds, LONGEST_S) if seconds > 0 else 0.0
    frame = shared_stick(frame, rules.one_hand) if rules.one_hand else frame
    travel = replace(travel, blink=max(travel.blink - seconds / BLINK_S, 0.0))
    play_space, travel = hold_world(play_space, travel, frame)
    if travel.grips:
        travel = replace(travel, aims=None, resets=None, pressed=pressing(frame))
        travel = fade(travel, 0.0, seconds)
        return play_space, travel, Comfort(travel.vignette, travel.blink)
    play_space, pace = walk(play_space, frame, seconds, rules)
    travel, angle, pace_turned = turn(travel, frame, seconds, rules)
    if angle:
        play_space = turned(play_space, angle, frame.head.position)
    ground = ground or level_ground(play_space.point(underfoot(frame.head))[1])
    travel, arc, landing = aim(travel, frame, play_space, ground)
    if landing is not None:
        play_space = pinned(play_space, underfoot(frame.head), play_space.point(landing))
    travel, true_size, home = reset(travel, frame, seconds)
    true_size = true_size and play_space.scale != 1.0
    if true_size:
        play_space = resized(play_space, frame.head, 1.0)
    leaps = landing is not None or true_size or home
    travel = replace(travel, blink=1.0 if leaps else travel.blink)
    travel = fade(travel, max(pace, pace_turned) * rules.vignette, seconds)
    jumps = leaps or (rules.turning == "snap" and angle != 0)
    return play_space, travel, Comfort(travel.vignette, travel.blink, arc, jumps, home)


def hold_world(play_space: PlaySpace, travel: Travel, frame: Frame) -> tuple[PlaySpace, Travel]:
    """Empty hands that begin to squeeze take hold of the world, and draw it along."""
    squeezing = frozenset(side for side in SIDES if squeezes(frame, side, travel.squeezing))
    before = frozenset(side for side, _ in travel.grips)
    holding = squeezing & (before | (squeezing - travel.squeezing))
    # With every hand that comes or goes, and in a room with a new origin, holds begin anew.
    anew = holding != before or frame.recentred
    grips = held_points(play_space, frame, holding) if anew else travel.grips
    if grips:
        play_space = drawn_along(play_space, frame, grips)
    return play_space, replace(travel, squeezing=squeezing, grips=grips)


def squeezes(frame: Frame, side: str, before: frozenset[str]) -> bool:
    """Whether a hand does, without trembling between yes and no."""
    hand = frame.hands[side]
    least = LETS_GO_AT if side in before else GRIPS_AT
    return hand.active and hand.grip is not None and hand.squeeze >= least


def pressing(frame: Frame) -> frozenset[str]:
    """Hands whose A or X is down."""
    return frozenset(side for side in SIDES if frame.hands[side].primary)


def walk(
    play_space: PlaySpace, frame: Frame, seconds: float, rules: Rules
) -> tuple[PlaySpace, float]:
    """Along the head on the level by one stick, up and down by the other; and at what pace, 0..1.

    Metres of the room: who is small walks slowly.
    """
    aside, ahead = beyond_rest(frame.hands[rules.walks].stick, rules.dead)
    sideways, up = beyond_rest(frame.hands[other(rules.walks)].stick, rules.dead)
    up = up if abs(up) > abs(sideways) else 0.0
    pace = max(math.hypot(aside, ahead), abs(up))
    if pace == 0:
        return play_space, 0.0
    level = np.array([aside, 0.0, -ahead]) * rules.walk_m_s
    by = yaw(heading(frame.head.wxyz)).matrix()[:3, :3] @ level  # (3,) m/s, room
    by[1] = up * rules.fly_m_s
    world = play_space.world_from_play.matrix()[:3, :3] @ by * play_space.scale
    return moved(play_space, world * seconds), pace


def turn(travel: Travel, frame: Frame, seconds: float, rules: Rules) -> tuple[Travel, float, float]:
    """Radians to the left by which the room turns in this frame, and at what pace, 0..1."""
    hand = frame.hands[other(rules.walks)]
    x, y = hand.stick
    aside = abs(x) >= abs(y)
    if rules.turning == "smooth":
        pushed = beyond_rest(hand.stick, rules.dead)[0] if aside else 0.0
        return travel, -pushed * rules.turn_rad_s * seconds, abs(pushed)
    if not hand.active:
        return travel, 0.0, 0.0  # unseen for a moment: a stick still held shall not snap again
    if rules.turning == "snap" and travel.armed and aside and abs(x) >= TURNS_AT:
        return replace(travel, armed=False), -math.copysign(rules.snap_rad, x), 0.0
    return replace(travel, armed=travel.armed or abs(x) < REARMS_AT), 0.0, 0.0


def aim(
    travel: Travel, frame: Frame, play_space: PlaySpace, ground: Ground
) -> tuple[Travel, Arc | None, np.ndarray | None]:
    """The arc while A or X is held, and where in the room (3,) its release lands."""
    pressed = pressing(frame)
    begun = [s for s in SIDES if s in pressed - travel.pressed and frame.hands[s].aim is not None]
    aims = travel.aims or (begun[0] if begun else None)
    travel = replace(travel, aims=aims, pressed=pressed)
    if aims is None:
        return travel, None, None
    hand = frame.hands[aims]
    # Lost, squeezing, or the origin moved under it: thought better of.
    if hand.aim is None or hand.squeeze >= GRIPS_AT or frame.recentred:
        return replace(travel, aims=None), None, None
    arc = throw_arc(hand.aim, play_space, ground)
    if aims in pressed:
        return travel, arc, None
    return replace(travel, aims=None), None, arc.landing if arc.fine else None


def reset(travel: Travel, frame: Frame, seconds: float) -> tuple[Travel, bool, bool]:
    """Whether the world is to have its true size, B or Y let go, and whether all begins anew."""
    if travel.resets is None:
        down = [side for side in SIDES if frame.hands[side].secondary]
        return replace(travel, resets=(down[0], 0.0) if down else None), False, False
    side, before = travel.resets
    hand = frame.hands[side]
    if not hand.secondary:  # a hand that was lost did not let go of it
        return replace(travel, resets=None), hand.active and before < HOME_S, False
    lasts = before + seconds
    return replace(travel, resets=(side, lasts)), False, before < HOME_S <= lasts


def beyond_rest(stick: tuple[float, float], dead: float) -> tuple[float, float]:
    """What a stick says beyond its dead zone, finer near it; what is no number rests."""
    length = math.hypot(*stick)
    if not dead < length < math.inf:
        return 0.0, 0.0
    pace = min((length - dead) / (1 - dead), 1.0) ** 2
    return stick[0] / length * pace, stick[1] / length * pace


def fade(travel: Travel, vignette: float, seconds: float) -> Travel:
    """The vignette on its way to where it shall be."""
    lasts = RISES_S if vignette > travel.vignette else FALLS_S
    near = travel.vignette + (vignette - travel.vignette) * -math.expm1(-seconds / lasts)
    return replace(travel, vignette=near if near > 0.005 else 0.0)


def other(side: str) -> str:
    return SIDES[1 - SIDES.index(side)]
