"""cameras.json as 3DGS writes it beside its splats: positions, rotations, focal lengths."""

import math

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    SIZE,
    CameraList,
    CameraReading,
    assumed_fov,
    is_number,
    numbers,
    ours_from_world,
    pinhole_view,
    pose_matrix,
    read_name,
    read_rows,
)
from shapeshift.scene.pose import View

MARKS = {"position", "rotation"}  # keys of a row that tell this form
LENS = {"width", "height", "fx", "fy"}


def read_inria_cameras(rows: object, reading: CameraReading, where: str) -> CameraList:
    """`rows` as JSON gives them, turned as 3DGS's splats are.  Raises BadFile.

    A row is {"id", "img_name", "width", "height", "position" (3,), "rotation" 3x3 camera to world
    with OpenCV axes, "fx", "fy"}; "cx" and "cy" are ours, the middle where they are absent.  Where
    no row has any of the lens, all get the field of view of `reading`, or ours with a note.
    """
    rows = read_rows(rows, "the file", where)
    turn, notes = ours_from_world(reading), ()
    if not any(LENS & row.keys() for row in rows):
        fov_y, notes = assumed_fov(reading, where)
        width, height = reading.size or SIZE
        focal = height / 2 / math.tan(fov_y / 2)
        lens = {"width": width, "height": height, "fx": focal, "fy": focal}
        rows = [row | lens for row in rows]
    views = [read_row(r, turn, reading, f"{where}, camera {i}") for i, r in enumerate(rows)]
    names = tuple(read_name(row.get("img_name")) for row in rows)
    return CameraList(tuple(views), names, "3DGS cameras.json", notes)


def read_row(row: dict, turn: np.ndarray, reading: CameraReading, where: str) -> View:
    if not MARKS <= row.keys():
        raise BadFile(f"{where}: expected 'position' and 'rotation' as in the first camera.")
    matrix = np.eye(4)
    matrix[:3, :3] = numbers(row["rotation"], (3, 3), f"{where}: 'rotation'")
    matrix[:3, 3] = numbers(row["position"], (3,), f"{where}: 'position'")
    matrix = pose_matrix(matrix, f"{where}: 'rotation'")
    width, height, fx, fy = values = [row.get(name) for name in ("width", "height", "fx", "fy")]
    if not all(is_number(value) and value > 0 for value in values):
        raise BadFile(f"{where}: 'width', 'height', 'fx' and 'fy' must be numbers above 0.")
    centre = (row.get("cx", width / 2), row.get("cy", height / 2))
    view = pinhole_view(turn @ matrix, (fx, fy), centre, (width, height), where)
    return view.resized(reading.size) if reading.size else view
