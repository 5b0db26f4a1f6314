"""Data sets with a text file of 16 numbers for each pose: ScanNet, and those of NeRF++'s form."""

from pathlib import Path

import numpy as np

from shapeshift.scene.captures.scans.posed_frames import (
    PosedFrames,
    opengl_pose,
    photos_in,
    table_of,
)

SPLITS = {"train": "train", "test": "test", "validation": "test"}


def find_scannet(folder: Path) -> Path | None:
    """The folder with color/, pose/ and intrinsic/, as ScanNet's SensReader writes them."""
    needed = ("color", "pose", "intrinsic")
    return folder if all((folder / name).is_dir() for name in needed) else None


def scannet_frames(folder: Path) -> PosedFrames:
    """Camera to world with OpenCV axes, one pinhole, depth in millimetres.  Raises BadFile."""
    k = table_of(folder / "intrinsic" / "intrinsic_color.txt", (4, 4), (3, 3))
    lens = {"fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2], "cy": k[1, 2]}
    frames = []
    for photo in photos_in(folder / "color"):
        pose = table_of(folder / "pose" / f"{photo.stem}.txt", (4, 4))
        if not np.isfinite(pose).all():
            continue
        frame = {"file_path": f"color/{photo.name}", "transform_matrix": opengl_pose(pose)} | lens
        if (folder / "depth" / f"{photo.stem}.png").is_file():
            frame["depth_path"] = f"depth/{photo.stem}.png"
        if (folder / f"{folder.name}.ply").is_file():
            frame["ply_file_path"] = f"{folder.name}.ply"
        frames.append(frame)
    return PosedFrames(folder, str(folder / "pose"), frames)


def find_posed_splits(folder: Path) -> Path | None:
    """The folder with train/rgb, train/pose and train/intrinsics, as NeRF++ and NeRF-OSR have."""
    needed = ("rgb", "pose", "intrinsics")
    return folder if all((folder / "train" / name).is_dir() for name in needed) else None


def posed_split_frames(folder: Path) -> PosedFrames:
    """Camera to world with OpenCV axes, a pinhole a photo.  Raises BadFile."""
    frames = []
    for name, split in SPLITS.items():
        if not (folder / name / "rgb").is_dir():
            continue
        for photo in photos_in(folder / name / "rgb"):
            pose = table_of(folder / name / "pose" / f"{photo.stem}.txt", (4, 4))
            k = table_of(folder / name / "intrinsics" / f"{photo.stem}.txt", (4, 4), (3, 3))
            lens = {"fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2], "cy": k[1, 2]}
            frame = {"file_path": f"{name}/rgb/{photo.name}", "split": split}
            frames.append(frame | lens | {"transform_matrix": opengl_pose(pose)})
    return PosedFrames(folder, str(folder / "train" / "pose"), frames)
