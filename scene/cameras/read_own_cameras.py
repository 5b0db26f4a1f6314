"""Our own list of cameras: JSON [{"matrix", "tangents" or "fov_y", ...}], in our world."""

import math
from dataclasses import replace

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    SIZE,
    CameraList,
    CameraReading,
    eye_view,
    is_number,
    pose_matrix,
    read_name,
    read_rows,
)
from shapeshift.scene.pose import MOST_SIDE, View, perspective

NEAR, FAR = 0.01, 1000.0  # metres, where the file does not say


def read_own_cameras(rows: object, reading: CameraReading, where: str) -> CameraList:
    """`rows` as JSON gives them; never turned, they are in our axes.  Raises BadFile.

    A row is {"matrix": 4x4 world_from_eye, "fov_y" (radians) or "tangents" [left, right, down,
    up], and optionally "size" [w, h], "near" and "far" in metres, "name", "whole": tangents of the
    picture that this is a part of}.
    """
    rows = read_rows(rows, "the file", where)
    views = [read_row(row, reading, f"{where}, camera {i}") for i, row in enumerate(rows)]
    names = tuple(read_name(row.get("name")) for row in rows)
    return CameraList(tuple(views), names, "our own list")


def read_row(row: dict, reading: CameraReading, where: str) -> View:
    if "matrix" not in row:
        raise BadFile(f"{where}: expected an object with 'matrix' and 'fov_y' or 'tangents'.")
    matrix = pose_matrix(row["matrix"], f"{where}: 'matrix'")
    near, far = row.get("near", NEAR), row.get("far", FAR)
    if not (is_number(near) and is_number(far) and 0 < near < far):
        raise BadFile(f"{where}: near {near!r:.40} and far {far!r:.40} must be 0 < near < far.")
    size = reading.size or read_size(row.get("size", SIZE), where)
    view = eye_view(matrix, read_tangents(row, size, where), size, where, near, far)
    return replace(view, whole=four_tangents(row, "whole", where)) if "whole" in row else view


def read_size(value: object, where: str) -> tuple[int, int]:
    good = isinstance(value, list | tuple) and len(value) == 2
    if not (good and all(type(n) is int and 1 <= n <= MOST_SIDE for n in value)):
        raise BadFile(f"{where}: 'size' is {value!r:.40}, expected [width, height] in pixels.")
    return value[0], value[1]


def four_tangents(row: dict, name: str, where: str) -> tuple[float, float, float, float]:
    """left, right, down, up."""
    tangents = row[name]
    good = isinstance(tangents, list) and len(tangents) == 4 and all(map(is_number, tangents))
    if not (good and tangents[0] < tangents[1] and tangents[2] < tangents[3]):
        raise BadFile(f"{where}: '{name}' must be left < right, down < up.")
    left, right, down, up = map(float, tangents)
    return left, right, down, up


def read_tangents(row: dict, size: tuple[int, int], where: str) -> tuple:
    if "tangents" in row:
        return four_tangents(row, "tangents", where)
    fov_y = row.get("fov_y")
    if not (is_number(fov_y) and 0 < fov_y < math.pi):
        raise BadFile(f"{where}: 'fov_y' is {fov_y!r:.40}, expected radians between 0 and pi.")
    return perspective(float(fov_y), size)
