"""A smooth path through keyframes: places on a spline, rotations on great arcs between them.  And
nerfstudio's file of it.
"""

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
from shapeshift.scene.pose import MOST_SIDE, Pose, View, perspective


def along(keys: np.ndarray, t: np.ndarray, closed: bool) -> np.ndarray:
    """(T, D) values at times t (T,) of the spline through keys (K, D), which key i passes at t = i.

    Catmull-Rom: at a key the speed is half the way from the key before it to the one after it.
    A closed path goes on from its last key to its first; an open one ends with half a lean.
    """
    keys = np.asarray(keys, np.float64)
    count = len(keys)
    if count == 1:
        return np.repeat(keys, len(t), axis=0)
    leg = np.minimum(np.floor(t).astype(int), count - 1 if closed else count - 2)  # (T,)
    part = (t - leg)[:, None]  # 0..1
    if closed:
        around = [keys[(leg + step) % count] for step in (-1, 0, 1, 2)]
    else:
        ends = np.concatenate([2 * keys[:1] - keys[1:2], keys, 2 * keys[-1:] - keys[-2:-1]])
        around = [ends[leg + step] for step in (0, 1, 2, 3)]
    before, start, end, after = around
    leave, arrive = (end - before) / 2, (after - start) / 2
    p2, p3 = part**2, part**3
    return (
        (2 * p3 - 3 * p2 + 1) * start + (p3 - 2 * p2 + part) * leave
        + (3 * p2 - 2 * p3) * end + (p3 - p2) * arrive
    )  # fmt: skip


def turning(wxyz: np.ndarray, t: np.ndarray, closed: bool) -> np.ndarray:
    """(T, 4) unit quaternions at times t (T,), on the great arc from key to key of (K, 4)."""
    count = len(wxyz)
    if count == 1:
        return np.repeat(wxyz, len(t), axis=0)
    leg = np.minimum(np.floor(t).astype(int), count - 1 if closed else count - 2)
    part = t - leg
    return slerp(wxyz[leg], wxyz[(leg + 1) % count], part)


def slerp(one: np.ndarray, other: np.ndarray, part: np.ndarray) -> np.ndarray:
    """(T, 4) unit quaternions `part` (T,) of the shorter way between unit quaternions (T, 4)."""
    cosine = (one * other).sum(axis=1)
    other = np.where(cosine[:, None] < 0, -other, other)
    angle = np.arccos(np.clip(np.abs(cosine), 0, 1))  # radians, 0..pi/2
    near = angle < 1e-6  # there the arc is its chord
    sine = np.where(near, 1.0, np.sin(angle))
    weight_one = np.where(near, 1 - part, np.sin((1 - part) * angle) / sine)
    weight_other = np.where(near, part, np.sin(part * angle) / sine)
    mixed = weight_one[:, None] * one + weight_other[:, None] * other
    return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def poses_between(poses: list[Pose], t: np.ndarray, closed: bool = False) -> list[Pose]:
    """The poses at times t (T,), where pose i is reached at t = i."""
    places = along(np.array([p.position for p in poses]), t, closed)
    turns = turning(np.array([p.wxyz for p in poses]), t, closed)
    return [Pose(place, turn) for place, turn in zip(places, turns, strict=True)]


# nerfstudio's camera_path.json: its frames if it has them, else a path through its keyframes.

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
