"""nerfstudio's camera_path.json: its frames if it has them, else a path through its keyframes."""

import json
import math

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    MOST_VIEWS,
    CameraList,
    CameraReading,
    assumed_fov,
    eye_view,
    is_number,
    numbers,
    ours_from_world,
    pose_matrix,
    read_rows,
)
from shapeshift.scene.cameras.camera_path import along, poses_between
from shapeshift.scene.pose import MOST_SIDE, Pose, View, perspective

MARKS = ("camera_path", "keyframes")
FPS, SECONDS_A_KEY = 24.0, 2.0  # of a path through keyframes that does not say
FLAT = ("equirectangular", "omnidirectional", "vr180")  # camera types without one field of view


def read_camera_path(data: dict, reading: CameraReading, where: str) -> CameraList:
    """Views of the path, in the world of the splats that nerfstudio exports.  Raises BadFile.

    Rows hold "camera_to_world" or "matrix", 16 numbers of an OpenGL camera, and "fov", degrees
    from top to bottom (nerfstudio's viewer/render_panel.py and cameras/camera_paths.py).
    """
    kind = str(data.get("camera_type", "perspective")).lower()
    if any(word in kind for word in FLAT):
        raise BadFile(f"{where} is a path of {kind[:40]} pictures; perspective ones can be drawn.")
    notes = (f"{where}: {kind} cameras are drawn in perspective.",) if "fisheye" in kind else ()
    size = reading.size or render_size(data, where)
    frames = data.get("camera_path") or []
    fps = data.get("fps", FPS)
    fps = float(fps) if is_number(fps) and 0 < fps <= 1000 else FPS
    if frames:
        rows = read_rows(frames, "'camera_path'", where)
        poses, fovs, said = read_keys(rows, "camera_to_world", data, reading, where)
        return listed(poses, fovs, size, where, notes + said, fps)
    rows = read_rows(data.get("keyframes"), "'keyframes'", where)
    poses, fovs, said = read_keys(rows, "matrix", data, reading, where)
    closed = bool(data.get("is_cycle", False)) and len(poses) > 1
    legs = len(poses) - (not closed)
    seconds = data.get("seconds", SECONDS_A_KEY * legs)
    if not (is_number(seconds) and 0 < seconds * fps <= MOST_VIEWS):
        seconds = SECONDS_A_KEY * max(legs, 1)
    count = max(round(seconds * fps), 1)
    t = np.arange(count) * (legs / (count if closed else max(count - 1, 1)))
    between = poses_between(poses, t, closed)
    fovs = np.clip(along(np.array(fovs)[:, None], t, closed)[:, 0], min(fovs), max(fovs))
    notes += (f"{where} holds keyframes alone; the {count} frames between them are ours.",)
    return listed(between, fovs, size, where, notes + said, fps)


def listed(poses, fovs, size, where: str, notes: tuple[str, ...], fps: float) -> CameraList:
    views = tuple(
        view_of(pose, float(fov), size, where) for pose, fov in zip(poses, fovs, strict=True)
    )
    return CameraList(views, ("",) * len(views), "nerfstudio camera path", notes, fps)


def view_of(pose: Pose, fov_y: float, size: tuple[int, int], where: str) -> View:
    return eye_view(pose.matrix(), perspective(fov_y, size), size, where)


def read_keys(
    rows: list[dict], name: str, data: dict, reading: CameraReading, where: str
) -> tuple[list[Pose], list[float], tuple[str, ...]]:
    """Pose in our world and field of view in radians of each row; notes."""
    turn = ours_from_world(reading)
    poses, fovs, notes = [], [], ()
    for i, row in enumerate(rows):
        here = f"{where}, {name} {i}"
        value = row.get(name, row.get("matrix"))
        poses.append(Pose.from_matrix(turn @ read_matrix(value, here)))
        degrees = row.get("fov", data.get("default_fov"))
        if degrees is None:
            fov_y, notes = assumed_fov(reading, where)
        elif is_number(degrees) and 0 < degrees < 180:
            fov_y = math.radians(degrees)
        else:
            raise BadFile(f"{here}: 'fov' is {degrees!r:.40}, expected degrees between 0 and 180.")
        fovs.append(fov_y)
    return poses, fovs, notes


def read_matrix(value: object, where: str) -> np.ndarray:
    """(4, 4) world from eye, of 16 numbers row by row, or of a text of JSON as old files have it.

    Those are column by column (three.js writes them so); which one it is shows in the place of
    the row 0 0 0 1 (https://github.com/nerfstudio-project/nerfstudio/issues/3117).
    """
    text = isinstance(value, str)
    if text:
        try:
            value = json.loads(value)
        except (ValueError, RecursionError):
            raise BadFile(f"{where}: 'matrix' is a text that is not JSON.") from None
    matrix = numbers(value, (4, 4), f"{where}: 'matrix'")
    first = matrix[:3, 3].any() and not matrix[3, :3].any()  # a place in the last column
    last = matrix[3, :3].any() and not matrix[:3, 3].any()  # a place in the last row
    by_columns = last or (text and not first)
    return pose_matrix(matrix.T if by_columns else matrix, where)


def render_size(data: dict, where: str) -> tuple[int, int]:
    width, height = data.get("render_width", 1920), data.get("render_height", 1080)
    if not all(is_number(n) and 1 <= n <= MOST_SIDE for n in (width, height)):
        raise BadFile(
            f"{where}: 'render_width' and 'render_height' are {width!r:.20} and {height!r:.20}; "
            f"1 to {MOST_SIDE} are wanted."
        )
    return int(width), int(height)
