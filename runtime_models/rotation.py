"""Quaternions to rotation matrices and covariances, for many splats at once."""

import numpy as np


def normalize(wxyz: np.ndarray) -> np.ndarray:
    """(N, 4) unit quaternions; zero becomes the identity, what is not finite is NaN: not drawn."""
    length = np.sqrt(np.einsum("nc,nc->n", wxyz, wxyz))  # 5 times faster than linalg.norm
    usual = (length > 1e-15) & (length < 1e15)  # squares are far from the ends of float32
    if usual.all():
        return wxyz / length[:, None]
    out = np.empty_like(wxyz)
    out[usual] = wxyz[usual] / length[usual, None]
    # By the largest entry first: nothing over- or underflows.
    rest = wxyz[~usual]
    largest = np.abs(rest).max(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        rest = np.where(largest == 0, np.eye(4, dtype=wxyz.dtype)[0], rest / largest)
        out[~usual] = rest / np.linalg.norm(rest, axis=1, keepdims=True)
    return out


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, 4) quaternions of the rotations b (N, 4), then a (N, 4)."""
    w, x, y, z = np.moveaxis(a, -1, 0)
    s, i, j, k = np.moveaxis(b, -1, 0)
    columns = (
        w * s - x * i - y * j - z * k,
        w * i + x * s + y * k - z * j,
        w * j - x * k + y * s + z * i,
        w * k + x * j - y * i + z * s,
    )
    return np.stack(columns, axis=-1)


def rotation_matrices(wxyz: np.ndarray) -> np.ndarray:
    """(N, 3, 3) of unit quaternions (N, 4)."""
    w, x, y, z = np.moveaxis(wxyz, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def quaternions_of(matrices: np.ndarray) -> np.ndarray:
    """(N, 4) wxyz of rotations (N, 3, 3): each component's square is known, take the largest."""
    m = matrices
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    squares = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], 1)
    products = np.empty((len(m), 4, 4))  # 4 q q^T
    products[:, range(4), range(4)] = squares
    pairs = {
        (0, 1): m[:, 2, 1] - m[:, 1, 2], (0, 2): m[:, 0, 2] - m[:, 2, 0],
        (0, 3): m[:, 1, 0] - m[:, 0, 1], (1, 2): m[:, 0, 1] + m[:, 1, 0],
        (1, 3): m[:, 0, 2] + m[:, 2, 0], (2, 3): m[:, 1, 2] + m[:, 2, 1],
    }  # fmt: skip
    for (i, j), value in pairs.items():
        products[:, i, j] = products[:, j, i] = value
    rows = products[np.arange(len(m)), squares.argmax(1)]
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def covariance(scales: np.ndarray, wxyz: np.ndarray) -> np.ndarray:
    """(N, 6) xx xy xz yy yz zz in m^2 of R S S^T R^T (paper eq. 1); scales (N, 3), wxyz (N, 4)."""
    m = rotation_matrices(normalize(wxyz)) * scales[:, None, :]  # (N, 3, 3)
    full = m @ np.swapaxes(m, 1, 2)
    return full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
