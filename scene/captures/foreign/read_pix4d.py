"""Pix4D's params/NAME_calibrated_camera_parameters.txt, with NAME_offset.xyz beside it.

Its head says the form: name and size, K (3 rows), radial (3) and tangential (2) distortion, place,
R (3 rows), m = K [R|-Rt] X; pixels from the upper left, z of the world up.
"""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.foreign.foreign_frames import (
    Z_UP,
    Gathered,
    PhotoIndex,
    brown_lens,
    checked_size,
    text_in,
    world_from,
)
from shapeshift.scene.captures.foreign.read_bundler import TableWords
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

MARK, LAST = "fileName imageWidth imageHeight", "camera model"
ROWS = 10  # lines of a photo


def pix4d_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """Raises BadFile."""
    lines = [line.strip() for line in text_in(path, photos).splitlines()]
    start = next((i for i, line in enumerate(lines) if line.startswith(LAST)), -1)
    rows = [line for line in lines[start + 1 :] if line]
    if start < 0 or not rows or len(rows) % ROWS:
        raise BadFile(
            f"{path}: {len(rows)} lines after its head; {ROWS} a photo are wanted; copy it again"
        )
    out = Gathered(path, "Pix4D", photos, Z_UP)
    shift = offset_beside(path)
    for first in range(0, len(rows), ROWS):
        words = rows[first].rsplit(maxsplit=2)
        if len(words) != 3:
            raise BadFile(f"{path}: {rows[first][:40]!r} is no name, width and height")
        name, where = words[0], f"{path}: {words[0]}"
        width, height = TableWords(path, " ".join(words[1:])).numbers(2)
        size = checked_size(width, height, where)
        numbers = TableWords(path, " ".join(rows[first + 1 : first + ROWS]))
        k = np.reshape(numbers.numbers(9), (3, 3))
        radial, tangential = numbers.numbers(3), numbers.numbers(2)
        place, rotation = np.array(numbers.numbers(3)), np.reshape(numbers.numbers(9), (3, 3))
        pinhole = (k[0, 0], k[1, 1], k[0, 2], k[1, 2])
        lens = brown_lens(size, pinhole, radial, tangential, where)
        out.add(name, world_from(rotation, place + shift), lens)
    return out.finished()


def offset_beside(path: Path) -> np.ndarray:
    """(3,) what Pix4D has taken off all places, metres; zeros without the file."""
    name = path.name.partition("_calibrated_camera_parameters")[0]
    table = path.with_name(f"{name}_offset.xyz")
    return (
        np.array(TableWords(table, text_in(table)).numbers(3)) if table.is_file() else np.zeros(3)
    )
