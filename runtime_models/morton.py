"""An order of points along a curve that fills space: neighbours in it are neighbours in space."""

import numpy as np

BITS = 21  # of each axis; three of them fill a 64-bit key
SPREADS = (  # (shift, mask) that move the bits of a number three places apart
    (32, 0x001F00000000FFFF),
    (16, 0x001F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


def morton_order(points: np.ndarray) -> np.ndarray:
    """(N,) indices that sort points (N, 3) along the Z-curve; equal places stay in their order.

    Far outliers do not take the bits from the rest: each axis counts nearly linearly in the middle
    of the scene and as a logarithm far outside.
    """
    if len(points) < 2:
        return np.arange(len(points))
    points = points.astype(np.float64, copy=False)
    low, middle, high = np.quantile(points, (0.05, 0.5, 0.95), axis=0)
    spread = np.where(high > low, high - low, 1.0)
    bent = np.arcsinh((points - middle) / spread)
    bent -= bent.min(axis=0)
    largest = bent.max(axis=0)
    share = bent / np.where(largest > 0, largest, 1.0)
    cells = (share * (2**BITS - 1)).astype(np.uint64)
    keys = spaced(cells[:, 0]) | spaced(cells[:, 1]) << np.uint64(1)
    return np.argsort(keys | spaced(cells[:, 2]) << np.uint64(2), kind="stable")


def spaced(numbers: np.ndarray) -> np.ndarray:
    """(N,) uint64 with the lowest 21 bits of each number three places apart."""
    out = numbers & np.uint64(2**BITS - 1)
    for shift, mask in SPREADS:
        out = (out | out << np.uint64(shift)) & np.uint64(mask)
    return out
