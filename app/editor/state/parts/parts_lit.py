"""What can be told of every anchor in numbers: size, opacity, colour, distance; and histograms."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import Model, SplatLayers
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.pick import anchor_places
from shapeshift.scene.scene import Tint

SIZE, OPACITY, BRIGHTNESS, DISTANCE = "size", "opacity", "brightness", "distance"
QUANTITIES = (SIZE, OPACITY, BRIGHTNESS, DISTANCE)
LOGARITHMIC = (SIZE,)  # from hair to hall: equal ratios are equal widths
BINS = 64
TAIL = 0.05  # percent of the anchors at either end that share the outermost bins


@dataclass(frozen=True, eq=False)
class AnchorNumbers:
    """Of A anchors at one control value; of plain splats each is its own anchor."""

    model: Model
    x: Control
    places: np.ndarray  # (A, 3) float32 metres, object frame
    size: np.ndarray  # (A,) float32 metres: the longest sigma among its splats that are there
    opacity: np.ndarray  # (A,) float32 0..1: the largest among its splats
    oklab: np.ndarray  # (A, 3) float32: its colour; lightness first

    @cached_property
    def distance(self) -> np.ndarray:
        """(A,) float32 metres from the middle, where half of the anchors lie to either side."""
        away = self.places - np.nanmedian(self.places, axis=0)
        return np.sqrt(np.einsum("ac,ac->a", away, away))

    def quantity(self, name: str) -> np.ndarray:
        """(A,) one of QUANTITIES."""
        own = {SIZE: self.size, OPACITY: self.opacity, BRIGHTNESS: self.oklab[:, 0]}
        return own[name] if name in own else self.distance

    def alike(self, color: np.ndarray, tolerance: float) -> np.ndarray:
        """(A,) bool: whose colour is at most `tolerance` from an Oklab colour (3,)."""
        off = self.oklab - np.asarray(color, np.float32)
        return np.einsum("ac,ac->a", off, off) <= np.float32(tolerance) ** 2


@dataclass(frozen=True, eq=False)
class Histogram:
    """How many anchors have which value, in BINS of equal width (on a logarithm where it has one).

    Values that are no numbers are in no bin.
    """

    name: str  # one of QUANTITIES
    edges: np.ndarray  # (BINS + 1,) ascending; what lies beyond either end is in the last bin there
    bin_of: np.ndarray  # (A,) uint8; BINS: in none

    @cached_property
    def counts(self) -> np.ndarray:
        """(BINS,) of all anchors."""
        return self.counts_of(np.ones(len(self.bin_of), bool))

    def counts_of(self, rows: np.ndarray) -> np.ndarray:
        """(BINS,) of some anchors (A,) bool."""
        return np.bincount(self.bin_of[rows], minlength=BINS + 1)[:BINS]

    def rows(self, first: int, last: int) -> np.ndarray:
        """(A,) bool: anchors in the bins from `first` to `last`, both among them, in any order."""
        low, high = sorted((first, last))
        return (self.bin_of >= max(low, 0)) & (self.bin_of <= min(high, BINS - 1))


def anchor_numbers(model: Model, x: Control, eye: np.ndarray) -> AnchorNumbers:
    """Evaluates a model once; colours as seen from `eye` (3,), metres in the object's frame."""
    places = np.asarray(anchor_places(model), np.float32)
    evaluator = Evaluator(model)
    _, scales, _, opacity = evaluator.geometry(x, unit=False, eye=eye)
    opacity = np.clip(opacity, 0, 1).astype(np.float32)
    size = scales.max(axis=1).astype(np.float32)
    if isinstance(model, SplatLayers):  # the base colour: a seventh of the time of all harmonics
        color = 0.5 + np.float32(C0) * model.sh[:, 0].astype(np.float32)
        return AnchorNumbers(model, x, places, size, opacity, oklab(color))
    count = len(places)
    color = evaluator.color(x, eye).reshape(count, -1, 3)
    opacity, size = opacity.reshape(count, -1), size.reshape(count, -1)
    there = opacity > 0
    weight = opacity / np.maximum(opacity.sum(axis=1, keepdims=True), 1e-6)
    mean = np.einsum("ak,akc->ac", weight, color)
    largest = np.where(there, size, 0).max(axis=1)
    return AnchorNumbers(model, x, places, largest, opacity.max(axis=1), oklab(mean))


def histogram_of(numbers: AnchorNumbers, name: str) -> Histogram:
    """Of one of QUANTITIES."""
    values = numbers.quantity(name)
    known = np.isfinite(values)
    log = name in LOGARITHMIC
    if log:
        known &= values > 0
        values = np.log(np.where(known, values, 1))
    low, high = bounds_of(values[known], name)
    scale = BINS / (high - low)
    place = np.clip((np.where(known, values, low) - low) * scale, 0, BINS - 1)
    bin_of = np.where(known, place, BINS).astype(np.uint8)
    edges = np.linspace(low, high, BINS + 1)
    return Histogram(name, np.exp(edges) if log else edges, bin_of)


def bounds_of(values: np.ndarray, name: str) -> tuple[float, float]:
    """What the bins span: opacity and brightness 0 to 1, else nearly all that there is."""
    if name in (OPACITY, BRIGHTNESS):
        return 0.0, 1.0
    if not len(values):
        return 0.0, 1.0
    step = max(len(values) // 100_000, 1)  # so many tell the ends of a million
    low, high = np.percentile(values[::step], (TAIL, 100 - TAIL))
    return (float(low), float(high)) if high > low else (float(low) - 0.5, float(low) + 0.5)


def oklab(color: np.ndarray) -> np.ndarray:
    """(N, 3) float32 Oklab of display sRGB (N, 3), by B. Ottosson's two matrices (2020)."""
    shown = np.clip(np.nan_to_num(color), 0, 1).astype(np.float32)
    linear = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    lms = np.cbrt(linear @ LMS_FROM_RGB.T)
    return lms @ LAB_FROM_LMS.T


LMS_FROM_RGB = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ],
    np.float32,
)
LAB_FROM_LMS = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ],
    np.float32,
)


# What lies over an object while its anchors are chosen: colours an anchor, and whether it changed.
#
# Colours that neither surfaces nor the palettes of heat have much of, so that they are told apart,
# by their lightness too.

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
