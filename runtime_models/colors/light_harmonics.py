"""An anchor's light by direction: spherical harmonics of degree 1 and 2, alike for all channels.

In units of those of degree 1, so that these are x, y and z of the direction (unit, from the eye):
    x, y, z, sqrt(5) xy, sqrt(5) yz, sqrt(5) zx, sqrt(5/12) (2 z^2 - x^2 - y^2),
    sqrt(5/4) (x^2 - y^2)
"""

import numpy as np

WIDTH = 8  # coefficients
PRODUCT, ZONE, SQUARES = 5**0.5, (5 / 12) ** 0.5, (5 / 4) ** 0.5
DEGREE_2 = (5 / 3) ** 0.5  # length of the last five at any direction; of the first three it is 1


def harmonics(direction: np.ndarray) -> np.ndarray:
    """(N, 8) values at unit directions (N, 3), in their type; all 0 where the direction is 0."""
    out = np.empty((len(direction), WIDTH), direction.dtype)
    x, y, z = direction.T
    out[:, :3] = direction
    for column, (a, b) in enumerate(((x, y), (y, z), (z, x)), 3):
        out[:, column] = PRODUCT * (a * b)
    xx, yy = x * x, y * y
    out[:, 6] = ZONE * (2 * (z * z) - xx - yy)
    out[:, 7] = SQUARES * (xx - yy)
    return out


def light_along(light: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(N, 1) what coefficients (N, 8) give along unit directions (N, 3) from the eye."""
    return np.einsum("nc,nc->n", light, harmonics(direction))[:, None]


def most_light(light: np.ndarray) -> np.ndarray:
    """(N,) float64: what coefficients (N, 8) never exceed, by Cauchy and Schwarz a degree."""
    wide = light.astype(np.float64)
    first, second = (np.linalg.norm(part, axis=1) for part in (wide[:, :3], wide[:, 3:]))
    return first + DEGREE_2 * second


def turn_light(light: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Coefficients (N, 8) of the same light on anchors that a rotation (3, 3) has turned.

    By their meaning, turned(R d) = light(d), solved on more directions than there are coefficients:
    each degree stays within itself, so that the solution is exact.
    """
    directions = np.random.default_rng(0).normal(size=(4 * WIDTH, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    values = light.astype(np.float64) @ harmonics(directions).T  # (N, D)
    at = harmonics(directions @ np.asarray(rotation, np.float64).T)  # (D, 8) at R d
    return (values @ np.linalg.pinv(at).T).astype(light.dtype)
