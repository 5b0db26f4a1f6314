"""What the tools of a hand show in the room: outlines, the brush, marks with their values."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from shapeshift.app.editor.panels.outlines import circles
from shapeshift.app.headset.in_hand.hand_tools import HandTools
from shapeshift.app.inspection.pictures import ALARMS
from shapeshift.app.inspection.window.marks_over import words_of
from shapeshift.app.inspection.window.ray_marks import Pointed
from shapeshift.scene.inspection.lengths import length
from shapeshift.scene.inspection.marks import Mark
from shapeshift.vr.cards import Card
from shapeshift.vr.drawn import DOT_M, FINE, PALE, WRONG, Drawn
from shapeshift.vr.frame import SIDES, Frame
from shapeshift.vr.glove import Capsule
from shapeshift.vr.panel import Carried, facing
from shapeshift.vr.play_space import PlaySpace

THIN_M, THICK_M = 0.0012, 0.0022  # radii of lines, metres of the room
HANDLE_M = 0.014  # radius of a handle's ball
SPOT_DEG = 0.25  # radius of a spot's ball, as the head sees it
LABEL_M, LABEL_DEG = 0.45, 1.2  # from there on labels grow, so that they are read; above their mark
MOST_LABELS = 24  # the nearest ones
ASIDE_M, ABOVE_M = 0.10, 0.05  # of the room, outwards of the hand: what its ray meets
ToRoom = Callable[[np.ndarray], np.ndarray]


def with_tools(
    over: Drawn, tools: HandTools, frame: Frame, play_space: PlaySpace, carried: Carried
) -> Drawn:
    """What is in the room, and what the tools add to it."""
    matrix = play_space.world_from_play.matrix()

    def to_room(world: np.ndarray) -> np.ndarray:
        return (world - matrix[:3, 3]) @ matrix[:3, :3] / play_space.scale

    balls, lines = _shapes(tools, frame, play_space, to_room)
    lines += _brush(tools)
    cards: list[Card] = []
    if tools.inspecting.on:
        more, cards = _marks(tools, frame, to_room)
        lines += more
        lines += _contours(tools, to_room)
        if card := _pointed(tools, frame, carried):
            cards.append(card)
    return replace(
        over,
        hands=(*over.hands, *balls),
        lines=(*over.lines, *lines),
        cards=(*over.cards, *cards),
    )


def _shapes(
    tools: HandTools, frame: Frame, play_space: PlaySpace, to_room: ToRoom
) -> tuple[list[Capsule], list[Capsule]]:
    """Handles, and outlines: warm where a hand has it or would take it."""
    shapes = tools.shapes
    near = any(shapes.near(hand, play_space) for hand in frame.hands.values())
    ink = FINE if near or shapes.side else PALE
    lines = capsules(to_room(shapes.lines()), (*ink, 0.9 if shapes.side else 0.6), THIN_M)
    if not tools.sections.on:
        return [], lines
    places = [to_room(handle.place) for handle in tools.sections.handles()]
    return [Capsule(at, at, (HANDLE_M, HANDLE_M), ink) for at in places], lines


def _brush(tools: HandTools) -> list[Capsule]:
    """Three circles about the tip of the finger that paints."""
    brush = tools.brush
    if not brush.on or brush.tip is None:
        return []
    around = brush.tip + np.concatenate(circles(brush.radius_m))
    return capsules(around, (*(WRONG if brush.wipes else FINE), 0.8), THIN_M)


def _marks(tools: HandTools, frame: Frame, to_room: ToRoom) -> tuple[list[Capsule], list[Card]]:
    """Each mark and its label, which faces the head; what is chosen or meant is warm."""
    tool, marks, head = tools.inspecting, tools.marks, frame.head.position
    lines: list[Capsule] = []
    labels: list[tuple[float, Card]] = []
    for mark in tool.file.marks:
        at, warm = to_room(mark.place), mark.name in (marks.under, tool.chosen)
        away = max(float(np.linalg.norm(at - head)), 1e-3)
        thick = away * np.radians(SPOT_DEG)
        color = (*(FINE if warm else PALE), 1.0)
        if mark.kind in ("spot", "circle"):
            lines.append(Capsule(at, at, (thick, thick), color))
        else:
            ends = outline(mark)
            lines += capsules(to_room(ends), color, max(THIN_M, thick / 3))
        labels.append((away, _label(f"{mark.name}: {words(tools, mark)}", at, frame)))
    if marks.first is not None:
        at = to_room(marks.first.metres)
        lines.append(Capsule(at, at, (DOT_M, DOT_M), (*FINE, 1.0)))
        if marks.pointed is not None and np.isfinite(marks.pointed.metres):
            there = to_room(marks.pointed.place)
            lines += capsules(np.stack([at, there])[None], (*FINE, 0.8), THIN_M)
    nearest = sorted(labels, key=lambda pair: pair[0])[:MOST_LABELS]
    return lines, [card for _, card in nearest]


def words(tools: HandTools, mark: Mark) -> str:
    """A mark's value with its unit, a line's length; "--" where less than half is covered."""
    tool, found = tools.inspecting, tools.marks.lengths.get(mark.name)
    if mark.kind == "line":
        if found is not None:
            return f"{found.value:.3f} \u00b1 {found.uncertainty:.3f} m"
        return f"{length(mark.points) * tool.file.metres_per_unit:.3f} m"
    reading = tool.readings.get(mark.name)
    if reading is None or tool.picture is None:
        return "\u2026"
    return words_of(reading.value, tool.picture, tools.unit, reading.ends)


def outline(mark: Mark) -> np.ndarray:
    """(S, 2, 3) metres of the world: the edges of a box, a line's parts."""
    if mark.kind == "line":
        return np.stack([mark.points[:-1], mark.points[1:]], axis=1)
    near, far = (0, 1, 2, 3, 0), (4, 5, 6, 7, 4)
    pairs = [*pairwise(near), *pairwise(far), *((n, n + 4) for n in range(4))]
    return mark.points[np.array(pairs)]


