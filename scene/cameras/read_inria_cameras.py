"""cameras.json as 3DGS writes it beside its splats: positions, rotations, focal lengths."""

import math

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    SIZE,
    CameraList,
    CameraReading,
    assumed_fov,
    numbers,
    ours_from_world,
    pinhole_view,
    pose_matrix,
    read_name,
    read_rows,
)
from shapeshift.scene.pose import View

MARKS = {"position", "rotation"}  # keys of a row that tell this form
LEAST, MOST = 1e-30, 1e30  # pixels that a float holds well
LENS = {"width", "height", "fx", "fy"}


def read_inria_cameras(rows: object, reading: CameraReading, where: str) -> CameraList:
    """`rows` as JSON gives them, turned as 3DGS's splats are.  Raises BadFile.

    A row is {"id", "img_name", "width", "height", "position" (3,), "rotation" 3x3 camera to world
    with OpenCV axes, "fx", "fy"}; "cx" and "cy" are ours, the middle where they are absent.  Where
    no row has any of the lens, all get the field of view of `reading`, or ours with a note.
    """
    rows = read_rows(rows, "the file", where)
    turn = ours_from_world(reading)
    notes: tuple[str, ...] = ()
    if not any(LENS & row.data.keys() for row in rows):
        fov_y, notes = assumed_fov(reading, where)
        width, height = reading.size or SIZE
        focal = height / 2 / math.tan(fov_y / 2)
        lens = {"width": width, "height": height, "fx": focal, "fy": focal}
        rows = [Fields({**row.data, **lens}, row.where) for row in rows]
    views = [read_row(row, turn, reading) for row in rows]
    names = tuple(read_name(row.data.get("img_name")) for row in rows)
    return CameraList(tuple(views), names, "3DGS cameras.json", notes)


def read_row(row: Fields, turn: np.ndarray, reading: CameraReading) -> View:
    if not row.data.keys() >= MARKS:
        raise BadFile(f"{row.where}: expected 'position' and 'rotation' as in the first camera.")
    matrix = np.eye(4)
    matrix[:3, :3] = numbers(row.data["rotation"], (3, 3), f"{row.where}: 'rotation'")
    matrix[:3, 3] = numbers(row.data["position"], (3,), f"{row.where}: 'position'")
    matrix = pose_matrix(matrix, f"{row.where}: 'rotation'")
    width, height, fx, fy = (
        row.number(key, wanted="a number of pixels above 0", low=LEAST, high=MOST)
        for key in ("width", "height", "fx", "fy")
    )
    centre = (
        row.number("cx", width / 2, "a number of pixels", -MOST, MOST),
        row.number("cy", height / 2, "a number of pixels", -MOST, MOST),
    )
    view = pinhole_view(turn @ matrix, (fx, fy), centre, (width, height), row.where)
    return view.resized(reading.size) if reading.size else view
