"""What lies over an object while its anchors are chosen: colours an anchor, and whether it changed.

Colours that neither surfaces nor the palettes of heat have much of, so that they are told apart,
by their lightness too.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.scene.scene import Tint

CHOSEN_INK, HOVER_INK, LESS_INK = (0.1, 1.0, 0.7), (0.65, 1.0, 0.9), (1.0, 0.1, 0.45)
CHOSEN, HOVER = 0.75, 0.5  # how much of that colour lies over the object's own


@dataclass(frozen=True, eq=False)
class Lighting:
    """Which of an object's A anchors are to be seen how; None: none of them."""

    chosen: np.ndarray | None = None  # (A,) bool
    hover: np.ndarray | None = None  # (A,) bool: what a click would take
    removes: bool = False  # it would take them away
    gone: np.ndarray | None = None  # (A,) bool: what a crop deletes

    def tint(self, count: int) -> Tint:
        """Of `count` anchors; of a million in 20 ms."""
        colors = np.empty((count, 3), np.float32)
        colors[:] = CHOSEN_INK
        strength = np.zeros(count, np.float32)
        if self.chosen is not None:
            strength[self.chosen] = CHOSEN
        if self.hover is not None:
            colors[self.hover] = LESS_INK if self.removes else HOVER_INK
            strength[self.hover] = np.maximum(HOVER, strength[self.hover])
        if self.gone is not None:
            colors[self.gone], strength[self.gone] = LESS_INK, CHOSEN
        return Tint(colors, strength)


def same_look(one: tuple[str, Tint] | None, other: tuple[str, Tint] | None) -> bool:
    """Whether two tints look alike: then nothing has to be drawn anew."""
    if one is None or other is None:
        return one is other
    (name, tint), (old_name, old) = one, other
    if name != old_name or not np.array_equal(tint.strength, old.strength):
        return False
    rows = np.asarray(tint.strength) > 0
    return np.array_equal(np.asarray(tint.color)[rows], np.asarray(old.color)[rows])


def same(one: tuple, other: tuple) -> bool:
    """Whether all of two tuples is the very same, or equal where it is no array."""
    return len(one) == len(other) and all(
        a is b or (isinstance(a, str | float | bool | bytes) and a == b)
        for a, b in zip(one, other, strict=True)
    )
