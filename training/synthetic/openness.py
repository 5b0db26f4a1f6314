"""How much sky a point sees, from the distance to the nearest object a little above it.

The distances are computed once, on a grid; a walk of a few steps along the normal reads them.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.training.synthetic.solids import length
from shapeshift.training.synthetic.tracer import Hits, Place

FAR = 0.15  # metres at scale 1; more free space than this makes no difference
STEPS = ((0.012, 0.3), (0.03, 0.3), (0.07, 0.25), (0.14, 0.15))  # metres above at 1, weight


def corner_weight(f: np.ndarray, corner: tuple[int, int, int]) -> np.ndarray:
    """(n,) trilinear weight of one corner of a cell, f (n, 3) the place in the cell."""
    x, y, z = (f[:, i] if one else 1 - f[:, i] for i, one in enumerate(corner))
    return x * y * z


@dataclass(frozen=True)
class Clearance:
    """Distances to the nearest surface on a regular grid."""

    low: np.ndarray  # (3,) metres
    cell: float  # metres
    grid: np.ndarray  # (X, Y, Z) metres, at most FAR * scale
    scale: float = 1.0  # of FAR and STEPS: larger for larger things

    @staticmethod
    def of(
        place: Place, low: tuple, high: tuple, cell: float = 0.01, scale: float = 1.0
    ) -> "Clearance":
        corner, far = np.asarray(low, float), FAR * scale
        shape = np.ceil((high - corner) / cell).astype(int) + 1
        grid = np.full(shape, far)
        for solid in place.solids:
            # Only cells that are nearer than `far` to the ball round the solid can change.
            around = solid.shape.reach + far
            first = np.clip(np.floor((solid.centre - around - corner) / cell), 0, shape).astype(int)
            last = np.clip(np.ceil((solid.centre + around - corner) / cell) + 1, 0, shape).astype(
                int
            )
            block = grid[tuple(map(slice, first, last))]
            cells = np.stack(np.meshgrid(*map(np.arange, first, last), indexing="ij"), -1)
            points = corner + cell * cells.reshape(-1, 3)
            bound = length(points - solid.centre) - solid.shape.reach
            close = np.flatnonzero(bound < block.ravel())
            nearest = block.ravel()
            nearest[close] = np.minimum(nearest[close], solid.distance(points[close]))
            block[...] = nearest.reshape(block.shape)
        return Clearance(corner, cell, grid, scale)

    def at(self, points: np.ndarray) -> np.ndarray:
        """(n,) metres, trilinear; outside the grid as at its border."""
        limit = np.array(self.grid.shape) - 1.001
        q = np.clip((points - self.low) / self.cell, 0, limit)
        cell = q.astype(int)
        f = q - cell
        total = np.zeros(len(points))
        for corner in np.ndindex(2, 2, 2):
            weight = corner_weight(f, corner)
            total += weight * self.grid[tuple((cell + corner).T)]
        return total

    def openness(self, hits: Hits) -> np.ndarray:
        """(n,) 0..1; 1 under a free sky.  Zero where nothing was hit."""
        here = np.flatnonzero(hits.index >= 0)
        out = np.zeros(len(hits.index))
        for above_at_1, weight in STEPS:
            above = above_at_1 * self.scale
            free = self.at(hits.points[here] + above * hits.normals[here])
            out[here] += weight * np.clip(free / above, 0, 1)
        return out
