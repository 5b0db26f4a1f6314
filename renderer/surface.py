"""What a scene is made of besides its colours: depth, normals and coverage of a view."""

from dataclasses import dataclass

import numpy as np

SOLID = 0.5  # coverage under which a pixel shows more background than scene


@dataclass(frozen=True)
class Surface:
    """Blended as colours are, premultiplied over nothing, row 0 on top; float32."""

    metres: np.ndarray  # (H, W) depth along the view times coverage
    normal: np.ndarray  # (H, W, 3) eye axes: x right, y up, z towards the eye
    coverage: np.ndarray  # (H, W) 0..1

    @staticmethod
    def empty(size: tuple[int, int]) -> "Surface":
        width, height = size
        shape = (height, width)
        return Surface(*(np.zeros(s, np.float32) for s in (shape, (*shape, 3), shape)))

    def depth(self, least: float = SOLID) -> np.ndarray:
        """(H, W) metres along the view, NaN where coverage is below `least`.

        A splat's is where the pixel's ray is halfway through its ellipsoid.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self._solid(least), self.metres / self.coverage, np.float32(np.nan))

    def normals(self, least: float = SOLID) -> np.ndarray:
        """(H, W, 3) of length 1, NaN where coverage is below `least` or all directions cancel.

        A splat's is that of its midpoints' surface at its mean: a flat one's own.
        """
        length = np.linalg.norm(self.normal, axis=2)
        usable = self._solid(least) & (length > 1e-6)
        with np.errstate(divide="ignore", invalid="ignore"):
            unit = self.normal / length[..., None]
        return np.where(usable[..., None], unit, np.float32(np.nan))

    def _solid(self, least: float) -> np.ndarray:
        return (self.coverage >= least) & (self.coverage > 0)
