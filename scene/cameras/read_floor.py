"""splatapult's NAME_vr.json, {"floorMat": 4x4}: where the floor is on which a viewer stands."""

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    SIZE,
    CameraList,
    CameraReading,
    eye_view,
    numbers,
    ours_from_world,
    rigid,
)
from shapeshift.scene.cameras.framing import FOV_Y
from shapeshift.scene.pose import perspective

MARK = "floorMat"
EYE_HEIGHT = 1.6  # metres above the floor


def read_floor(data: dict, reading: CameraReading, where: str) -> CameraList:
    """One view: standing at the floor's origin, looking along its -Z.  Raises BadFile.

    The matrix is world from floor, +Y away from the floor, in the world of the splats; scaled
    where the world was scaled, so that a metre for the viewer is `scale` of the world's units.
    """
    matrix = numbers(data[MARK], (4, 4), f"{where}: '{MARK}'")
    with np.errstate(over="ignore", invalid="ignore"):
        scale = float(np.cbrt(np.linalg.det(matrix[:3, :3]))) if np.isfinite(matrix).all() else 0.0
    if not (np.array_equal(matrix[3], (0, 0, 0, 1)) and 1e-6 < scale < 1e6):
        raise BadFile(f"{where}: '{MARK}' is no rotation, scale and position; save it again.")
    matrix[:3, :3] /= scale
    world_from_floor = ours_from_world(reading) @ rigid(rounded(matrix), f"{where}: '{MARK}'")
    world_from_floor[:3, 3] += EYE_HEIGHT * scale * world_from_floor[:3, 1]
    size = reading.size or SIZE
    tangents = perspective(reading.fov_y or FOV_Y, size)
    view = eye_view(world_from_floor, tangents, size, where)
    return CameraList((view,), ("floor",), "splatapult floor")


def rounded(matrix: np.ndarray) -> np.ndarray:
    """Its rotation made exact where six digits are all that was written."""
    u, spread, vt = np.linalg.svd(matrix[:3, :3])
    out = matrix.copy()
    if np.abs(spread - 1).max() < 1e-2:
        out[:3, :3] = u @ vt
    return out
