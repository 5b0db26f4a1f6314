"""Prompts for a photo in which nobody has marked the object, from where the scene believes it."""

import numpy as np
from scipy import ndimage

from shapeshift.decomposition.masks.segmenter import Prompt

THERE = 0.5  # share of a pixel that is believed to be the object's
LEAST_PIXELS = 12  # of a part of the object, to count
SPECK = 0.05  # of the largest part: smaller ones are left out of the box
MARGIN = 0.04  # of the box's longer side, around what is believed
CLICKS = 3  # inside


def prompts_of(share: np.ndarray, text: str = "") -> list[Prompt]:
    """share: (H, W) 0..1 of each pixel that is believed to be the object's.

    A box, the box with clicks and about where the object is, and clicks alone: a segmenter answers
    them differently, and the support chooses.  [] where nothing is believed.
    """
    parts, count = ndimage.label(share > THERE)
    if not count:
        return []
    sizes = np.bincount(parts.ravel())[1:]
    kept = np.flatnonzero(sizes >= max(LEAST_PIXELS, SPECK * sizes.max())) + 1
    there = np.isin(parts, kept)
    if not there.any():
        return []
    box, clicks = box_of(there), clicks_in(there)
    return [
        Prompt(box, text=text),
        Prompt(box, clicks, mask=there, text=text),
        Prompt(inside=clicks, text=text),
    ]


def box_of(mask: np.ndarray) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of the pixels and a margin, within the picture."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    left, top, right, bottom = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
    margin = max(MARGIN * max(right - left, bottom - top), 1.0)
    height, width = mask.shape
    return (
        float(max(left - margin, 0)), float(max(top - margin, 0)),
        float(min(right + margin, width)), float(min(bottom + margin, height)),
    )  # fmt: skip


def clicks_in(mask: np.ndarray) -> np.ndarray:
    """(n, 2) x, y: deep inside the mask, and far from each other."""
    depth = ndimage.distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    found: list[tuple[float, float]] = []
    rows, columns = np.mgrid[: mask.shape[0], : mask.shape[1]]
    for _ in range(CLICKS):
        row, column = np.unravel_index(int(depth.argmax()), depth.shape)
        radius = depth[row, column]
        if not radius >= 1:
            break
        found.append((column + 0.5, row + 0.5))
        away = np.hypot(rows - row, columns - column)
        depth = np.where(away < 2 * radius, 0, depth)
    return np.array(found).reshape(-1, 2)
