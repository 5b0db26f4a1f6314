"""COLMAP's points3D, text or binary: places and colours; tracks are stepped over."""

import struct
from pathlib import Path

import numpy as np

from runtime_models.model import BadFile
from scene.colmap_tables import AGAIN, COUNT, count_of, numbers_of, short_of, text_lines

POINT = struct.Struct("<Q3d3BdQ")  # number, place, colour, error, steps of its track
STEP_OF_TRACK = 8  # bytes
FARTHEST = 1e30  # beyond this float32 ends soon
WORDS = 8  # of a line of text before its track


def read_colmap_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) float64 places and (P, 3) uint8 colours, in the order of their numbers; BadFile."""
    if not path.is_file():
        raise BadFile(f"{path} is missing; copy the whole COLMAP model.")
    rows = points_of_bytes(path) if path.suffix == ".bin" else points_of_text(path)
    rows.sort(key=lambda row: row[0])
    xyz = np.array([row[1:4] for row in rows], np.float64).reshape(-1, 3)
    rgb = np.array([row[4:7] for row in rows], np.float64).reshape(-1, 3)
    if not (np.abs(xyz) < FARTHEST).all():
        raise BadFile(f"{path}: some points are nowhere (NaN, Inf or beyond measure); {AGAIN}.")
    return xyz, rgb.clip(0, 255).astype(np.uint8)


def points_of_bytes(path: Path) -> list[tuple]:
    data = path.read_bytes()
    count, at = count_of(data, POINT.size, path), COUNT.size
    rows = []
    for _ in range(count):
        if at + POINT.size > len(data):
            raise short_of(path, count, "points")
        *row, _, steps = POINT.unpack_from(data, at)
        at += POINT.size
        if steps > (len(data) - at) // STEP_OF_TRACK:
            raise short_of(path, count, "points")
        at += steps * STEP_OF_TRACK
        rows.append(tuple(row))
    return rows


def points_of_text(path: Path) -> list[tuple]:
    rows = []
    for line, text in enumerate(text_lines(path), 1):
        words = text.split(maxsplit=WORDS)
        if not words or words[0].startswith("#"):
            continue
        if len(words) < WORDS:
            raise BadFile(f"{path}, line {line}: a number, a place, a colour and an error wanted.")
        rows.append(tuple(numbers_of(words[:WORDS], f"{path}, line {line}")))
    return rows