def _label(text: str, at: np.ndarray, frame: Frame) -> Card:
    """Over a place (3,) of the room, as large to the head at any distance from LABEL_M on."""
    head = frame.head.position
    away = float(np.linalg.norm(at - head))
    above = np.array([0.0, away * np.radians(LABEL_DEG), 0.0])
    larger = max(away / LABEL_M, 1.0)
    above += np.array([0.0, 0.016 * larger, 0.0])
    towards = (head - at) * min(0.03 / max(away, 1e-3), 0.5)  # before the surface it lies on
    place = at + above + towards
    return Card((text,), facing(place, frame.head), larger=larger)


def _contours(tools: HandTools, to_room: ToRoom) -> list[Capsule]:
    out: list[Capsule] = []
    for kind, lines in tools.marks.contours:
        out += capsules(to_room(lines), (*ALARMS[kind], 0.95), THICK_M)
    return out


def _pointed(tools: HandTools, frame: Frame, carried: Carried) -> Card | None:
    """Degrees and metres of what the ray meets, beside the hand."""
    pointed, hand = tools.marks.pointed, frame.hands[carried.pointer]
    if pointed is None or hand.aim is None:
        return None
    metres = pointed.metres * tools.inspecting.file.metres_per_unit
    far = f"{metres:.2f} m" if np.isfinite(metres) else "--"
    texts = [far]
    if tools.inspecting.measured is not None:
        texts.insert(0, _pointed_words(pointed, tools.unit))
    right = frame.head.matrix()[:3, 0] * (1.0 if carried.pointer == SIDES[1] else -1.0)
    place = hand.aim.position + ASIDE_M * right + np.array([0.0, ABOVE_M, 0.0])
    return Card(tuple(texts), facing(place, frame.head))


def _pointed_words(pointed: Pointed, unit: str) -> str:
    picture = pointed.picture
    width, height = picture.view.size
    return words_of(pointed.value, picture, unit, picture.ends_at((width / 2, height / 2)))


def capsules(
    ends: np.ndarray, color: tuple[float, float, float, float], radius: float
) -> list[Capsule]:
    """Lines (S, 2, 3) of the room."""
    return [Capsule(a, b, (radius, radius), color) for a, b in ends]
