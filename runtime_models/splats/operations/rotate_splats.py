"""Turns plain splats: places, quaternions and spherical harmonics together."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import basis
from shapeshift.runtime_models.files.blocks import block_of, each_block
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import three
from shapeshift.runtime_models.splats.plain_splats import AXES, PlainSplats

HALF_TURN = np.diag([1.0, -1.0, -1.0])  # about x: between COLMAP's axes and ours
HALF_TURN_Y = np.diag([-1.0, 1.0, -1.0])  # between glTF's axes (left, up, front) and ours
UPSIDE_DOWN = np.diag([-1.0, -1.0, 1.0])  # about z
OURS_FROM_UP = {
    "+Y": np.eye(3),
    "-Y": HALF_TURN,
    "+Z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "-Z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "+X": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "-X": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}  # rotations that bring the named axis to +Y


def ours_from_file(up: str, flip: bool = False, front: bool = False) -> np.ndarray:
    """(3, 3) the turn that brings the file's axis `up` to our +Y.  Raises BadFile.

    front: half a turn about +Y after that; flip: half a turn about z at last.
    """
    if up not in AXES:
        raise BadFile(f"the axis that points up is {up!r}; {', '.join(AXES)} are known.")
    turned = HALF_TURN_Y @ OURS_FROM_UP[up] if front else OURS_FROM_UP[up]
    return UPSIDE_DOWN @ turned if flip else turned


def rotate_splats(splats: PlainSplats, rotation: np.ndarray) -> PlainSplats:
    """The splats after a rotation (3, 3) of the world about its zero."""
    if np.array_equal(rotation, np.eye(3)):
        return splats
    means, wxyz, sh = splats.means.copy(), splats.wxyz.copy(), splats.sh.copy()
    rotate_rows = rotator(rotation, sh.shape[1])
    each_block(len(means), lambda rows, _: rotate_rows(means[rows], wxyz[rows], sh[rows]))
    origin = three(rotation @ np.array(splats.origin))
    return replace(splats, means=means, wxyz=wxyz, sh=sh, origin=origin)


def rotate_half_turn(splats: PlainSplats) -> PlainSplats:
    """Half a turn about x, its own inverse: from COLMAP's axes (y down, z forward) and back."""
    return rotate_splats(splats, HALF_TURN)


def rotator(rotation: np.ndarray, count: int) -> Callable[..., None]:
    """A function that turns, in place, rows of means (n, 3), wxyz (n, 4) and sh (n, count, 3)."""
    if np.array_equal(rotation, np.eye(3)):
        return lambda means, wxyz, sh: None
    if np.array_equal(np.abs(rotation), np.eye(3)):
        return half_turn_rotator(tuple(rotation.diagonal()), count)
    harmonics = rotate_harmonics(rotation, count)

    def rotate_rows(means: np.ndarray, wxyz: np.ndarray, sh: np.ndarray) -> None:
        means[:] = means @ rotation.T
        wxyz[:] = rotate_quaternions(wxyz, rotation)
        sh[:, 1:] = np.einsum("ij,njc->nic", harmonics[1:, 1:], sh[:, 1:], optimize=True)

    return rotate_rows


@cache  # parts of a file are turned one by one
def half_turn_rotator(diagonal: tuple[float, float, float], count: int) -> Callable[..., None]:
    """rotator() of half a turn about the axis whose sign is +1: nothing but signs.

    A quaternion times that of the half turn is itself in another order, with signs.
    """
    signs = np.array(diagonal)
    axis = 1 + int(signs.argmax())
    other = [i for i in (1, 2, 3) if i != axis]
    order = np.array([axis, *(0 if i == axis else 6 - axis - i for i in (1, 2, 3))])
    negative = [0, other[axis == 2]]  # entries of the turned quaternion
    most = block_of(44 + 12 * count)  # rows of the longest block
    tiled = np.tile(signs.astype(np.float32), most)
    harmonic_signs = signs_of_harmonics(signs, count)  # (count,)
    every_channel = np.tile(np.repeat(harmonic_signs, 3), most)

    def rotate_rows(means: np.ndarray, wxyz: np.ndarray, sh: np.ndarray) -> None:
        flip(means, tiled)
        before = wxyz.copy()
        for i in range(4):  # a column each: numpy is slow at runs of four
            column = before[:, order[i]]
            # Not negative(out=...): numpy 2.4.6 without AVX-512 takes neighbours for every fourth.
            wxyz[:, i] = -column if i in negative else column
        if count > 1:
            flip(sh, every_channel)

    return rotate_rows


def flip(rows: np.ndarray, signs: np.ndarray) -> None:
    """Multiplies rows (n, ...) by signs, those of one row after the other, in place."""
    if rows.flags.c_contiguous and rows.size <= len(signs):
        numbers = rows.reshape(-1)  # one long loop, not a short one for each row
        numbers *= signs[: numbers.size]
    else:
        rows *= signs[: math.prod(rows.shape[1:])].reshape(rows.shape[1:])


def signs_of_harmonics(signs: np.ndarray, count: int) -> np.ndarray:
    """(count,) float32: of each basis function after half a turn of the world, itself or minus it.

    Found from its values at directions before and after the turn.
    """
    directions = np.random.default_rng(0).normal(size=(8, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before, after = basis(directions * signs, count), basis(directions, count)
    return np.sign((before * after).sum(axis=0)).astype(np.float32)


def rotate_quaternions(wxyz: np.ndarray, rotation: np.ndarray) -> np.ndarray:
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


def rotate_harmonics(rotation: np.ndarray, count: int) -> np.ndarray:
    """(count, count) float32: coefficients of a function after its world is turned.

    By its meaning, turned(d) = f(R^T d), solved on more directions than there are coefficients:
    exact, as each band of harmonics is closed under rotation.
    """
    directions = np.random.default_rng(0).normal(size=(4 * count + 8, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before = basis(directions @ rotation, count)  # at R^T d
    return np.linalg.lstsq(basis(directions, count), before, rcond=None)[0].astype(np.float32)
