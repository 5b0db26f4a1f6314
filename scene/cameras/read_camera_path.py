"""nerfstudio's camera_path.json: its frames if it has them, else a path through its keyframes."""

import math

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number, parse_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    MOST_VIEWS,
    CameraList,
    CameraReading,
    assumed_fov,
    eye_view,
    numbers,
    ours_from_world,
    pose_matrix,
    read_rows,
)
from shapeshift.scene.cameras.camera_path import along, poses_between
from shapeshift.scene.pose import MOST_SIDE, Pose, View, perspective

MARKS = ("camera_path", "keyframes")
DEGREES = "an angle between 0 and 180 degrees"
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
    notes: tuple[str, ...] = ()
    if "fisheye" in kind:
        notes = (f"{where}: {kind} cameras are drawn in perspective.",)
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
    rows: list[Fields], name: str, data: dict, reading: CameraReading, where: str
) -> tuple[list[Pose], list[float], tuple[str, ...]]:
    """Pose in our world and field of view in radians of each row; notes."""
    turn = ours_from_world(reading)
    poses: list[Pose] = []
    fovs: list[float] = []
    notes: tuple[str, ...] = ()
    default = {"fov": data["default_fov"]} if "default_fov" in data else {}
    for row in rows:
        value = row.data.get(name, row.data.get("matrix"))
        poses.append(Pose.from_matrix(turn @ read_matrix(value, row.where)))
        row = Fields({**default, **row.data}, row.where)
        if not row.has("fov"):
            fov_y, notes = assumed_fov(reading, where)
        elif 0 < (degrees := row.number("fov", wanted=DEGREES, low=0, high=180)) < 180:
            fov_y = math.radians(degrees)
        else:
            raise row.error("fov", DEGREES)
        fovs.append(fov_y)
    return poses, fovs, notes


def read_matrix(value: object, where: str) -> np.ndarray:
    """(4, 4) world from eye, of 16 numbers row by row, or of a text of JSON as old files have it.

    Those are column by column (three.js writes them so); which one it is shows in the place of
    the row 0 0 0 1 (https://github.com/nerfstudio-project/nerfstudio/issues/3117).
    """
    text = isinstance(value, str)
    if isinstance(value, str):
        value = parse_json(value, f"{where}: the text of 'matrix'")
    matrix = numbers(value, (4, 4), f"{where}: 'matrix'")
    first = matrix[:3, 3].any() and not matrix[3, :3].any()  # a place in the last column
    last = matrix[3, :3].any() and not matrix[:3, 3].any()  # a place in the last row
    by_columns = last or (text and not first)
    return pose_matrix(matrix.T if by_columns else matrix, where)


def render_size(data: dict, where: str) -> tuple[int, int]:
    fields, wanted = Fields(data, where), f"1 to {MOST_SIDE} pixels"
    width = fields.number("render_width", 1920.0, wanted, 1, MOST_SIDE)
    return int(width), int(fields.number("render_height", 1080.0, wanted, 1, MOST_SIDE))
