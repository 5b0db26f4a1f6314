"""The edges of the free room around the person: lines that appear where head or hands come near.

They are drawn over all splats: a captured wall shall not hide a real one.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from shapeshift.vr.frame import Area, Frame
from shapeshift.vr.glove import Capsule

SEEN_M, CLEAR_M = 0.7, 0.25  # metres from an edge where its lines begin to show, and are clearest
AROUND_M = 0.9  # so far along the wall from who is near
POST_M, HEIGHTS_M = 0.3, (0.02, 0.8, 1.6)  # metres between posts; of the level lines
LINE_M, COLOR = 0.003, (0.42, 0.80, 0.98)  # radius; display sRGB
MOST = 0.85  # opacity


def area_edges(frame: Frame) -> tuple[Capsule, ...]:
    """What is seen of them in a frame; none where the runtime does not know them."""
    if frame.area is None:
        return ()
    grips = [hand.grip.position for hand in frame.hands.values() if hand.grip is not None]
    return tuple(edges(frame.area, [frame.head.position, *grips]))


def edges(area: Area, places: Sequence[np.ndarray]) -> list[Capsule]:
    """Lines on its four walls near any of places (3,), all in metres of the room."""
    to_play = area.play_from_area.matrix()
    half = np.array(area.size_m) / 2
    lines: list[Capsule] = []
    for place in places:
        local = to_play[:3, :3].T @ (place - to_play[:3, 3])
        for axis in (0, 2):  # walls across x, then across z
            for sign in (-1.0, 1.0):
                wall = sign * half[axis // 2]
                away = sign * (wall - local[axis])  # negative beyond it
                near = float(np.clip((SEEN_M - away) / (SEEN_M - CLEAR_M), 0, 1))
                if near > 0:
                    reach = half[1 - axis // 2]
                    lines += _wall(to_play, axis, wall, float(local[2 - axis]), reach, near)
    return lines


def _wall(
    to_play: np.ndarray, axis: int, wall: float, middle: float, reach: float, near: float
) -> list[Capsule]:
    """Level lines and posts of one wall around `middle` along it; it ends at +-reach."""
    first, last = max(middle - AROUND_M, -reach), min(middle + AROUND_M, reach)
    if not first < last:
        first, last = (reach - AROUND_M, reach) if middle > 0 else (-reach, AROUND_M - reach)

    def point(along: float, up: float) -> np.ndarray:
        local = np.array([0.0, up, 0.0])
        local[axis], local[2 - axis] = wall, along
        return to_play[:3, :3] @ local + to_play[:3, 3]

    def ink(along: float) -> tuple[float, ...]:
        faded = max(1 - abs(along - middle) / AROUND_M, 0.0)
        return (*COLOR, MOST * near * faded)

    thick, bottom, top = (LINE_M, LINE_M), HEIGHTS_M[0], HEIGHTS_M[-1]
    posts = np.arange(np.ceil(first / POST_M), np.floor(last / POST_M) + 1) * POST_M
    marks = sorted({first, *posts.tolist(), last})
    lines = [Capsule(point(a, bottom), point(a, top), thick, ink(a)) for a in marks]
    for up in HEIGHTS_M:
        for a, b in pairwise(marks):
            lines.append(Capsule(point(a, up), point(b, up), thick, ink(a), ink(b)))
    return lines
