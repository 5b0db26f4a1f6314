"""Views to draw from: a list of our own in JSON, or the cameras of a capture."""

import json
import math
from pathlib import Path

import numpy as np

from runtime_models.model import BadFile
from scene.pose import Pose, View, perspective

NEAR, FAR = 0.01, 1000.0  # metres, where the file does not say


def read_cameras(path: str | Path, size: tuple[int, int] | None) -> list[View]:
    """The views in a file, in its order; `size` replaces the file's pixels where it is given.

    Our own form is a JSON list of {"matrix": 4x4 world_from_eye, and "fov_y" (radians) or
    "tangents" (left, right, down, up), optional "near", "far"}.  Anything that is a capture
    (transforms.json, cameras.json, a COLMAP folder) gives the views of its photos.
    """
    path = Path(path)
    if not path.exists():
        raise BadFile(f"{path} does not exist; --camera wants a file of cameras, or orbit.")
    if path.is_file() and path.suffix.lower() == ".json":
        try:
            rows = json.loads(path.read_bytes())
        except ValueError:
            raise BadFile(f"{path} is not JSON; --camera wants a file of cameras.") from None
        if isinstance(rows, list):
            if not rows:
                raise BadFile(f"{path} holds no camera.")
            return [read_row(row, size or (640, 360), f"{path.name}, camera {i}")
                    for i, row in enumerate(rows)]  # fmt: skip
    from scene.read_capture import read_capture

    views = [photo.view for photo in read_capture(path).photos]
    return [view.resized(size) if size else view for view in views]


def read_row(row: object, size: tuple[int, int], where: str) -> View:
    if not isinstance(row, dict) or "matrix" not in row:
        raise BadFile(f"{where}: expected an object with 'matrix' and 'fov_y' or 'tangents'.")
    try:
        matrix = np.array(row["matrix"], np.float64).reshape(4, 4)
    except (TypeError, ValueError):
        raise BadFile(f"{where}: 'matrix' is not 4 x 4 numbers.") from None
    turn = matrix[:3, :3]
    if not np.isfinite(matrix).all() or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4):
        raise BadFile(f"{where}: 'matrix' has NaN or is no rotation and position.")
    if not np.linalg.det(turn) > 0:
        raise BadFile(f"{where}: 'matrix' mirrors; expected a right-handed rotation.")
    near, far = row.get("near", NEAR), row.get("far", FAR)
    if not (is_number(near) and is_number(far) and 0 < near < far):
        raise BadFile(f"{where}: near {near!r} and far {far!r} must be 0 < near < far.")
    return View(Pose.from_matrix(matrix), read_tangents(row, size, where), near, far, size)


def read_tangents(row: dict, size: tuple[int, int], where: str) -> tuple:
    if "tangents" in row:
        tangents = row["tangents"]
        good = isinstance(tangents, list) and len(tangents) == 4 and all(map(is_number, tangents))
        if not (good and tangents[0] < tangents[1] and tangents[2] < tangents[3]):
            raise BadFile(f"{where}: 'tangents' must be left < right, down < up.")
        return tuple(map(float, tangents))
    fov_y = row.get("fov_y")
    if not (is_number(fov_y) and 0 < fov_y < math.pi):
        raise BadFile(f"{where}: 'fov_y' is {fov_y!r}, expected radians between 0 and pi.")
    return perspective(float(fov_y), size)


def is_number(value: object) -> bool:
    good = isinstance(value, int | float) and not isinstance(value, bool)
    return good and math.isfinite(value)
