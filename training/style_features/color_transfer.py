"""The colours of a style, colour by colour, so that they are the same from every view."""

from dataclasses import dataclass

import numpy as np

FLAT = 1e-5  # added to variances: a picture of one colour has none


@dataclass(frozen=True)
class ColorTransfer:
    """color -> matrix @ color + offset."""

    matrix: np.ndarray  # (3, 3)
    offset: np.ndarray  # (3,)

    def __call__(self, picture: np.ndarray) -> np.ndarray:
        """(..., 3) float32 display sRGB, clipped to 0..1."""
        return np.clip(picture @ self.matrix.T + self.offset, 0, 1).astype(np.float32)


def color_transfer(scene: np.ndarray, style: np.ndarray) -> ColorTransfer:
    """Gives colours (N, 3) the mean and the covariance of others (M, 3), moving them least.

    That is the Monge-Kantorovich map between normal distributions (Pitie and Kokaram 2007):
    A = S^-1/2 (S^1/2 T S^1/2)^1/2 S^-1/2 of the covariances S of the scene and T of the style.
    """
    before, after = (np.asarray(colors, np.float64).reshape(-1, 3) for colors in (scene, style))
    own, wanted = (np.cov(c, rowvar=False) + FLAT * np.eye(3) for c in (before, after))
    root, back = power(own, 0.5), power(own, -0.5)
    matrix = back @ power(root @ wanted @ root, 0.5) @ back
    return ColorTransfer(matrix, after.mean(axis=0) - matrix @ before.mean(axis=0))


def power(matrix: np.ndarray, exponent: float) -> np.ndarray:
    """Of a symmetric positive matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.maximum(values, FLAT**2) ** exponent) @ vectors.T
