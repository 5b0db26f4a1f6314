"""Which anchors a hand means: what shows inside a lasso, what lies within a sphere."""

import numpy as np

from shapeshift.scene.pose import View
from shapeshift.scene.scene import SceneObject

BLOCK = 1 << 18  # anchors at a time: their numbers stay in the cache


def on_picture(view: View, places: np.ndarray, obj: SceneObject) -> np.ndarray:
    """(N, 2) float32 pixels from the top left of places (N, 3) metres, object frame.

    NaN for what lies behind the near plane, or is at no place at all.
    """
    eye_from_object = (view.eye_from_world() @ obj.world_from_object.matrix()).astype(np.float32)
    left, right, low, up = view.tangents
    width, height = view.size
    out = np.empty((len(places), 2), np.float32)
    for start in range(0, len(places), BLOCK):
        block = np.asarray(places[start : start + BLOCK], np.float32)
        in_eye = eye_from_object[:3, :3] @ block.T + eye_from_object[:3, 3:]  # (3, n) metres
        depth = -in_eye[2]
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(depth > view.near, 1 / depth, np.float32(np.nan))
        part = out[start : start + BLOCK]
        part[:, 0] = (in_eye[0] * inverse - left) * (width / (right - left))
        part[:, 1] = (up - in_eye[1] * inverse) * (height / (up - low))
    return out


def in_lasso(view: View, places: np.ndarray, obj: SceneObject, outline: np.ndarray) -> np.ndarray:
    """(N,) bool: which places (N, 3), object frame, show within a closed line (P, 2), pixels.

    The line is drawn into a mask of the picture first, so that the number of its corners costs
    nothing an anchor; a place is inside where its pixel's middle is.
    """
    size = view.size
    mask = polygon_mask(np.asarray(outline, np.float64), size)
    pixel = on_picture(view, places, obj)
    with np.errstate(invalid="ignore"):
        seen = (pixel[:, 0] >= 0) & (pixel[:, 0] < size[0])
        seen &= (pixel[:, 1] >= 0) & (pixel[:, 1] < size[1])
    rows = np.flatnonzero(seen)
    column, row = pixel[rows].astype(np.int32).T
    inside = np.zeros(len(places), bool)
    inside[rows[mask[row, column]]] = True
    return inside


def polygon_mask(outline: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W) bool: pixels whose middles lie within a closed line (P, 2), by the even-odd rule.

    Each edge toggles all pixels right of it in the rows that it crosses.
    """
    width, height = size
    toggles = np.zeros((height, width + 1), np.int32)
    for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        if y0 > y1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        first, last = max(int(np.ceil(y0 - 0.5)), 0), min(int(np.ceil(y1 - 0.5)), height)
        rows = np.arange(first, last)
        at = x0 + (rows + 0.5 - y0) * ((x1 - x0) / (y1 - y0))
        columns = np.clip(np.ceil(at - 0.5), 0, width).astype(int)
        np.add.at(toggles, (rows, columns), 1)
    return (np.cumsum(toggles[:, :width], axis=1) & 1).astype(bool)


def in_sphere(places: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """(N,) bool: which places (N, 3) lie at most `radius` metres from `centre` (3,)."""
    off = np.asarray(places, np.float32) - np.asarray(centre, np.float32)
    return np.einsum("nc,nc->n", off, off) <= np.float32(radius) ** 2
