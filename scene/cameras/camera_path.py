"""A smooth path through keyframes: places on a spline, rotations on great arcs between them."""

import numpy as np

from shapeshift.scene.pose import Pose


def along(keys: np.ndarray, t: np.ndarray, closed: bool) -> np.ndarray:
    """(T, D) values at times t (T,) of the spline through keys (K, D), which key i passes at t = i.

    Catmull-Rom: at a key the speed is half the way from the key before it to the one after it.
    A closed path goes on from its last key to its first; an open one ends with half a lean.
    """
    keys = np.asarray(keys, np.float64)
    count = len(keys)
    if count == 1:
        return np.repeat(keys, len(t), axis=0)
    leg = np.minimum(np.floor(t).astype(int), count - 1 if closed else count - 2)  # (T,)
    part = (t - leg)[:, None]  # 0..1
    if closed:
        around = [keys[(leg + step) % count] for step in (-1, 0, 1, 2)]
    else:
        ends = np.concatenate([2 * keys[:1] - keys[1:2], keys, 2 * keys[-1:] - keys[-2:-1]])
        around = [ends[leg + step] for step in (0, 1, 2, 3)]
    before, start, end, after = around
    leave, arrive = (end - before) / 2, (after - start) / 2
    p2, p3 = part**2, part**3
    return (
        (2 * p3 - 3 * p2 + 1) * start + (p3 - 2 * p2 + part) * leave
        + (3 * p2 - 2 * p3) * end + (p3 - p2) * arrive
    )  # fmt: skip


def turning(wxyz: np.ndarray, t: np.ndarray, closed: bool) -> np.ndarray:
    """(T, 4) unit quaternions at times t (T,), on the great arc from key to key of (K, 4)."""
    count = len(wxyz)
    if count == 1:
        return np.repeat(wxyz, len(t), axis=0)
    leg = np.minimum(np.floor(t).astype(int), count - 1 if closed else count - 2)
    part = t - leg
    return slerp(wxyz[leg], wxyz[(leg + 1) % count], part)


def slerp(one: np.ndarray, other: np.ndarray, part: np.ndarray) -> np.ndarray:
    """(T, 4) unit quaternions `part` (T,) of the shorter way between unit quaternions (T, 4)."""
    cosine = (one * other).sum(axis=1)
    other = np.where(cosine[:, None] < 0, -other, other)
    angle = np.arccos(np.clip(np.abs(cosine), 0, 1))  # radians, 0..pi/2
    near = angle < 1e-6  # there the arc is its chord
    sine = np.where(near, 1.0, np.sin(angle))
    weight_one = np.where(near, 1 - part, np.sin((1 - part) * angle) / sine)
    weight_other = np.where(near, part, np.sin(part * angle) / sine)
    mixed = weight_one[:, None] * one + weight_other[:, None] * other
    return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def poses_between(poses: list[Pose], t: np.ndarray, closed: bool = False) -> list[Pose]:
    """The poses at times t (T,), where pose i is reached at t = i."""
    places = along(np.array([p.position for p in poses]), t, closed)
    turns = turning(np.array([p.wxyz for p in poses]), t, closed)
    return [Pose(place, turn) for place, turn in zip(places, turns, strict=True)]
