"""Polycam's raw data of a LiDAR scan: keyframes/ with images, cameras and depth."""

from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.scene.captures.scans.posed_frames import MOST_BYTES, PosedFrames, photos_in

# As Polycam has optimised them, and as the phone saw them; the latter where the former lack.
KINDS = (("corrected_images", "corrected_cameras"), ("images", "cameras"))
UP = (0, 1, 0)  # ARKit's


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
