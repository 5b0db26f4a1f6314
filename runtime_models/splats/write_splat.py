"""Plain splats to the .splat format: the inverse of read_splat, SH degree 0."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_half_turn
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.read_splat import ROW


def write_splat(splats: PlainSplats, path: str | Path) -> None:
    """Atomic.  Colours beyond 0..1 and harmonics are lost; the largest splats come first.

    Viewers show such files while they load, so that the order is what is seen first.
    """
    first = np.argsort(-splats.opacity * splats.scales.prod(axis=1, dtype=np.float64), stable=True)
    back = rotate_half_turn(splats)
    table = np.empty(len(first), ROW)
    table["mean"] = back.means[first] + np.array(back.origin)
    table["scale"] = back.scales[first]
    table["rgba"][:, :3] = as_bytes(0.5 + C0 * back.sh[first, 0], 255, 0)
    table["rgba"][:, 3] = as_bytes(back.opacity[first], 255, 0)
    table["wxyz"] = as_bytes(back.wxyz[first], 128, 128)
    write_whole(Path(path), table.tobytes())


def as_bytes(values: np.ndarray, gain: float, zero: float) -> np.ndarray:
    """uint8 of the nearest code, value * gain + zero, at the ends where it lies beyond."""
    return np.clip(np.round(values * gain + zero), 0, 255).astype(np.uint8)
