"""Bare lists of poses: {"c2w": [4x4, ...]} with OpenCV axes and no word about the lens."""

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    SIZE,
    CameraList,
    CameraReading,
    assumed_fov,
    eye_view,
    opencv_from_eye,
    ours_from_world,
    pose_matrix,
)
from shapeshift.scene.pose import perspective

MARK = "c2w"


def read_pose_list(data: dict, reading: CameraReading, where: str) -> CameraList:
    """The views, all through one lens: --fov-y, else ours with a note.  Raises BadFile."""
    poses = data[MARK]
    if not isinstance(poses, list) or not poses:
        raise BadFile(f"{where}: '{MARK}' must be a list of 4x4 poses, one a camera.")
    fov_y, notes = assumed_fov(reading, where)
    size, turn = reading.size or SIZE, ours_from_world(reading)
    tangents = perspective(fov_y, size)
    views = []
    for i, pose in enumerate(poses):
        matrix = opencv_from_eye(turn @ pose_matrix(pose, f"{where}, camera {i}"))
        views.append(eye_view(matrix, tangents, size, f"{where}, camera {i}"))
    return CameraList(tuple(views), ("",) * len(views), "list of poses", notes)
