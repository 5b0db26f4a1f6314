"""Scans of a phone's LiDAR as apps export them: 3D Scanner App and Polycam."""

from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.scene.captures.scans.posed_frames import MOST_BYTES, PosedFrames, photos_in

UP = (0, 1, 0)  # ARKit's
# 3D Scanner App's export of all data: frame_00000.jpg beside frame_00000.json, depth_00000.png.

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


# Polycam's raw data of a LiDAR scan: keyframes/ with images, cameras and depth.

# As Polycam has optimised them, and as the phone saw them; the latter where the former lack.
KINDS = (("corrected_images", "corrected_cameras"), ("images", "cameras"))


def find_polycam(folder: Path) -> Path | None:
    """The folder that holds images and cameras."""
    for place in (folder, folder / "keyframes"):
        if any(
            (place / cameras).is_dir() and (place / images).is_dir() for images, cameras in KINDS
        ):
            return place
    return None


def polycam_frames(place: Path) -> PosedFrames:
    """Camera to world t_00 to t_23, OpenGL axes; depth in millimetres.  Raises BadFile."""
    images, cameras = next(k for k in KINDS if all((place / name).is_dir() for name in k))
    frames = []
    for photo in photos_in(place / images):
        path = place / cameras / f"{photo.stem}.json"
        if not path.is_file():
            continue
        said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
        rows = [[said.number(f"t_{row}{column}") for column in range(4)] for row in range(3)]
        frame = {
            "file_path": f"{images}/{photo.name}",
            "transform_matrix": [*rows, [0, 0, 0, 1]],
            "fl_x": said.number("fx"), "fl_y": said.number("fy"),
            "cx": said.number("cx"), "cy": said.number("cy"),
            "w": said.number("width"), "h": said.number("height"), "up": UP,
        }  # fmt: skip
        if (place / "depth" / f"{photo.stem}.png").is_file():
            frame["depth_path"] = f"depth/{photo.stem}.png"
        frames.append(frame)
    return PosedFrames(place, str(place / cameras), frames)
