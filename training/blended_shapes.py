"""Which steps draw a photo on shapes between two stops, with the photo's own stop's colours.

Near a value stop a viewer draws the colours of both stops on the shapes of x.  Such steps teach
the colours of each stop to fit there, too: docs/between.md.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shapeshift.runtime_models.model import HEADS, ControlEncoding, Stop


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
