"""Leaves of a scene that each come in levels of detail: what a budget of splats chooses from."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

Throttle = Callable[[int], None]  # told how many pixels were decoded since; it may wait


def unpaced(pixels: int) -> None:
    """Nothing to wait for."""


@dataclass(frozen=True)
class LeafLevels:
    """Level 0 is the finest; a leaf need not have all."""

    low: np.ndarray  # (L, 3) float64 metres, object frame: the box of each leaf
    high: np.ndarray  # (L, 3)
    counts: np.ndarray  # (L, K) int64 splats; 0: the leaf has no such level
    errors: np.ndarray  # (L, K) what a level shows wrong; any unit, the same for all leaves

    @property
    def coarsest(self) -> np.ndarray:
        """(L,) the last level that each leaf has."""
        return self.counts.shape[1] - 1 - np.argmax(self.counts[:, ::-1] > 0, axis=1)

    @cached_property
    def finest_counts(self) -> np.ndarray:
        """(L,) splats of the finest level that each leaf has, read only."""
        finest = np.argmax(self.counts > 0, axis=1)
        found = self.counts[np.arange(len(finest)), finest]
        found.flags.writeable = False  # a thousand copies ask each frame
        return found


@dataclass(frozen=True)
class LeafSplats:
    """Decoded splats of some leaves, one leaf after the other; rows as of SplatLayers."""

    leaves: np.ndarray  # (n,)
    levels: np.ndarray  # (n,)
    counts: np.ndarray  # (n,) splats of each: no more than the level states
    means: np.ndarray  # (N, 3) metres, object frame
    scales: np.ndarray  # (N, 3) metres
    wxyz: np.ndarray  # (N, 4)
    opacity: np.ndarray  # (N,)
    sh: np.ndarray  # (N, M, 3)


class LeafSource(Protocol):
    """Where leaves come from.  A level of a leaf lies in one part, which is decoded as a whole."""

    levels: LeafLevels
    part: np.ndarray  # (L, K) int32 the part that holds a level of a leaf
    coarse_leaf: np.ndarray  # (N,) leaf of each splat of the model itself: the coarsest levels
    coefficients: int  # M of every LeafSplats
    budget: int  # splats that the scene may draw; 0: as many as suit the machine

    @property
    def problem(self) -> str:
        """One sentence: what could not be read; "" = nothing."""
        ...

    def share_memory(self, taken: int) -> None:
        """So many bytes of what the scene may keep in memory are not decoded parts."""

    def at_hand(self) -> np.ndarray:
        """(parts,) bool: what is decoded already."""
        ...

    def broken(self) -> np.ndarray:
        """(parts,) bool: what can never be read."""
        ...

    def load(self, part: int, pace: Throttle = unpaced) -> None:
        """Decodes a part, so that it is at hand; any thread.  pace is called after each piece of
        the work.  Raises BadFile.
        """

    def read(self, leaves: np.ndarray, levels: np.ndarray) -> Iterator[LeafSplats]:
        """Leaves (n,) at levels (n,), part by part.  Raises BadFile."""
        ...
