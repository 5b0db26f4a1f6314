"""How well label maps agree with true ones: the figures of OWD's Table 4.1, an object at a time.

Intersection over union of a view is that of the object's pixels; mIoU is the mean over the views
that show the object, then over objects, as LERF-Mask is scored (Gaussian Grouping).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.model import ObjectLabel

SILENT = 255  # of a true map: what is found there counts neither way
BOUNDARY = 0.02  # of the diagonal: so wide a band inside a mask's edge is its boundary


@dataclass(frozen=True)
class LabelScore:
    """One object's agreement, each a mean over views; NaN where no view shows it."""

    object: ObjectLabel
    iou: float  # 0..1
    boundary_iou: float  # 0..1: of the bands along the edges (Boundary IoU, Cheng 2021)
    accuracy: float  # 0..1: the part of its true pixels that was found
    views: int  # that show it, in truth or by mistake


def score_maps(
    pairs: Iterable[tuple[np.ndarray, np.ndarray]], objects: Sequence[ObjectLabel]
) -> list[LabelScore]:
    """A LabelScore an object, of pairs of label maps (H, W) uint8: found and true."""
    rows: dict[int, list[tuple[float, float, float]]] = {each.label: [] for each in objects}
    for found, true in pairs:
        if found.shape != true.shape:
            raise ValueError(f"a label map of {found.shape} pixels is compared with {true.shape}")
        said = true != SILENT
        for label, values in rows.items():
            one, other = (found == label) & said, true == label
            if one.any() or other.any():
                values.append((iou(one, other), boundary_iou(one, other), recall(one, other)))
    return [LabelScore(each, *mean_of(rows[each.label]), len(rows[each.label])) for each in objects]


def mean_of(values: list[tuple[float, float, float]]) -> tuple[float, float, float]:
    """The mean of each column over the views that say something."""
    if not values:
        return np.nan, np.nan, np.nan
    columns = np.array(values).T
    first, second, third = (c[~np.isnan(c)].mean() if (~np.isnan(c)).any() else np.nan
                            for c in columns)  # fmt: skip
    return float(first), float(second), float(third)


def mean_score(scores: Sequence[LabelScore], name: str = "iou") -> float:
    """The mean of a figure over the objects that some view shows: of "iou" the mIoU."""
    values = [getattr(score, name) for score in scores if score.views]
    return float(np.nanmean(values)) if values else np.nan


def iou(one: np.ndarray, other: np.ndarray) -> float:
    """Of two masks (H, W) bool; NaN of two empty ones."""
    union = (one | other).sum()
    return float((one & other).sum() / union) if union else np.nan


def recall(found: np.ndarray, true: np.ndarray) -> float:
    """The part of the true pixels that was found; NaN without such."""
    return float((found & true).sum() / true.sum()) if true.any() else np.nan


def boundary_iou(one: np.ndarray, other: np.ndarray, part: float = BOUNDARY) -> float:
    """The IoU of the bands, `part` of the picture's diagonal wide, inside both masks' edges.

    Of a large object the plain IoU hardly feels its edge.  A picture's border is an edge, too.
    """
    wide = max(round(part * float(np.hypot(*one.shape))), 1)
    return iou(band_inside(one, wide), band_inside(other, wide))


def band_inside(mask: np.ndarray, wide: int) -> np.ndarray:
    """(H, W) bool: pixels of a mask within `wide` pixels, along an axis or both, of its outside."""
    from scipy.ndimage import minimum_filter

    if not mask.any():
        return mask
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    inner = minimum_filter(mask[box].astype(np.uint8), 2 * wide + 1, mode="constant", cval=0)
    out = np.zeros_like(mask)
    out[box] = mask[box] & (inner == 0)
    return out
