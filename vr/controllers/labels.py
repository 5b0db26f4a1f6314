"""The names of a controller's buttons, each on a card of its own with a line to its button."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.card import Card
from shapeshift.vr.controllers.model import HeldController
from shapeshift.vr.glove import Capsule
from shapeshift.vr.panel.plane import facing

AWAY_M = 0.085  # from the grip to the cards' near edge, outwards
ABOVE_M = 0.02  # their middle over the grip
GAP_M = 0.004  # between two cards
LINE_M = 0.0011  # radius
INK = (0.92, 0.93, 0.96)  # display sRGB


def labelled(
    side: str, held: HeldController, rows: Mapping[str, str], grip: np.ndarray, head: Pose,
    opacity: float,
) -> tuple[list[Card], list[Capsule]]:  # fmt: skip
    """Cards outwards of a hand, from top to bottom as their buttons are, and the lines to these.

    rows: what each button is called and does; a row whose name is no button has no line.
    """
    level = facing(grip, head)
    axes = level.matrix()[:3, :3]
    outwards = axes[:, 0] * (1 if side == "right" else -1)
    up = axes[:, 1]

    def height(name: str) -> float:
        place = held.buttons.get(name)
        return -np.inf if place is None else float(place @ up)

    names = sorted(rows, key=height, reverse=True)
    cards = [Card((rows[name],), level, opacity) for name in names]
    sizes = [card.size_m for card in cards]
    tall = sum(size[1] for size in sizes) + GAP_M * (len(sizes) - 1)
    edge = grip + outwards * AWAY_M + up * (ABOVE_M + tall / 2)
    placed, lines = [], []
    for name, card, (wide, high) in zip(names, cards, sizes, strict=True):
        near = edge - up * (high / 2)
        middle = near + outwards * (wide / 2)
        placed.append(replace(card, play_from_card=Pose(middle, level.wxyz)))
        if name in held.buttons:
            ink = (*INK, 0.9 * opacity)
            lines.append(Capsule(held.buttons[name], near, (LINE_M, LINE_M), ink))
        edge = edge - up * (high + GAP_M)
    return placed, lines
