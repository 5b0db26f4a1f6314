"""Where the eye will be: what its last step leads to."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shapeshift.scene.pose import Pose, View

STEPS = 15  # frames ahead
FARTHEST = math.radians(40)  # that a view is turned ahead


def views_ahead(before: Sequence[View], now: Sequence[View], steps: int = STEPS) -> list[View]:
    """The views after so many more steps like the last one; [] where nothing moves, or jumps."""
    if len(before) != len(now):
        return []
    out = []
    for old, new in zip(before, now, strict=True):
        step = new.world_from_eye.position - old.world_from_eye.position
        turn = product(new.world_from_eye.wxyz, conjugate(old.world_from_eye.wxyz))
        turn = turn if turn[0] >= 0 else -turn
        sine = float(np.linalg.norm(turn[1:]))
        angle = 2 * math.atan2(sine, turn[0])
        if not (step.any() or angle > 0) or angle * steps > 4 * FARTHEST:
            return []
        wxyz = new.world_from_eye.wxyz
        if sine > 0:
            half = min(angle * steps, FARTHEST) / 2
            ahead = np.array([math.cos(half), *(math.sin(half) * turn[1:] / sine)])
            wxyz = product(ahead, wxyz)
            wxyz = wxyz / np.linalg.norm(wxyz)
        out.append(
            replace(new, world_from_eye=Pose(new.world_from_eye.position + steps * step, wxyz))
        )
    return out


def conjugate(wxyz: np.ndarray) -> np.ndarray:
    return wxyz * np.array([1.0, -1, -1, -1])


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternions wxyz: the turn b, then a."""
    w, v = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([w, *v])
