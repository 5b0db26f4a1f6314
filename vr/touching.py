"""What hands do to a world: squeeze takes hold of what is near, trigger acts, both are felt.

`touch` comes before locomotion and `follow` after it, so that what is held goes where the person
goes; `feel` comes after the world's steps.  The world is a scene.world.World, or as much of one.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.scene.world.world import World
from shapeshift.vr.frame import SIDES, Frame, Hand, Pulse, aim_of
from shapeshift.vr.locomotion import GRIPS_AT, LETS_GO_AT
from shapeshift.vr.play_space import PlaySpace

REACH_M = 0.10  # of the room, from the palm to what it takes
SKIN_M = 0.02  # so near a palm touches
SHOWS_AT, PULLS_AT, RELAXES_AT = 0.1, 0.7, 0.4  # of a trigger: its beam is seen; it acts; again
BEAM_M = 10.0  # of the room: a beam that meets nothing
# Strength 0..1 and seconds of what is felt.
TOUCHED, TAKEN, LEFT, ACTED = (0.2, 0.015), (0.6, 0.04), (0.25, 0.02), (0.5, 0.03)
FELT_N_S, FULL_N_S = 0.005, 0.5  # impulses: below it is not felt; as strong as it gets
IMPACT_S = 0.05


@dataclass(frozen=True)
class Beam:
    """Where a hand's trigger acts or would act; metres of the room."""

    side: str
    start: np.ndarray  # (3,)
    end: np.ndarray  # (3,)
    meets: str | None  # the object's name
    acts: bool  # in this frame


@dataclass(frozen=True)
class Offer:
    """What a hand that presses now would take, or its ray act on."""

    side: str
    object: str
    by: str  # hand or ray


@dataclass(frozen=True)
class Touching:
    """Between two frames."""

    seen: frozenset[str] = frozenset()  # hands that were there
    squeezing: frozenset[str] = frozenset()
    pulling: frozenset[str] = frozenset()
    busy: frozenset[str] = frozenset()  # hands whose squeeze is for an object until they open
    near: tuple[str | None, ...] = (None,) * len(SIDES)  # what each palm touches


@dataclass(frozen=True)
class Touched:
    """What came of a frame."""

    pulses: tuple[Pulse, ...] = ()
    beams: tuple[Beam, ...] = ()
    held: Mapping[str, str | None] = field(default_factory=dict)  # side -> object
    offers: tuple[Offer, ...] = ()


def touch(
    world: World, touching: Touching, frame: Frame, play_space: PlaySpace
) -> tuple[Touching, Touched]:
    """Moves the hands in the world, takes, lets go and acts.

    A hand that comes back squeezing or pulling does nothing by that: it has to open first.
    """
    now = replace(
        touching,
        seen=frozenset(side for side in SIDES if frame.hands[side].active),
        squeezing=pressed(frame, "squeeze", touching.squeezing, (GRIPS_AT, LETS_GO_AT)),
        pulling=pressed(frame, "trigger", touching.pulling, (PULLS_AT, RELAXES_AT)),
    )
    # What begins in this frame; of hands that are back nothing does.
    squeezes = (now.squeezing - touching.squeezing) & touching.seen
    pulls = (now.pulling - touching.pulling) & touching.seen
    pulls = frozenset(side for side in pulls if frame.hands[side].aim is not None)
    busy = now.squeezing & (touching.busy | (now.seen - touching.seen))
    palms = {s: place(world, s, frame.hands[s], play_space, frame.recentred) for s in SIDES}
    let_go = [s for s in SIDES if s not in now.squeezing and world.held(s) is not None]
    for side in let_go:
        world.release(side)
    grasps = [(s, palm) for s, palm in palms.items() if palm is not None and s in squeezes]
    taken = [s for s, palm in grasps if grab_nearest(world, s, palm, play_space)]
    busy |= set(taken)
    # Of a controller with one button taking is all it does, and what it acted on is all it has.
    acting = pulls - set(taken)
    beams = [beam(world, s, frame.hands[s], play_space, s in acting) for s in SIDES
             if s in acting or (s not in busy and shows(frame.hands[s]))]  # fmt: skip
    hits = {line.side for line in beams if line.acts and answers(world, line.meets)}
    near = tuple(touched(world, palms[side], play_space) for side in SIDES)
    brushed = [s for s, name, before in zip(SIDES, near, touching.near, strict=True)
               if name not in (None, before) and world.held(s) is None]  # fmt: skip
    felt = ((let_go, LEFT), (taken, TAKEN), (hits, ACTED), (brushed, TOUCHED))
    pulses = [Pulse(side, *how) for sides, how in felt for side in sides]
    busy |= hits & squeezes
    held = {side: world.held(side) for side in SIDES}
    now = replace(now, busy=busy, near=near)
    free = [side for side in SIDES if held[side] is None and side not in now.squeezing]
    found = (offered(world, side, frame.hands[side], palms[side], play_space) for side in free)
    offers = tuple(offer for offer in found if offer is not None)
    return now, Touched(strongest(pulses), tuple(beams), held, offers)


