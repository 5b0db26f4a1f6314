"""A stop, a modality's place on the slider, and the encoding of such places for the networks."""

import math
from dataclasses import dataclass

import numpy as np

STOP_KINDS = ("rgb", "thermal", "layer", "style", "values")
VALUE_KINDS = ("thermal", "values")  # whose pictures are numbers; heat is the one that has a name
PALETTES = (
    "gray", "ironbow", "turbo", "perceptual", "viridis", "cividis", "white-hot", "black-hot",
    "rainbow", "arctic",
)  # fmt: skip
USUAL_PALETTE = {"thermal": "ironbow", "values": "viridis"}
LONGEST_UNIT = 24  # letters: it stands in legends and tables
HEAT_DIGITS, MOST_DIGITS = 1, 9  # of a value behind the decimal point


@dataclass(frozen=True)
class Stop:
    """A named place on the slider: one modality, layer or style."""

    name: str
    x: float  # control value in [0, 1]
    kind: str = "rgb"  # one of STOP_KINDS
    palette: str = ""  # colour map of a value stop ("ironbow", "gray", ...); "" = none
    value_range: tuple[float, float] | None = None  # the values that intensity 0 and 1 stand for
    unit: str = ""  # unit of value_range, e.g. "°C"
    date: str = ""  # ISO 8601, when it was so; "": not known.  Of several they rise with x
    formula: str = ""  # of other stops' values, which its own are; "": it was photographed

    def __post_init__(self) -> None:
        """Refuses what a stop of values cannot be: ValueError, one sentence."""
        if self.kind == "values":
            refuse_palette(self.palette)
            refuse_unit(self.unit)
        elif self.formula:
            raise ValueError(f"a formula in a stop of kind '{self.kind}'; 'values' is wanted.")

    @property
    def is_heat(self) -> bool:
        """Whether its words are those of heat: hot and cold, where others are high and low."""
        return self.kind == "thermal"

    @property
    def is_measured(self) -> bool:
        """Whether it shows a measured quantity, heat or another one."""
        return self.kind in VALUE_KINDS

    @property
    def has_false_colors(self) -> bool:
        """Whether a palette makes its colours, at the last step."""
        return self.is_measured and bool(self.palette)

    @property
    def temperature_unit(self) -> str:
        """Its unit, where values in it are temperatures of surfaces if they are any."""
        return "" if self.formula else self.unit

    @property
    def digits(self) -> int:
        """Behind the decimal point of its values, for people."""
        return HEAT_DIGITS if self.kind != "values" else digits_of(self.value_range)


def refuse_palette(name: str) -> None:
    """ValueError, one sentence; "" is none."""
    if name and name not in PALETTES:
        raise ValueError(
            f"there is no palette '{name:.40}'; a stop of values may name one of "
            f"{', '.join(PALETTES)}."
        )


def refuse_unit(unit: str) -> None:
    """ValueError, one sentence; "" is none."""
    if not (len(unit) <= LONGEST_UNIT and unit.isprintable() and unit == unit.strip()):
        raise ValueError(
            f"the unit is '{unit:.40}'; at most {LONGEST_UNIT} printable letters, without space at "
            "the ends, are wanted, such as %, mSv/h or W/(m²·sr)."
        )


def digits_of(value_range: tuple[float, float] | None) -> int:
    """Behind the decimal point, so that a thousandth of a range is told apart."""
    if value_range is None or not 0 < value_range[1] - value_range[0] < math.inf:
        return HEAT_DIGITS
    return min(max(3 - math.floor(math.log10(value_range[1] - value_range[0])), 0), MOST_DIGITS)


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
