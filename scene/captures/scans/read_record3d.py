"""Record3D's export of a recording as photos: metadata.json and rgb/0.jpg, rgb/1.jpg ..."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json, shown
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.scans.posed_frames import PosedFrames, photos_in

MOST_BYTES = 1 << 28  # of JSON: an hour of poses


def find_record3d(folder: Path) -> Path | None:
    """The table of poses."""
    path = folder / "metadata.json"
    return path if path.is_file() and (folder / "rgb").is_dir() else None


def record3d_frames(path: Path) -> PosedFrames:
    """poses: quaternion xyzw and place, camera to world with OpenGL axes; K column by column.

    Raises BadFile.
    """
    from scipy.spatial.transform import Rotation

    said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    poses, photos = said.typed("poses", list), photos_in(path.parent / "rgb")
    if not poses:
        raise BadFile(f"{path}: no list 'poses'; export from Record3D as EXR + JPG")
    k = said.numbers("K", 9)
    usual: tuple[float, ...] = (k[0], k[4], k[6], k[7])
    coefficients = said.typed("perFrameIntrinsicCoeffs", list) or []
    size = {"w": said.number("w"), "h": said.number("h")}
    frames = []
    for photo in photos:
        number = int(photo.stem) if photo.stem.isdecimal() else len(poses)
        if number >= len(poses):
            raise BadFile(f"{path}: has {len(poses)} poses, none for rgb/{photo.name}")
        row = Fields({"pose": poses[number]}, f"{path}: pose {number}").numbers("pose", 7)
        if not np.linalg.norm(row[:4]) > 0.5:
            raise BadFile(f"{path}: pose {number} is {shown(row)}; its quaternion has no direction")
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = Rotation.from_quat(row[:4]).as_matrix(), row[4:]
        lens = usual
        if number < len(coefficients):
            own = Fields({"lens": coefficients[number]}, f"{path}: lens {number}")
            lens = own.numbers("lens", 4)
        named = dict(zip(("fl_x", "fl_y", "cx", "cy"), lens, strict=True))
        frame = {"file_path": f"rgb/{photo.name}", "transform_matrix": matrix.tolist()}
        frames.append({**frame, **named, **size})
    doubts: tuple[str, ...] = ()
    if any((path.parent / "depth").glob("*.exr")):
        doubts = ("Its depth photos are EXR files, which are not read; it is used without.",)
    return PosedFrames(path.parent, str(path), frames, doubts)