def pressed(
    frame: Frame, what: str, before: frozenset[str], at: tuple[float, float]
) -> frozenset[str]:
    """The hands that press, without trembling between yes and no."""
    hands = frame.hands.items()
    return frozenset(s for s, hand in hands if getattr(hand, what) >= at[1 if s in before else 0])


def place(world: World, side: str, hand: Hand, play_space: PlaySpace, jumps: bool) -> Pose | None:
    """Where the palm is in the world, which is informed; None: lost, and it has let go."""
    if not hand.active or hand.grip is None:
        world.move_hand(side, None)
        return None
    palm = play_space.pose(hand.grip)
    if jumps:
        jump(world, side, palm)
    world.move_hand(side, palm)
    return palm


def jump(world: World, side: str, palm: Pose) -> None:
    """What a hand holds goes there with it at once, through whatever lies between.

    Another hand that holds it too has gone along, and is there already when its turn comes.
    """
    if world.held(side) is not None:
        moved = palm.matrix() @ np.linalg.inv(world.hands[side].matrix())
        world.carry(side, moved)


def grab_nearest(world: World, side: str, palm: Pose, play_space: PlaySpace) -> bool:
    """Takes the nearest object within reach."""
    reach = REACH_M * play_space.scale
    return world.nearest(palm.position, reach) is not None and bool(world.grab(side, reach))


def touched(world: World, palm: Pose | None, play_space: PlaySpace) -> str | None:
    """The object at a palm."""
    found = world.nearest(palm.position, SKIN_M * play_space.scale) if palm is not None else None
    return found[0] if found else None


def offered(
    world: World, side: str, hand: Hand, palm: Pose | None, play_space: PlaySpace
) -> Offer | None:
    """What a squeeze would take; else what a pull of the trigger would reach that answers to it."""
    if palm is None:
        return None
    near = world.nearest(palm.position, REACH_M * play_space.scale)
    if near is not None:
        return Offer(side, near[0], "hand")
    if hand.aim is None:
        return None
    aim = play_space.pose(hand.aim)
    hit = world.aim(aim.position, -aim.matrix()[:3, 2])
    if hit is None or hit.object not in world.objects or not answers(world, hit.object):
        return None
    return Offer(side, hit.object, "ray")


def shows(hand: Hand) -> bool:
    """A trigger pulled lightly shows where it would act."""
    return hand.aim is not None and hand.trigger >= SHOWS_AT


def beam(world: World, side: str, hand: Hand, play_space: PlaySpace, acts: bool) -> Beam:
    """Along the hand's aim; it acts on what it meets first."""
    room = aim_of(hand)
    aim = play_space.pose(room)
    along = -aim.matrix()[:3, 2]
    hit = (world.ray if acts else world.aim)(aim.position, along)
    length = BEAM_M if hit is None else hit.distance_m / play_space.scale  # metres of the room
    start = room.position
    end = start - room.matrix()[:3, 2] * min(length, BEAM_M)
    meets = hit.object if hit is not None and hit.object in world.objects else None
    return Beam(side, start, end, meets, acts)


def answers(world: World, name: str | None) -> bool:
    """Whether an object has something to do when a ray hits it."""
    return name is not None and any(r.on == "ray" for r in world.objects[name].machine.reactions)


def at_rest(frame: Frame, touching: Touching) -> Frame:
    """The frame for locomotion: hands whose squeeze is for an object do not hold the world."""
    hands = {
        side: replace(hand, squeeze=0.0) if side in touching.busy else hand
        for side, hand in frame.hands.items()
    }
    return replace(frame, hands=hands)


def follow(world: World, frame: Frame, play_space: PlaySpace, jumps: bool) -> None:
    """The hands where the room has been moved to; at a jump, with what they hold."""
    for side in SIDES:
        place(world, side, frame.hands[side], play_space, jumps)


def feel(world: World, records: Iterable) -> tuple[Pulse, ...]:
    """What held objects struck or were struck by in these steps, one pulse a hand."""
    sides = {side: world.held(side) for side in SIDES}
    pulses = []
    for record in records:
        for contact in record.contacts:
            impulse = contact["impulse_n_s"]
            if not impulse >= FELT_N_S:
                continue
            for side, name in sides.items():
                if name is not None and name in contact["between"]:
                    pulses.append(Pulse(side, min(impulse / FULL_N_S, 1.0) ** 0.5, IMPACT_S))
    return strongest(pulses)


def strongest(pulses: Sequence[Pulse]) -> tuple[Pulse, ...]:
    """One pulse a hand: a controller plays one at a time."""
    best: dict[str, Pulse] = {}
    for pulse in pulses:
        if pulse.side not in best or pulse.strength > best[pulse.side].strength:
            best[pulse.side] = pulse
    return tuple(best.values())
