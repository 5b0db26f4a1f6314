"""An anchor's light by direction: spherical harmonics of degree 1 and 2, in one channel that is
alike for red, green and blue, or in three: eight coefficients of red, then green, then blue.

In units of those of degree 1, so that these are x, y and z of the direction (unit, from the eye):
    x, y, z, sqrt(5) xy, sqrt(5) yz, sqrt(5) zx, sqrt(5/12) (2 z^2 - x^2 - y^2),
    sqrt(5/4) (x^2 - y^2)
"""

import numpy as np

COEFFICIENTS = 8  # a channel
WIDTHS = {1: 8, 3: 24}  # numbers an anchor, by channels
PRODUCT, ZONE, SQUARES = 5**0.5, (5 / 12) ** 0.5, (5 / 4) ** 0.5
DEGREE_2 = (5 / 3) ** 0.5  # length of the last five at any direction; of the first three it is 1


def harmonics(direction: np.ndarray) -> np.ndarray:
    """(N, 8) values at unit directions (N, 3), in their type; all 0 where the direction is 0."""
    out = np.empty((len(direction), COEFFICIENTS), direction.dtype)
    x, y, z = direction.T
    out[:, :3] = direction
    for column, (a, b) in enumerate(((x, y), (y, z), (z, x)), 3):
        out[:, column] = PRODUCT * (a * b)
    xx, yy = x * x, y * y
    out[:, 6] = ZONE * (2 * (z * z) - xx - yy)
    out[:, 7] = SQUARES * (xx - yy)
    return out


def channels_of(light: np.ndarray) -> int:
    """C, 1 or 3, of coefficients (N, 8 C)."""
    return light.shape[1] // COEFFICIENTS


def by_channel(light: np.ndarray) -> np.ndarray:
    """(N, C, 8) of coefficients (N, 8 C)."""
    return light.reshape(len(light), -1, COEFFICIENTS)


def light_along(light: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(N, C) what coefficients (N, 8 C) give along unit directions (N, 3) from the eye."""
    return np.einsum("nkc,nc->nk", by_channel(light), harmonics(direction))


def most_light(light: np.ndarray) -> np.ndarray:
    """(N, C) float64: what coefficients (N, 8 C) never exceed, by Cauchy and Schwarz a degree."""
    wide = by_channel(light.astype(np.float64))
    first, second = (np.linalg.norm(part, axis=2) for part in (wide[..., :3], wide[..., 3:]))
    return first + DEGREE_2 * second


def turn_light(light: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Coefficients (N, 8 C) of the same light on anchors that a rotation (3, 3) has turned.

    By their meaning, turned(R d) = light(d), solved on more directions than there are coefficients:
    each degree stays within itself, so that the solution is exact.
    """
    directions = np.random.default_rng(0).normal(size=(4 * COEFFICIENTS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    values = by_channel(light.astype(np.float64)) @ harmonics(directions).T  # (N, C, D)
    at = harmonics(directions @ np.asarray(rotation, np.float64).T)  # (D, 8) at R d
    return (values @ np.linalg.pinv(at).T).reshape(light.shape).astype(light.dtype)
