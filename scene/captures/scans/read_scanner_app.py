"""3D Scanner App's export of all data: frame_00000.jpg beside frame_00000.json, depth_00000.png."""

from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.scene.captures.scans.posed_frames import MOST_BYTES, PosedFrames

UP = (0, 1, 0)  # ARKit's
POSE = b'"cameraPoseARFrame"'


def find_scanner_app(folder: Path) -> Path | None:
    first = min(folder.glob("frame_*.json"), default=None)
    if first is None or first.stat().st_size > MOST_BYTES:
        return None
    return folder if POSE in first.read_bytes() else None


def scanner_app_frames(folder: Path) -> PosedFrames:
    """cameraPoseARFrame: camera to world row by row, OpenGL axes; intrinsics rows of 3; depth in
    millimetres.  Every few frames have a photo.  Raises BadFile.
    """
    frames = []
    for path in sorted(folder.glob("frame_*.json")):
        photo = path.with_suffix(".jpg")
        if not photo.is_file():
            continue
        said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
        if not said.has("cameraPoseARFrame"):
            continue
        pose, k = said.numbers("cameraPoseARFrame", 16), said.numbers("intrinsics", 9)
        frame = {
            "file_path": photo.name,
            "transform_matrix": [list(pose[row : row + 4]) for row in range(0, 16, 4)],
            "fl_x": k[0], "fl_y": k[4], "cx": k[2], "cy": k[5], "up": UP,
        }  # fmt: skip
        depth = folder / f"depth_{path.stem.removeprefix('frame_')}.png"
        if depth.is_file():
            frame["depth_path"] = depth.name
        frames.append(frame)
    return PosedFrames(folder, str(folder / "frame_*.json"), frames)
