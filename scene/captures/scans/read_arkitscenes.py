"""ARKitScenes: VIDEO_frames/ with lowres_wide.traj, its photos, intrinsics and depth."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import read_text_file
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.scans.posed_frames import (
    PosedFrames,
    opengl_pose,
    photos_in,
    table_of,
)

TRAJECTORY = "lowres_wide.traj"
SAME_MOMENT = 0.005  # seconds between a photo and its pose
SAME_LENS = (0.0, -0.001, 0.001)  # seconds by which the names of intrinsics are off


def find_arkitscenes(folder: Path) -> Path | None:
    """The table of poses."""
    for place in (folder, folder / f"{folder.name}_frames"):
        if (place / TRAJECTORY).is_file() and (place / "lowres_wide").is_dir():
            return place / TRAJECTORY
    return None


def arkitscenes_frames(path: Path) -> PosedFrames:
    """Poses camera from world, rotation as axis times angle, OpenCV axes; depth in millimetres.

    Raises BadFile.
    """
    place, (times, poses) = path.parent, trajectory(path)
    frames = []
    for photo in photos_in(place / "lowres_wide"):
        video, _, moment = photo.stem.rpartition("_")
        try:
            seconds = float(moment)
        except ValueError:
            raise BadFile(f"{photo}: photos are called VIDEO_SECONDS.png") from None
        nearest = int(np.abs(times - seconds).argmin())
        if not abs(times[nearest] - seconds) < SAME_MOMENT:
            continue
        names = [f"{video}_{seconds + aside:.3f}.pincam" for aside in SAME_LENS]
        lenses = [place / "lowres_wide_intrinsics" / name for name in names]
        lens = table_of(next((p for p in lenses if p.is_file()), lenses[0]), (6,))
        frame = {
            "file_path": f"lowres_wide/{photo.name}",
            "transform_matrix": opengl_pose(poses[nearest]),
        } | dict(zip(("w", "h", "fl_x", "fl_y", "cx", "cy"), lens.tolist(), strict=True))
        if (place / "lowres_depth" / photo.name).is_file():
            frame["depth_path"] = f"lowres_depth/{photo.name}"
        frames.append(frame)
    return PosedFrames(place, str(path), frames)


def trajectory(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Seconds (N,) and poses world from camera (N, 4, 4)."""
    from scipy.spatial.transform import Rotation

    try:
        lines = read_text_file(path).split(b"\n")
        rows = np.array([[float(word) for word in line.split()] for line in lines if line.strip()])
    except ValueError:
        rows = np.zeros((0, 0))
    if not (rows.ndim == 2 and rows.shape[1:] == (7,) and np.isfinite(rows).all()):
        raise BadFile(f"{path}: lines of seven numbers are wanted; copy it again")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(rows[:, 1:4]).as_matrix()
    poses[:, :3, 3] = rows[:, 4:]
    return rows[:, 0], np.linalg.inv(poses)
