"""What `change --out` wrote, read again: how the worlds lie, and boxes about the places."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.change.similarity import Similarity
from shapeshift.scene.sections.section import BoxShape

FILE = "places.json"
MOST_BYTES, MOST_PLACES = 1 << 24, 10_000
FARTHEST = 1e6  # metres
ROOM_CELLS = 4.0  # beside a place: its shadow, and the edge that comparing cuts off
TURNED = 1e-3  # that a rotation may be off one


@dataclass(frozen=True)
class KnownChange:
    """Of two visits, without their points."""

    a_from_b: Similarity
    boxes: tuple[BoxShape, ...]  # world of A, about each place; of a moved thing, both


def read_change(folder: Path) -> KnownChange:
    """Of the folder that was written, or of its places.json.  Raises BadFile."""
    path = folder / FILE if folder.is_dir() else folder
    if not path.is_file():
        raise BadFile(f"{folder}: no {FILE} in it; name the folder that `change --out` wrote.")
    fields = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    room = ROOM_CELLS * fields.object("settings").number("cell_m", low=1e-9, high=FARTHEST)
    matrix = _matrix(fields.object("registration"), path)
    boxes = []
    for row in fields.rows("places", MOST_PLACES, "place"):
        size = [row.number(f"size_{axis}", low=0.0, high=FARTHEST) for axis in "xyz"]
        half = three(side / 2 + room for side in size)
        centre = three(row.number(axis, low=-FARTHEST, high=FARTHEST) for axis in "xyz")
        boxes.append(BoxShape(centre, half))
        if row.value("from_x", None) is not None:
            came = (row.number(f"from_{axis}", low=-FARTHEST, high=FARTHEST) for axis in "xyz")
            boxes.append(BoxShape(three(came), half))
    return KnownChange(_similarity(matrix, path), tuple(boxes))


def _matrix(registration: Fields, path: Path) -> np.ndarray:
    rows = registration.value("a_from_b")
    try:
        matrix = np.array(rows, np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise BadFile(f"{path}: a_from_b is no matrix of 4 x 4 numbers; run change again.")
    return matrix


def _similarity(matrix: np.ndarray, path: Path) -> Similarity:
    scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
    if not 1e-6 < scale < 1e6:
        raise BadFile(f"{path}: a_from_b is no turn, shift and scale; run change again.")
    rotation = matrix[:3, :3] / scale
    if not np.abs(rotation @ rotation.T - np.eye(3)).max() < TURNED:
        raise BadFile(f"{path}: a_from_b is no turn, shift and scale; run change again.")
    left, _, right = np.linalg.svd(rotation)  # six decimals of a file, made a turn again
    return Similarity(left @ right, matrix[:3, 3], float(scale))
