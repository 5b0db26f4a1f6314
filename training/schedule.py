"""Which photo comes at which step, over which background, how far the run is, and LR warm-up.

Everything about a step follows from the seed and its number, so a resumed run needs no memory.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shapeshift.runtime_models.model import HEADS, ControlEncoding, Stop
from shapeshift.training.photos import BLACK, LoadedPhoto

TRAINED = 0.5  # of the seconds at least: a start that took more makes the run as much longer
# Of the run: until then things find their places, and photos their exposures.  With light by
# direction that learns from the first step on, veils stand in the air that look right from each
# photo and wrong from elsewhere: docs/bench/README.md, "Strangers".
LIGHT_FROM = 0.3
WARM_UP_STEPS = 200
LEAST_RATE = 0.01  # of the networks' rates, at the first step of a warm-up


@dataclass(frozen=True)
class Schedule:
    photos: dict[str, list[LoadedPhoto]]  # training photos of every modality, none empty
    seed: int
    background: tuple[float, float, float] | None  # None: a random one where photos show it

    def photo(self, iteration: int) -> LoadedPhoto:
        """Modalities take turns; each goes through all of its photos in a new order every time."""
        names = list(self.photos)
        turn, which = divmod(iteration, len(names))
        photos = self.photos[names[which]]
        epoch, place = divmod(turn, len(photos))
        order = np.random.default_rng([self.seed, 1, which, epoch]).permutation(len(photos))
        return photos[order[place]]

    def background_of(self, iteration: int, photo: LoadedPhoto) -> tuple[float, float, float]:
        if self.background is not None:
            return self.background
        if not photo.see_through:
            return BLACK
        return tuple(np.random.default_rng([self.seed, 2, iteration]).random(3).tolist())


@dataclass(frozen=True)
class Budget:
    """How long to train: steps, seconds, or whichever ends first."""

    iterations: int | None
    seconds: float | None  # of the whole run
    start: float = 0.0  # of these, what went by before the first step

    @property
    def training(self) -> float | None:
        """Seconds for the steps, at least TRAINED of all; None: no limit."""
        if self.seconds is None:
            return None
        return max(self.seconds - self.start, TRAINED * self.seconds)

    def fraction(self, iteration: int, elapsed: float) -> float:
        """0 at the first step, 1 or more at the end; learning rates and growing follow it.

        elapsed: seconds that the steps took.
        """
        steps = iteration / max(self.iterations, 1) if self.iterations is not None else 0.0
        most = self.training
        time = elapsed / max(most, 1e-9) if most is not None else 0.0
        return max(steps, time)


@dataclass(frozen=True)
class LrWarmup:
    """Learning rates of the networks that rise quadratically, after a run was turned back.

    Where photos are mostly background, the first steps have one direction for all splats alike:
    "away".  The heads can follow it until nothing is left, before the features tell the anchors
    apart.  With rates that rise the features learn first.  Runs of few hundred steps cannot spare
    the steps, so a run begins without (docs/growth.md).
    """

    start: int | None = None  # the iteration at which it begins; None: there is none

    def factor(self, iteration: int) -> float:
        """Of the networks' rates at a step."""
        if self.start is None:
            return 1.0
        done = iteration - self.start + 1
        return 1.0 if done >= WARM_UP_STEPS else max((done / WARM_UP_STEPS) ** 2, LEAST_RATE)

    def changes(self, iteration: int) -> bool:
        """Whether the rates of this step differ from those of the step before."""
        return self.start is not None and iteration - self.start < WARM_UP_STEPS

    def rates(self, rates: dict[str, np.ndarray], iteration: int) -> dict[str, np.ndarray]:
        """The optimiser's rates at a step."""
        if self.factor(iteration) == 1:
            return rates
        return rates | {"weights": rates["weights"] * np.float32(self.factor(iteration))}


# Which steps draw a photo on shapes between two stops, with the photo's own stop's colours.
#
# Near a value stop a viewer draws the colours of both stops on the shapes of x.  Such steps teach
# the colours of each stop to fit there, too: docs/between.md.


@dataclass(frozen=True)
class BlendedShapes:
    """The shapes of a step: `share` of the way from the photo's stop to a neighbouring one."""

    photo_stop: Stop
    neighbour: Stop
    share: float  # 0..1

    def control(self, encoding: ControlEncoding) -> np.ndarray:
        """(5, d) float32 Psi of each head: blended for the shape, the photo's stop for colour."""
        own, other = encoding.encode(self.photo_stop.x), encoding.encode(self.neighbour.x)
        blend = np.float32(1 - self.share) * own + np.float32(self.share) * other
        rows = np.tile(blend, (len(HEADS), 1))
        rows[HEADS.index("color")] = own
        return rows


@dataclass(frozen=True)
class ShapeBlending:
    """Draws the shapes of each step; everything follows from the seed and the step's number."""

    share: float  # of the steps, 0..1: those with blended shapes
    seed: int
    stops: tuple[Stop, ...]

    def sample(self, iteration: int, modality: str) -> BlendedShapes | None:
        """The shapes of this step, of a photo of a modality; None: those of its stop."""
        pairs = list(pairwise(sorted(self.stops, key=lambda stop: stop.x)))
        ways = [(a, b) for pair in pairs for a, b in (pair, pair[::-1]) if a.name == modality]
        chance, way, share, _ = np.random.default_rng([self.seed, 4, iteration]).random(4)
        if not (ways and chance < self.share):
            return None
        # As often at each part of the way as the photo's colours count there: 1 - share.
        return BlendedShapes(*ways[int(way * len(ways))], 1 - float(share) ** 0.5)
