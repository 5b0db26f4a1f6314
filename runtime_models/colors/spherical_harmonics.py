"""Colour of plain splats from spherical harmonics, with 3DGS's constants and signs."""

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
