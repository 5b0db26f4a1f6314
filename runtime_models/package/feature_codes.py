"""How a package stores what anchors have: as floats, or a byte each between their column's ends."""

import numpy as np

from shapeshift.runtime_models.files.blocks import BLOCK
from shapeshift.runtime_models.model import BadFile

FEATURES = ("float32", "float16", "uint8")  # kinds of storage
STEPS = 255  # of a byte


def range_of(name: str) -> str:
    """The array that holds the ends of the columns of another one that is stored as bytes."""
    return f"{name.removesuffix('s')}_range"


def encode_features(
    features: np.ndarray, kind: str, name: str = "features"
) -> dict[str, np.ndarray]:
    """Arrays of the npz for features (A, F), or for another table of such numbers by its `name`.

    float16 becomes float32 where a value is too large.  uint8: `feature_range` (2, F) float32 holds
    each column's least and largest value.
    """
    if kind not in FEATURES:
        raise ValueError(f"features cannot be stored as {kind!r}; use {', '.join(FEATURES)}.")
    if kind != "uint8":
        largest = np.abs(features).max(initial=0)
        fits = largest <= np.finfo(np.dtype(kind)).max
        return {name: features.astype(kind if fits else "float32")}
    ends = np.zeros((2, features.shape[1]), np.float32)
    if len(features):
        ends = np.stack([features.min(axis=0), features.max(axis=0)]).astype(np.float32)
    low, high = ends.astype(np.float64)
    width = np.where(high > low, high - low, 1.0)
    codes = np.rint((features - low) * (STEPS / width))
    return {name: codes.astype(np.uint8), range_of(name): ends}


def decode_features(
    codes: np.ndarray, ends: np.ndarray | None, where: str, name: str = "features"
) -> np.ndarray:
    """(A, F) float32 of what the npz holds.  Raises BadFile; `where` is for messages."""
    if codes.dtype != np.uint8:
        return np.ascontiguousarray(codes, np.float32)
    wanted = (2, codes.shape[1])
    if ends is None or ends.shape != wanted or ends.dtype != np.float32:
        found = "nothing" if ends is None else f"{ends.dtype} of shape {ends.shape}"
        raise BadFile(
            f"{where}: {name} are bytes, which need {range_of(name)}, float32 of shape {wanted}; "
            f"found {found}; export it again."
        )
    low, high = ends.astype(np.float64)
    if not (np.isfinite(ends).all() and (low <= high).all() and np.isfinite(high - low).all()):
        raise BadFile(
            f"{where}: {range_of(name)} is not a lower row, then a higher one of numbers."
        )
    step, out = (high - low) / STEPS, np.empty(codes.shape, np.float32)
    for start in range(0, len(codes), BLOCK):  # float64 of all would be three times the memory
        rows = slice(start, start + BLOCK)
        out[rows] = low + codes[rows] * step
    return out
