"""COLMAP's points3D, text or binary: places and colours; tracks are stepped over."""

import mmap
from array import array
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.colmap.text_lines import AGAIN, lines_of, numbers_of
from shapeshift.scene.captures.colmap_tables import COUNT, count_of, mapped, short_of

POINT = np.dtype([("number", "<u8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8")])
STEP_OF_TRACK = 8  # bytes
WORDS = 8  # of a line of text before its track
FARTHEST = 1e30  # beyond this float32 ends soon


def read_colmap_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) float64 places and (P, 3) uint8 colours, in the order of their numbers; BadFile."""
    if not path.is_file():
        raise BadFile(f"{path} is missing; copy the whole COLMAP model.")
    if path.suffix == ".bin":
        with mapped(path) as data:
            rows = points_of_bytes(data, path)
    else:
        rows = points_of_text(path)
    rows = rows[np.argsort(rows["number"], kind="stable")]
    if not (np.abs(rows["xyz"]) < FARTHEST).all():
        raise BadFile(f"{path}: some points are nowhere (NaN, Inf or beyond measure); {AGAIN}.")
    return rows["xyz"].copy(), rows["rgb"].copy()


def points_of_bytes(data: bytes | mmap.mmap, path: Path) -> np.ndarray:
    """(P,) POINT; where each begins is found one by one, as tracks have any length."""
    count, at = count_of(data, POINT.itemsize + COUNT.size, path), COUNT.size
    starts = array("Q")
    for _ in range(count):
        end = at + POINT.itemsize
        if end + COUNT.size > len(data):
            raise short_of(path, count, "points")
        steps = COUNT.unpack_from(data, end)[0]
        starts.append(at)
        at = end + COUNT.size
        if steps > (len(data) - at) // STEP_OF_TRACK:
            raise short_of(path, count, "points")
        at += steps * STEP_OF_TRACK
    rows = np.empty((count, POINT.itemsize), np.uint8)
    whole, first = np.frombuffer(data, np.uint8), np.array(starts, np.int64)
    for byte in range(POINT.itemsize):
        rows[:, byte] = whole[first + byte]
    return rows.reshape(-1).view(POINT)


def points_of_text(path: Path) -> np.ndarray:
    """(P,) POINT."""
    values = []
    for line, text in enumerate(lines_of(path), 1):
        words = text.split(maxsplit=WORDS)
        if not words or words[0].startswith(b"#"):
            continue
        if len(words) < WORDS:
            raise BadFile(f"{path}, line {line}: a number, a place, a colour and an error wanted.")
        values.append(numbers_of(words[:WORDS], f"{path}, line {line}"))
    table = np.array(values, np.float64).reshape(-1, WORDS)
    rows = np.zeros(len(table), POINT)
    rows["number"] = table[:, 0].clip(0, 2.0**63)
    rows["xyz"], rows["rgb"] = table[:, 1:4], table[:, 4:7].clip(0, 255)
    return rows
