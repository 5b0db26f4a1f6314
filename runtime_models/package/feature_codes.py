"""How a package stores what anchors have: as floats, or a byte each between their column's ends."""

import numpy as np

from shapeshift.runtime_models.files.blocks import BLOCK
from shapeshift.runtime_models.model import AnchorFrames, BadFile
from shapeshift.runtime_models.package.package_files import LIGHT
from shapeshift.runtime_models.rotation import normalize

FEATURES = ("float32", "float16", "uint8")  # kinds of storage
STEPS = 255  # of a byte
MOST_CODE = 127  # the largest number of light, in steps of its column
LEAST_EXPONENT = -140  # of two, of such a step: float32 has it
EXACT = "exact"  # a kind of storage besides FEATURES
HALF_STEPS = 3  # halves of a unit quaternion change its length by less than 3 steps of the largest


def range_of(name: str) -> str:
    """The array that holds the ends of the columns of another one that is stored as bytes."""
    return f"{name.removesuffix('s')}_range"


def exact_kind(features: np.ndarray) -> str:
    """The smallest of FEATURES as which features (A, F) are read again as they are."""
    for kind in reversed(FEATURES):
        found = encode_features(features, kind)
        again = decode_features(found["features"], found.get("feature_range"), "features")
        if np.array_equal(again, features):
            return kind
    return FEATURES[0]


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


def encode_light(light: np.ndarray, kind: str) -> dict[str, np.ndarray]:
    """Arrays of the npz for light by direction (A, L): bytes, unless floats are wanted.

    Each column has steps of a power of two, no more than it needs for its largest number: then
    what is written again, also with fewer anchors, is the same numbers in bytes.  EXACT keeps
    numbers that have no such steps as halves or floats.
    """
    if kind == "float32" or not np.isfinite(light).all():
        return encode_features(light, "float32", LIGHT)
    half, exponent = np.frexp(np.abs(light).max(axis=0, initial=0).astype(np.float64) / MOST_CODE)
    exponent = np.maximum(exponent - (half == 0.5), LEAST_EXPONENT)
    step = np.ldexp(1.0, exponent)
    codes = np.rint(light / step)
    if kind == EXACT and not np.array_equal(codes * step, light):
        return encode_features(light, exact_kind(light), LIGHT)
    ends = step * np.array([[-MOST_CODE - 1], [MOST_CODE]])
    return {
        LIGHT: (codes + MOST_CODE + 1).astype(np.uint8),
        range_of(LIGHT): ends.astype(np.float32),
    }


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


def exact_frames(frames: AnchorFrames) -> dict[str, np.ndarray]:
    """Arrays of the npz for anchors' frames, as halves where these are read as the same numbers."""
    logs = np.log(frames.scales)
    halves = logs.astype(np.float16)
    kind = (
        "float16" if np.array_equal(np.exp(halves.astype(np.float32)), frames.scales) else "float32"
    )
    turns = half_quaternions(frames.wxyz)
    return {
        "frame_log_scales": logs.astype(kind),
        "frame_rotations": frames.wxyz if turns is None else turns,
    }


def half_quaternions(wxyz: np.ndarray) -> np.ndarray | None:
    """(A, 4) float16 whose unit quaternions are exactly these (A, 4); None where there are none.

    Halves are not of length 1, and what is read is divided by it, so the halves that were written
    are looked for at lengths near 1: those at which the largest number is a half.
    """
    rows, found = np.arange(len(wxyz)), np.zeros(wxyz.shape, np.float16)
    largest = np.abs(wxyz).argmax(axis=1)
    halves = wxyz[rows, largest].astype(np.float16)
    missing = np.ones(len(wxyz), bool)
    for step in sorted(range(-HALF_STEPS, HALF_STEPS + 1), key=abs):
        # Of one sign, neighbouring halves are neighbouring integers.
        near = (halves.view(np.uint16) + np.uint16(step % 65536)).view(np.float16)
        scale = near.astype(np.float64) / wxyz[rows, largest]
        tried = (wxyz * scale[:, None]).astype(np.float16)
        same = (normalize(tried.astype(np.float32)) == wxyz).all(axis=1) & missing
        found[same] = tried[same]
        missing &= ~same
    return None if missing.any() else found
