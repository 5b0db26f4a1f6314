"""Spherical harmonics of colours that a model shows: least squares over directions."""

from collections.abc import Callable

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import basis
from shapeshift.runtime_models.evaluate import directions
from shapeshift.runtime_models.stop_weights import Controls

DIRECTIONS = 64  # colours are asked for along so many: four times the functions of degree 3
ROUND, ROUND_SHARE = 32, 0.02  # where eyes are known: directions all around, what they weigh in all
BLOCK = 1 << 13  # splats, or anchors, at a time: bounds the memory
COLORS = 1 << 23  # colours that are held at a time, 100 MB

ColorAt = Callable[[Controls], np.ndarray]  # (n, 3) as the model has them at a control
# (those of some splats, their rows in the model) -> colours (n, 3) as shown
Recolor = Callable[[ColorAt, np.ndarray], np.ndarray]
ColorAlong = Callable[[np.ndarray], np.ndarray]  # directions (A, 3) -> colours (n, 3) of splats


def spread_directions(count: int) -> np.ndarray:
    """(count, 3) float32 unit directions, evenly over the sphere (a golden spiral)."""
    step = np.arange(count) + 0.5
    z = 1 - 2 * step / count
    turn = np.pi * (1 + 5**0.5) * step
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], 1).astype(np.float32)


def fit_rows(count: int, number: int = DIRECTIONS) -> tuple[np.ndarray, np.ndarray]:
    """Directions (D, 3), and (D, count) what a colour along each adds to every coefficient."""
    directions = spread_directions(number)
    solve = np.linalg.pinv(basis(directions.astype(np.float64), count))  # (count, D)
    return directions, solve.T.astype(np.float32)


def fit_colors(color_along: ColorAlong, anchors: int, count: int, splats: int) -> np.ndarray:
    """(splats, count, 3) harmonics of the colours that are shown, over all directions alike.

    One direction after the other for all anchors: the sum over directions is the least-squares
    solution, so that nothing but it and the colours of one direction is held.
    """
    sh = np.zeros((splats, count, 3), np.float32)
    for direction, parts in zip(*fit_rows(count), strict=True):
        color = color_along(np.tile(direction, (anchors, 1))) - np.float32(0.5)
        for coefficient, part in enumerate(parts):
            sh[:, coefficient] += part * color
    return sh


def fit_seen_colors(
    color_along: ColorAlong, anchors: np.ndarray, rows: np.ndarray, eyes: np.ndarray, count: int
) -> np.ndarray:
    """(n, count, 3) harmonics of the colours that eyes (E, 3) see of splats.

    anchors (A, 3): places, metres; rows (n,), rising: the anchor of each splat.  Each anchor has
    directions of its own, from the eyes, and so normal equations of its own; what is all around
    weighs ROUND_SHARE of all, so that these can be solved and the rest stays near.
    """
    share = (1 - ROUND_SHARE) / len(eyes)
    looks = [(d, ROUND_SHARE / ROUND, True) for d in spread_directions(ROUND)]
    looks += [(eye, share, False) for eye in eyes]
    place = np.arange(len(rows)) - np.searchsorted(rows, rows)  # of a splat, at its anchor
    each = int(place.max(initial=0)) + 1  # splats at an anchor, at most
    sums = np.zeros((len(anchors), count, 3 * each), np.float32)
    together = max(1, min(len(looks), COLORS // (max(len(anchors), 1) * each)))
    for first in range(0, len(looks), together):
        some = looks[first : first + together]
        parts = np.empty((len(anchors), len(some), count), np.float32)
        colors = np.zeros((len(anchors), len(some), each, 3), np.float32)
        for i, (direction, weight, around) in enumerate(some):
            toward = (
                np.tile(direction, (len(anchors), 1)) if around else directions(anchors, direction)
            )
            parts[:, i] = np.float32(weight) * basis(toward, count)
            colors[rows, i, place] = color_along(toward) - np.float32(0.5)
        flat = colors.reshape(len(anchors), len(some), 3 * each)
        for start in range(0, len(anchors), BLOCK):
            block = slice(start, start + BLOCK)
            sums[block] += parts[block].transpose(0, 2, 1) @ flat[block]
    around = basis(spread_directions(ROUND).astype(np.float64), count)
    shared = ROUND_SHARE / ROUND * around.T @ around  # (count, count)
    for start in range(0, len(anchors), BLOCK):
        some = anchors[start : start + BLOCK]
        values = np.stack(
            [basis(directions(some, eye).astype(np.float64), count) for eye in eyes], 1
        )
        normal = shared + share * values.transpose(0, 2, 1) @ values  # (a, count, count)
        block = slice(start, start + len(some))
        sums[block] = np.linalg.inv(normal) @ sums[block]
    return np.ascontiguousarray(sums.reshape(len(anchors), count, each, 3)[rows, :, place])


def recolored(sh: np.ndarray, recolor: Recolor) -> np.ndarray:
    """(N, M, 3) harmonics of what `recolor` makes of the colours of harmonics (N, M, 3)."""
    out = np.empty_like(sh)
    directions, parts = fit_rows(sh.shape[1], 4 * sh.shape[1])
    values = basis(directions, sh.shape[1])  # (D, M)
    for start in range(0, len(sh), BLOCK):
        rows = np.arange(start, min(start + BLOCK, len(sh)))
        color = np.maximum(values @ sh[rows] + np.float32(0.5), 0)  # (n, D, 3), as shade does
        every = np.repeat(rows, len(directions))
        flat = color.reshape(-1, 3)

        def color_at(control: Controls, flat: np.ndarray = flat) -> np.ndarray:
            return flat

        shown = recolor(color_at, every).reshape(color.shape)
        out[rows] = parts.T @ (shown - np.float32(0.5))
    return out
