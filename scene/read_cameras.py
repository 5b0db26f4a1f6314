"""Views to draw from: a list of our own in JSON, 3DGS's cameras.json, or a capture's cameras."""

import json
import math
from pathlib import Path

import numpy as np

from runtime_models.model import BadFile
from scene.pose import Pose, View, perspective

NEAR, FAR = 0.01, 1000.0  # metres, where the file does not say
ORTHONORMAL = 1e-4  # by which R R^T may differ from 1: files round to 5 digits or more
OURS_FROM_3DGS = np.diag([1.0, -1.0, -1.0, 1.0])  # the turn that readers of its splats make


def read_cameras(path: str | Path, size: tuple[int, int] | None = None) -> list[View]:
    """The views in a file, in its order; `size` replaces the file's pixels where it is given.

    Our own form is a JSON list of {"matrix": 4x4 world_from_eye, and "fov_y" (radians) or
    "tangents" [left, right, down, up], optional "near" and "far" in metres}; it holds no size,
    so 640x360 where none is given.  3DGS writes a list with "position" and "rotation" beside its
    splats.  Anything that is a capture (transforms.json, cameras.json, a COLMAP folder) gives the
    views of its photos, each once where modalities share it.  Raises BadFile in one sentence.
    """
    path = Path(path)
    if not path.exists():
        raise BadFile(f"{path} does not exist; --camera wants a file of cameras, or orbit.")
    if path.is_file():
        rows = read_json(path)
        if isinstance(rows, list):
            if not rows:
                raise BadFile(f"{path} holds no camera.")
            return [read_row(row, size, f"{path.name}, camera {i}") for i, row in enumerate(rows)]
    from scene.read_capture import read_capture

    views = [photo.view for photo in read_capture(path).photos]
    return without_twins([view.resized(size) if size else view for view in views])


def read_json(path: Path) -> object:
    try:
        return json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        raise BadFile(f"{path} is not JSON; --camera wants a file of cameras.") from None


def without_twins(views: list[View]) -> list[View]:
    """The views in their order, equal ones once."""
    kept = {}
    for view in views:
        pose = view.world_from_eye
        key = (tuple(pose.position), tuple(pose.wxyz), view.tangents, view.size)
        kept.setdefault(key, view)
    return list(kept.values())


def read_row(row: object, size: tuple[int, int] | None, where: str) -> View:
    if isinstance(row, dict) and {"position", "rotation"} <= row.keys():
        return read_3dgs_row(row, size, where)
    if not isinstance(row, dict) or "matrix" not in row:
        raise BadFile(f"{where}: expected an object with 'matrix' and 'fov_y' or 'tangents'.")
    matrix = numbers(row["matrix"], (4, 4), f"{where}: 'matrix'")
    check_rigid(matrix, f"{where}: 'matrix'")
    near, far = row.get("near", NEAR), row.get("far", FAR)
    if not (is_number(near) and is_number(far) and 0 < near < far):
        raise BadFile(f"{where}: near {near!r} and far {far!r} must be 0 < near < far.")
    size = size or (640, 360)
    return View(Pose.from_matrix(matrix), read_tangents(row, size, where), near, far, size)


def read_3dgs_row(row: dict, size: tuple[int, int] | None, where: str) -> View:
    """A row as 3DGS writes it: camera to world in OpenCV axes, focal lengths in pixels."""
    matrix = np.eye(4)
    matrix[:3, :3] = numbers(row["rotation"], (3, 3), f"{where}: 'rotation'")
    matrix[:3, 3] = numbers(row["position"], (3,), f"{where}: 'position'")
    check_rigid(matrix, f"{where}: 'rotation'")
    width, height, fx, fy = values = [row.get(name) for name in ("width", "height", "fx", "fy")]
    if not all(is_number(value) and value > 0 for value in values):
        raise BadFile(f"{where}: 'width', 'height', 'fx' and 'fy' must be numbers above 0.")
    centre, pixels = (width / 2, height / 2), (int(width), int(height))
    view = View.from_pinhole(OURS_FROM_3DGS @ matrix, (fx, fy), centre, pixels)
    return view.resized(size) if size else view


def numbers(value: object, shape: tuple[int, ...], what: str) -> np.ndarray:
    """A float64 array of that shape; a flat list of as many numbers will do."""
    try:
        return np.array(value, np.float64).reshape(shape)
    except (TypeError, ValueError, OverflowError):
        raise BadFile(f"{what} is not {' x '.join(map(str, shape))} numbers.") from None


def check_rigid(matrix: np.ndarray, what: str) -> None:
    """Raises BadFile unless (4, 4) is a right-handed rotation and a finite position."""
    turn, last = matrix[:3, :3], matrix[3]
    right = np.isfinite(matrix).all() and np.array_equal(last, (0, 0, 0, 1))
    if not right or not np.allclose(turn @ turn.T, np.eye(3), atol=ORTHONORMAL):
        raise BadFile(f"{what} has NaN or is no rotation and position, [R t; 0 0 0 1].")
    if not np.linalg.det(turn) > 0:
        raise BadFile(f"{what} mirrors; expected a right-handed rotation.")


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
    """A finite number; true and false are none, and neither are integers beyond every float."""
    good = isinstance(value, int | float) and not isinstance(value, bool)
    return good and abs(value) <= 1e300 and math.isfinite(value)
