"""Where a block lies: a half-open box in a frame that is turned about the vertical axis."""

import math
from dataclasses import dataclass

import numpy as np

Corner = tuple[float, float, float]  # metres in the turned frame; infinite: no bound


@dataclass(frozen=True)
class BlockBox:
    """low <= p < high: of boxes side by side, a place lies in one alone."""

    low: Corner
    high: Corner

    def __post_init__(self) -> None:
        """ValueError, one sentence; NaN is below nothing."""
        if not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise ValueError(f"a block reaches from {self.low} to {self.high}, which is no box")

    def holds(self, places: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """(N,) bool of places (N, 3) in the turned frame; margin: metres it is enlarged by."""
        low, high = np.array(self.low) - margin, np.array(self.high) + margin
        return np.asarray(((places >= low) & (places < high)).all(axis=1))


def turned(places: np.ndarray, degrees: float) -> np.ndarray:
    """(N, 3) float64 places in a frame whose x axis lies so many degrees from +X towards -Z.

    That is the frame's +Y turn; no turn gives the very same numbers.
    """
    wide = np.asarray(places, np.float64)
    if degrees == 0:
        return wide
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle)
    x, z = wide[:, 0], wide[:, 2]
    return np.stack([cosine * x - sine * z, wide[:, 1], sine * x + cosine * z], axis=1)
