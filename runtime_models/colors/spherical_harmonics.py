"""Spherical harmonics: colour of plain splats, with 3DGS's constants and signs, and the light of
anchors.
"""

import numpy as np

C0 = 0.28209479177387814
C1 = 0.4886025119029199
C2 = (
    1.0925484305920792,
    1.0925484305920792,
    0.31539156525252005,
    1.0925484305920792,
    0.5462742152960396,
)
C3 = (0.5900435899266435, 2.890611442640554, 0.4570457994644658, 0.3731763325901154)
COEFFICIENTS = (1, 4, 9, 16)  # of degree 0, 1, 2, 3


def basis(direction: np.ndarray, count: int) -> np.ndarray:
    """(N, count) values of the first `count` functions at unit directions (N, 3)."""
    x, y, z = direction.T
    out = [np.full_like(x, C0)]
    if count > 1:
        out += [-C1 * y, C1 * z, -C1 * x]
    if count > 4:
        xx, yy, zz = x * x, y * y, z * z
        out += [C2[0] * x * y, -C2[1] * y * z, C2[2] * (2 * zz - xx - yy)]
        out += [-C2[3] * x * z, C2[4] * (xx - yy)]
        if count > 9:
            out += [-C3[0] * y * (3 * xx - yy), C3[1] * x * y * z, -C3[2] * y * (4 * zz - xx - yy)]
            out += [C3[3] * z * (2 * zz - 3 * xx - 3 * yy), -C3[2] * x * (4 * zz - xx - yy)]
            out += [C3[1] / 2 * z * (xx - yy), -C3[0] * x * (xx - 3 * yy)]
    return np.stack(out, 1)


def shade(sh: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(N, 3) display sRGB, at least 0, of coefficients (N, M, 3) seen along directions (N, 3)."""
    out = (basis(direction, sh.shape[1])[:, None] @ sh)[:, 0]
    out += 0.5
    return np.maximum(out, 0, out=out)


# An anchor's light by direction is spherical harmonics of degree 1 and 2, in one channel that is
# alike for red, green and blue, or in three: eight coefficients of red, then green, then blue.
#
# In units of those of degree 1, so that these are x, y and z of the direction (unit, from the eye):
#     x, y, z, sqrt(5) xy, sqrt(5) yz, sqrt(5) zx, sqrt(5/12) (2 z^2 - x^2 - y^2),
#     sqrt(5/4) (x^2 - y^2)

LIGHT_COEFFICIENTS = 8  # a channel
WIDTHS = {1: 8, 3: 24}  # numbers an anchor, by channels
PRODUCT, ZONE, SQUARES = 5**0.5, (5 / 12) ** 0.5, (5 / 4) ** 0.5
DEGREE_2 = (5 / 3) ** 0.5  # length of the last five at any direction; of the first three it is 1


def harmonics(direction: np.ndarray) -> np.ndarray:
    """(N, 8) values at unit directions (N, 3), in their type; all 0 where the direction is 0."""
    out = np.empty((len(direction), LIGHT_COEFFICIENTS), direction.dtype)
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
    return light.shape[1] // LIGHT_COEFFICIENTS


def by_channel(light: np.ndarray) -> np.ndarray:
    """(N, C, 8) of coefficients (N, 8 C)."""
    return light.reshape(len(light), -1, LIGHT_COEFFICIENTS)


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
    directions = np.random.default_rng(0).normal(size=(4 * LIGHT_COEFFICIENTS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    values = by_channel(light.astype(np.float64)) @ harmonics(directions).T  # (N, C, D)
    at = harmonics(directions @ np.asarray(rotation, np.float64).T)  # (D, 8) at R d
    return (values @ np.linalg.pinv(at).T).reshape(light.shape).astype(light.dtype)
