"""Colours of a model at several controls for one eye, kept while neither changes."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from shapeshift.runtime_models.evaluate import follows_eye
from shapeshift.runtime_models.model import Model
from shapeshift.runtime_models.stop_weights import Controls, same_controls

Part = tuple[int, int]  # set of colours, one of all views or one a view; number in the mixture


class DecodesColors(Protocol):
    """Evaluator, or what does the same elsewhere: its arrays are of any kind."""

    @property
    def model(self) -> Model: ...

    def color(
        self, x: Any, eye: np.ndarray, seen: np.ndarray | None = None, out: Any = None
    ) -> Any: ...


class ColorMemory:
    """The last colours of each part that a picture is mixed of.

    Between a photo and a value stop the colours of both are decoded.  They stay while x moves
    between the two and the eye stands still, so that a slider then costs the shapes alone.
    """

    def __init__(self, evaluator: DecodesColors) -> None:
        self._evaluator = evaluator
        self._parts: dict[Part, _KeptColors] = {}

    def at(
        self, part: Part, control: Controls, eye: np.ndarray, seen: np.ndarray | None = None
    ) -> Any:
        """(N, 3) display sRGB, or as the evaluator gives it, towards an eye (3,) in the object's
        frame; of anchors not `seen` (A,) anything.  Read only, until the next call for this part.
        """
        if follows_eye(self._evaluator.model):  # colours of the shapes decoded just now
            return self._evaluator.color(control, eye, seen)
        last = self._parts.get(part)
        same = last if last is not None and last.is_of(control, eye) else None
        if same is not None and same.covers(seen):
            return same.colors
        colors = self._evaluator.color(control, eye, seen, None if last is None else last.colors)
        if same is not None and same.seen is not None and seen is not None:  # others came into view
            seen = seen | same.seen
        self._parts[part] = _KeptColors(control, np.array(eye), seen, colors)
        return colors

    def forget_after(self, which: int, number: int) -> None:
        """Drops the parts of a set that have a higher number: they are mixed in no more."""
        for part in [part for part in self._parts if part[0] == which and part[1] > number]:
            del self._parts[part]


@dataclass(frozen=True)
class _KeptColors:
    """Colours, and what they were decoded for."""

    control: Controls
    eye: np.ndarray
    seen: np.ndarray | None  # (A,) bool; None: all
    colors: Any  # as the evaluator gives it

    def is_of(self, control: Controls, eye: np.ndarray) -> bool:
        return np.array_equal(eye, self.eye) and same_controls(control, self.control)

    def covers(self, seen: np.ndarray | None) -> bool:
        """Whether all of these anchors have their colours."""
        return self.seen is None or (seen is not None and not (seen & ~self.seen).any())
