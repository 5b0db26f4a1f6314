"""Captures of Nerfies, HyperNeRF and DyCheck: camera/ID.json, rgb/1x/ID.png and dataset.json."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.scans.posed_frames import MOST_BYTES, PosedFrames, opengl_pose

SIZES = (1, 2, 4, 8, 16)  # rgb/1x holds the whole photos, rgb/2x halves of them ...
MOST_IDS_BYTES = 1 << 26


def find_nerfies(folder: Path) -> Path | None:
    """The folder with the cameras."""
    if (folder / "dataset.json").is_file() and (folder / "camera").is_dir():
        return folder
    return None


def nerfies_frames(folder: Path) -> PosedFrames:
    """orientation: camera from world, OpenCV axes, rows; the lens is of rgb/1x.  Raises BadFile."""
    table = folder / "dataset.json"
    said = Fields(read_json(table, most_bytes=MOST_IDS_BYTES), str(table))
    tests = set(said.texts("val_ids", []))
    times = Fields({}, "")
    if (folder / "metadata.json").is_file():
        path = folder / "metadata.json"
        times = Fields(read_json(path, most_bytes=MOST_IDS_BYTES), str(path))
    place = next((f"rgb/{n}x" for n in SIZES if (folder / f"rgb/{n}x").is_dir()), "rgb")
    frames = []
    for name in said.texts("ids"):
        moment = times.data.get(name)
        frame = frame_of(folder / "camera" / f"{Path(name).name}.json")
        frame |= {"file_path": f"{place}/{name}", "split": "test" if name in tests else "train"}
        frame["time"] = moment.get("warp_id", 0) if isinstance(moment, dict) else 0
        frames.append(frame)
    return PosedFrames(folder, str(table), frames)


def frame_of(path: Path) -> dict:
    if not path.is_file():
        raise BadFile(f"{path} is missing; copy the whole folder")
    camera = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    rows = camera.typed("orientation", list)
    pose = np.eye(4)
    try:
        pose[:3, :3] = np.array(rows, np.float64).T
    except (TypeError, ValueError, OverflowError):
        raise BadFile(f"{path}: 'orientation' must be 3 rows of 3 numbers") from None
    pose[:3, 3] = camera.numbers("position", 3)
    focal, (cx, cy) = camera.number("focal_length"), camera.numbers("principal_point", 2)
    width, height = camera.numbers("image_size", 2)
    k1, k2, k3 = camera.numbers("radial_distortion", 3, (0.0, 0.0, 0.0))
    p1, p2 = camera.numbers("tangential_distortion", 2, (0.0, 0.0))
    return {
        "transform_matrix": opengl_pose(pose), "w": width, "h": height,
        "fl_x": focal, "fl_y": focal * camera.number("pixel_aspect_ratio", 1.0),
        "cx": cx, "cy": cy, "k1": k1, "k2": k2, "k3": k3, "p1": p1, "p2": p2,
    }  # fmt: skip
