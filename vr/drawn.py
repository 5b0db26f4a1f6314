"""What is drawn over the splats for who wears the headset: hands, rays, an arc, the panel, dark.

All of it in metres of the room, so that it is as large as hands are at any scale of the world.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import moderngl
import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.cards import Card
from shapeshift.vr.frame import SIDES, Hand
from shapeshift.vr.glove import Capsule, glove
from shapeshift.vr.locomotion import Comfort
from shapeshift.vr.panel import Carried
from shapeshift.vr.touching import Beam, Touched

FINE, WRONG, PALE = (0.96, 0.66, 0.30), (0.90, 0.32, 0.26), (0.92, 0.93, 0.96)  # display sRGB
RAY_M, RAY_FROM_M = 1.2, 0.06  # metres of a ray that meets nothing, and where it begins to show
RAY_THICK, ARC_THICK, RING_THICK = 0.0014, 0.006, 0.008  # radii
RING_M, RING_PARTS = 0.22, 32  # of the ring where a jump lands
DOT_M = 0.005  # radius of the dot where a ray meets something
FINGER_DOT_M = 0.003
CALM, NOTHING = Comfort(), Touched()


@dataclass(frozen=True)
class PanelQuad:
    """The panel's picture, and where it hangs."""

    texture: moderngl.Texture  # display sRGB, opaque, row 0 below; with its smaller levels
    play_from_panel: Pose
    size_m: tuple[float, float]
    version: int = 0  # another one whenever the picture is
    apart: bool = False  # the runtime shows it as a layer of its own; the eyes have a hole for it


@dataclass(frozen=True)
class Drawn:
    """One frame's worth, the same for both eyes."""

    hands: tuple[Capsule, ...] = ()  # lit and solid
    lines: tuple[Capsule, ...] = ()  # they shine, and may fade out
    panel: PanelQuad | None = None
    cards: tuple[Card, ...] = ()
    vignette: float = 0.0  # 0..1
    blink: float = 0.0  # 0..1
    edges: tuple[Capsule, ...] = ()  # of the room, as lines are, and no splat hides them


def drawn_of(
    hands: Mapping[str, Hand],
    carried: Carried,
    comfort: Comfort = CALM,
    touched: Touched = NOTHING,
    outlines: Sequence[Capsule] = (),
    cards: tuple[Card, ...] = (),
    panel: moderngl.Texture | None = None,
    gloves: Sequence[str] = SIDES,
) -> Drawn:
    """What a frame shows; `hands` as the runtime has them, before the panel takes its part.

    gloves: the sides that are drawn as such.
    """
    lines: list[Capsule] = list(outlines)
    beams = {beam.side: beam for beam in touched.beams}
    holds = {side for side, name in touched.held.items() if name is not None}
    for side in SIDES:
        aims_jump = comfort.arc is not None and hands[side].primary
        if side not in holds and not aims_jump:
            lines += ray(side, hands[side], carried, beams.get(side))
    if comfort.arc is not None:
        lines += arc(comfort.arc.points, comfort.arc.landing, comfort.arc.fine)
    solid = [part for side in gloves for part in glove(side, hands[side], side in holds)]
    quad = None
    if panel is not None and carried.play_from_panel is not None:
        quad = PanelQuad(panel, carried.play_from_panel, carried.plane.size_m)
    dark = comfort.vignette, comfort.blink
    return Drawn(tuple(solid), tuple(lines), quad, cards, *dark)


def ray(side: str, hand: Hand, carried: Carried, beam: Beam | None) -> list[Capsule]:
    """A thin ray along the aim: to the panel where it points at it, to what the trigger acts on,
    else it fades out.
    """
    pose, pointing = carried.play_from_panel, carried.pointing
    if hand.aim is None or (carried.open and side == carried.home):
        return []
    along = -hand.aim.matrix()[:3, 2]
    start = hand.aim.position
    if carried.on_panel and pointing.at is not None and pose is not None:
        dot = carried.plane.play_point(pose, pointing.at)
        color = FINE if pointing.down else PALE
        if pointing.near:
            return [Capsule(dot, dot, (FINGER_DOT_M, FINGER_DOT_M), (*color, 1.0))]
        return _beam(start, dot, along, color, RAY_THICK)
    if beam is not None:
        thick = 3 * RAY_THICK if beam.acts else RAY_THICK
        return _beam(beam.start, beam.end, along, FINE if beam.meets or beam.acts else PALE, thick)
    ends = start + along * RAY_FROM_M, start + along * RAY_M
    return [Capsule(*ends, (RAY_THICK, RAY_THICK), (*PALE, 0.35), (*PALE, 0.0))]


def arc(points: np.ndarray, landing: np.ndarray | None, fine: bool) -> list[Capsule]:
    """The arc of a jump through points (n, 3), with a ring on the floor where it lands."""
    color = (*(FINE if fine else WRONG), 1.0)
    lines = [Capsule(a, b, (ARC_THICK, ARC_THICK), color) for a, b in pairwise(points)]
    if landing is not None:
        turns = np.linspace(0, 2 * np.pi, RING_PARTS + 1)
        flat = np.stack([np.cos(turns), np.zeros_like(turns), np.sin(turns)], axis=1)
        for radius in (RING_M, 0.25 * RING_M) if fine else (RING_M,):
            ring = landing + np.array([0.0, RING_THICK, 0.0]) + flat * radius
            lines += [Capsule(a, b, (RING_THICK, RING_THICK), color) for a, b in pairwise(ring)]
    return lines


def _beam(
    start: np.ndarray, end: np.ndarray, along: np.ndarray, color: tuple, thick: float
) -> list[Capsule]:
    """A ray that comes out of the hand and ends in a dot."""
    length = float((end - start) @ along)
    dot = Capsule(end, end, (DOT_M, DOT_M), (*color, 1.0))
    if not length > RAY_FROM_M:
        return [dot]
    first = start + along * RAY_FROM_M
    return [Capsule(first, end, (thick, thick), (*color, 0.25), (*color, 0.9)), dot]
