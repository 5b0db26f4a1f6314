"""What a new stop is to show, as pictures: who makes them, from what, and when."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from shapeshift.scene.pose import View


@dataclass(frozen=True)
class StyleView:
    """One place from which a target picture is made, and what is seen there."""

    number: int  # of the view among all of the run, from 0
    view: View
    source: np.ndarray  # (H, W, 3) float32 display sRGB: what the source stop shows
    coverage: np.ndarray  # (H, W) 0..1 how much of each pixel may change: the scene's own coverage,
    #                       of a region that of its splats
    depth_m: np.ndarray  # (H, W) metres along the view's axis; 0 where nothing is
    shown: np.ndarray  # (H, W, 3) what the new stop shows now; before the first step as `source`


@dataclass(frozen=True)
class Turns:
    """When pictures are made: of `views` views at a time, then `steps` steps towards them."""

    views: int | None = None  # None: of all
    steps: int | None = None  # None: to the end of the run, so there is one turn


class StylePictures(Protocol):
    """Makes the pictures that a new stop is to show; see training/styles/__init__.py.

    A run asks `make` at the beginning of every turn.  What it gives is laid over the background by
    `coverage` and weighed with `--strength` by the run, so neither is its business.  The same
    arguments give the same pictures, to the bit: random numbers come from a seed of its own.
    """

    @property
    def turns(self) -> Turns: ...

    def make(self, views: Sequence[StyleView], done: float) -> list[np.ndarray]:
        """(H, W, 3) float32 display sRGB, 0..1, of each view; done: part of the run, 0..1.

        Raises BadFile where that cannot be, in one sentence.
        """
        ...
