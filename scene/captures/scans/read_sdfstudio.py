"""SDFStudio's data sets: meta_data.json with rgb_path, camtoworld and intrinsics a frame."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.scans.posed_frames import PosedFrames, opengl_pose

MOST_BYTES = 1 << 28


def find_sdfstudio(folder: Path) -> Path | None:
    return path if (path := folder / "meta_data.json").is_file() else None


def sdfstudio_frames(path: Path) -> PosedFrames:
    """camtoworld with OpenCV axes.  Its depth is a network's guess without a unit, and not read.

    Raises BadFile.
    """
    said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    size = {"w": said.number("width"), "h": said.number("height")}
    frames = []
    for row in said.rows("frames", 1 << 20, "frame", 0):
        pose = matrix_of(row, "camtoworld", ((4, 4), (3, 4)))
        k = matrix_of(row, "intrinsics", ((4, 4), (3, 3), (3, 4)))
        pose = np.vstack([pose[:3], [0, 0, 0, 1]])
        lens = {"fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2], "cy": k[1, 2]}
        frame = {"file_path": row.text("rgb_path"), "transform_matrix": opengl_pose(pose)}
        frames.append(frame | lens | size)
    return PosedFrames(path.parent, str(path), frames)


def matrix_of(row: Fields, key: str, shapes: tuple) -> np.ndarray:
    try:
        values = np.array(row.value(key, None), np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.zeros(0)
    if values.shape not in shapes or not np.isfinite(values).all():
        raise BadFile(f"{row.where}: '{key}' must be a matrix of 4 rows of 4 numbers")
    return values
