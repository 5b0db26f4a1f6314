"""Our own list of cameras: JSON [{"matrix", "tangents" or "fov_y", ...}], in our world."""

import math
from dataclasses import replace

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    SIZE,
    CameraList,
    CameraReading,
    eye_view,
    pose_matrix,
    read_name,
    read_rows,
)
from shapeshift.scene.pose import MOST_SIDE, View, perspective

MOST_M = 1e30  # of near, far and tangents: any that a float holds well
FOV_WANTED = "an angle between 0 and pi radians"
NEAR, FAR = 0.01, 1000.0  # metres, where the file does not say


def read_own_cameras(rows: object, reading: CameraReading, where: str) -> CameraList:
    """`rows` as JSON gives them; never turned, they are in our axes.  Raises BadFile.

    A row is {"matrix": 4x4 world_from_eye, "fov_y" (radians) or "tangents" [left, right, down,
    up], and optionally "size" [w, h], "near" and "far" in metres, "name", "whole": tangents of the
    picture that this is a part of}.
    """
    rows = read_rows(rows, "the file", where)
    views = [read_row(row, reading) for row in rows]
    names = tuple(read_name(row.data.get("name")) for row in rows)
    return CameraList(tuple(views), names, "our own list")


def read_row(row: Fields, reading: CameraReading) -> View:
    if not row.has("matrix"):
        raise BadFile(f"{row.where}: expected an object with 'matrix' and 'fov_y' or 'tangents'.")
    matrix = pose_matrix(row.data["matrix"], f"{row.where}: 'matrix'")
    near = row.number("near", NEAR, "a length above 0, in metres,", high=MOST_M)
    far = row.number("far", FAR, f"a length above near, {near:g} metres,", near, MOST_M)
    if not 0 < near < far:
        raise BadFile(f"{row.where}: near {near:g} and far {far:g} must be 0 < near < far.")
    size = reading.size or read_size(row)
    view = eye_view(matrix, read_tangents(row, size), size, row.where, near, far)
    return replace(view, whole=four_tangents(row, "whole")) if "whole" in row.data else view


def read_size(row: Fields) -> tuple[int, int]:
    value = row.value("size", SIZE)
    good = isinstance(value, list | tuple) and len(value) == 2
    if not (good and all(type(n) is int and 1 <= n <= MOST_SIDE for n in value)):
        raise row.error("size", f"[width, height], 1 to {MOST_SIDE} pixels,")
    return value[0], value[1]


def four_tangents(row: Fields, name: str) -> tuple[float, float, float, float]:
    left, right, down, up = row.numbers(name, 4, most=MOST_M)
    if not (left < right and down < up):
        raise row.error(name, "[left, right, down, up] with left < right, down < up")
    return left, right, down, up


def read_tangents(row: Fields, size: tuple[int, int]) -> tuple[float, float, float, float]:
    if "tangents" in row.data:
        return four_tangents(row, "tangents")
    fov_y = row.number("fov_y", wanted=FOV_WANTED, high=math.pi)
    if not 0 < fov_y < math.pi:
        raise row.error("fov_y", FOV_WANTED)
    return perspective(fov_y, size)


# Our own list of cameras, with all that a view has.


def own_rows(cameras: CameraList) -> list[dict]:
    """What `read_own_cameras` reads: our world, untouched."""
    rows = []
    for view, name in zip(cameras.views, cameras.names, strict=True):
        rows.append(
            ({"name": name} if name else {})
            | {
                "matrix": view.world_from_eye.matrix().tolist(),
                "tangents": [float(t) for t in view.tangents],
                "size": [int(n) for n in view.size],
                "near": float(view.near),
                "far": float(view.far),
            }
            | ({"whole": [float(t) for t in view.whole]} if view.whole else {})
        )
    return rows
