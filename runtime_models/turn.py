"""Turns plain splats: places, quaternions and spherical harmonics together."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from runtime_models.blocks import BLOCK, each_block
from runtime_models.model import BadFile
from runtime_models.plain_splats import AXES, PlainSplats
from runtime_models.spherical_harmonics import HALF_TURN_SIGNS, basis

HALF_TURN = np.diag([1.0, -1.0, -1.0])  # about x: between COLMAP's axes and ours
PLACE_SIGNS = np.array([1, -1, -1], np.float32)  # of that half turn
TILED_SIGNS = np.tile(PLACE_SIGNS, 4 * BLOCK)  # of the longest block
QUATERNION_SIGNS = np.array([-1, 1, -1, 1], np.float32)  # of x w z y
HARMONIC_SIGNS = np.repeat(HALF_TURN_SIGNS, 3)  # of every channel
UPSIDE_DOWN = np.diag([-1.0, -1.0, 1.0])  # about z
OURS_FROM_UP = {
    "+Y": np.eye(3),
    "-Y": HALF_TURN,
    "+Z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "-Z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "+X": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "-X": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}  # rotations that bring the named axis to +Y


def ours_from_file(up: str, flip: bool = False) -> np.ndarray:
    """(3, 3) the turn that brings the file's axis `up` to our +Y.  Raises BadFile."""
    if up not in AXES:
        raise BadFile(f"the axis that points up is {up!r}; {', '.join(AXES)} are known.")
    return UPSIDE_DOWN @ OURS_FROM_UP[up] if flip else OURS_FROM_UP[up]


def turn(splats: PlainSplats, rotation: np.ndarray) -> PlainSplats:
    """The splats after a rotation (3, 3) of the world about its zero."""
    if np.array_equal(rotation, np.eye(3)):
        return splats
    means, wxyz, sh = splats.means.copy(), splats.wxyz.copy(), splats.sh.copy()
    turn_rows = turner(rotation, sh.shape[1])
    each_block(len(means), lambda rows, _: turn_rows(means[rows], wxyz[rows], sh[rows]))
    origin = tuple(map(float, rotation @ np.array(splats.origin)))
    return replace(splats, means=means, wxyz=wxyz, sh=sh, origin=origin)


def turn_half(splats: PlainSplats) -> PlainSplats:
    """Half a turn about x, its own inverse: from COLMAP's axes (y down, z forward) and back."""
    return turn(splats, HALF_TURN)


def turner(rotation: np.ndarray, count: int) -> Callable[..., None]:
    """A function that turns, in place, rows of means (n, 3), wxyz (n, 4) and sh (n, count, 3)."""
    if np.array_equal(rotation, np.eye(3)):
        return lambda means, wxyz, sh: None
    if np.array_equal(rotation, HALF_TURN):
        return turn_rows_half
    harmonics = turn_harmonics(rotation, count)

    def turn_rows(means: np.ndarray, wxyz: np.ndarray, sh: np.ndarray) -> None:
        means[:] = means @ rotation.T
        wxyz[:] = turn_quaternions(wxyz, rotation)
        sh[:, 1:] = np.einsum("ij,njc->nic", harmonics[1:, 1:], sh[:, 1:], optimize=True)

    return turn_rows


def turn_rows_half(means: np.ndarray, wxyz: np.ndarray, sh: np.ndarray) -> None:
    """Half a turn about x, in place: nothing but signs, and quaternions (0, 1, 0, 0) * wxyz."""
    if means.flags.c_contiguous and 3 * len(means) <= len(TILED_SIGNS):
        flat = means.reshape(-1)  # one long loop, not one of three for each
        flat *= TILED_SIGNS[: flat.size]
    else:
        means *= PLACE_SIGNS
    wxyz[:] = wxyz.take((1, 0, 3, 2), axis=1)
    wxyz *= QUATERNION_SIGNS
    if sh.shape[1] == 1:
        return
    if sh.flags.c_contiguous:
        flat = sh.reshape(len(sh), -1)  # one long loop a splat, not many of three
        flat *= HARMONIC_SIGNS[: flat.shape[1]]
    else:
        sh *= HALF_TURN_SIGNS[: sh.shape[1], None]


def turn_quaternions(wxyz: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(N, 4) q * wxyz, q being the rotation (3, 3)."""
    w, x, y, z = quaternion_of(rotation)
    left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return (wxyz @ left.T).astype(np.float32)


def quaternion_of(rotation: np.ndarray) -> np.ndarray:
    """(4,) wxyz of a rotation (3, 3): the eigenvector of the largest eigenvalue (Bar-Itzhack)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    k = np.array(
        [
            [a + e + i, h - f, c - g, d - b],
            [h - f, a - e - i, b + d, c + g],
            [c - g, b + d, e - a - i, f + h],
            [d - b, c + g, f + h, i - a - e],
        ]
    )
    return np.linalg.eigh(k)[1][:, -1]


def turn_harmonics(rotation: np.ndarray, count: int) -> np.ndarray:
    """(count, count) float32: coefficients of a function after its world is turned.

    By its meaning, turned(d) = f(R^T d), solved on more directions than there are coefficients:
    exact, as each band of harmonics is closed under rotation.
    """
    directions = np.random.default_rng(0).normal(size=(4 * count + 8, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before = basis(directions @ rotation, count)  # at R^T d
    return np.linalg.lstsq(basis(directions, count), before, rcond=None)[0].astype(np.float32)
