"""A stop, a modality's place on the slider, and the encoding of such places for the networks."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Stop:
    """A named place on the slider: one modality, layer or style."""

    name: str
    x: float  # control value in [0, 1]
    kind: str = "rgb"  # one of model.py's STOP_KINDS
    palette: str = ""  # colour map of a thermal stop ("ironbow", "gray", ...); "" = none
    value_range: tuple[float, float] | None = None  # the values that intensity 0 and 1 stand for
    unit: str = ""  # unit of value_range, e.g. "°C"
    date: str = ""  # ISO 8601, when it was so; "": not known.  Of several they rise with x


@dataclass(frozen=True)
class ControlEncoding:
    """Psi(x) of the paper's equations 6 and 7: d Gaussians of width sigma at 0, s, 2s, ..."""

    d: int = 16
    spacing: float = 1 / 15  # s; the paper leaves it open, 1/(d-1) puts the last one at x = 1
    sigma: float = 0.04

    def encode(self, x: float | np.ndarray) -> np.ndarray:
        """(d,) float32 control encoding of one scalar x; (n, d) of a column (n, 1)."""
        t = np.arange(self.d) * self.spacing
        return np.exp(-((t - x) ** 2) / (2 * self.sigma**2)).astype(np.float32)
