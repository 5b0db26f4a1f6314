"""A scan or a data set in a form of its own -> Capture: which reader a folder is for."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json, shown
from shapeshift.runtime_models.files.memory import read_text_file
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.upright import UNIT_M, turn_of_world
from shapeshift.scene.capture_files import find_file, photo_key
from shapeshift.scene.capture_found import FileTable
from shapeshift.scene.captures.capture import LEFT_HANDED, Capture, FoundFiles
from shapeshift.scene.captures.read_transforms import capture_of
from shapeshift.scene.captures.scans.posed_frames import (
    PosedFrames,
    opengl_pose,
    photos_in,
    table_of,
)
from shapeshift.scene.captures.scans.read_data_sets import (
    find_nuscenes,
    find_sdfstudio,
    find_sitcoms3d,
    nuscenes_frames,
    sdfstudio_frames,
    sitcoms3d_frames,
)
from shapeshift.scene.captures.scans.read_nerfies import find_nerfies, nerfies_frames
from shapeshift.scene.captures.scans.read_phone_scans import (
    find_polycam,
    find_scanner_app,
    polycam_frames,
    scanner_app_frames,
)

# ARKitScenes: VIDEO_frames/ with lowres_wide.traj, its photos, intrinsics and depth.

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


# Data sets with a text file of 16 numbers for each pose: ScanNet, and those of NeRF++'s form.

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


# Record3D's export of a recording as photos: metadata.json and rgb/0.jpg, rgb/1.jpg ...

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


# ScanNet++: dslr/nerfstudio/transforms.json, whose photos lie in dslr/resized_images.

TABLE = "nerfstudio/transforms.json"
# Where frames differ from what all have in common; the rest of a file's words are its own business.
COMMON = ("fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2", "camera_model")
MASKED = "Its masks, of what was made unrecognisable, are not used."


def find_scannetpp(folder: Path) -> Path | None:
    """The table of poses."""
    for place in (folder, folder / "dslr"):
        if (place / TABLE).is_file() and (place / "resized_images").is_dir():
            return place / TABLE
    return None


def scannetpp_frames(path: Path) -> PosedFrames:
    """Frames to train on, and test_frames.  Raises BadFile."""
    data = read_json(path, most_bytes=MOST_BYTES)
    if not isinstance(data, dict):
        raise BadFile(f"{path}: no object with 'frames'")
    common = {key: data[key] for key in COMMON if key in data}
    frames, masked = [], False
    for key, split in (("frames", "train"), ("test_frames", "test")):
        for frame in data.get(key) or ():
            if not (isinstance(frame, dict) and isinstance(frame.get("file_path"), str)):
                raise BadFile(f"{path}: one of its '{key}' names no photo")
            masked |= "mask_path" in frame
            own = {name: value for name, value in frame.items() if name != "mask_path"}
            own["file_path"] = f"resized_images/{frame['file_path']}"
            frames.append(common | own | {"split": split})
    return PosedFrames(path.parents[1], str(path), frames, (MASKED,) if masked else ())


READERS = (
    (find_polycam, polycam_frames),
    (find_nerfies, nerfies_frames),  # has a metadata.json, too
    (find_record3d, record3d_frames),
    (find_scannet, scannet_frames),
    (find_arkitscenes, arkitscenes_frames),
    (find_scannetpp, scannetpp_frames),
    (find_sdfstudio, sdfstudio_frames),
    (find_posed_splits, posed_split_frames),
    (find_nuscenes, nuscenes_frames),
    (find_sitcoms3d, sitcoms3d_frames),
    (find_scanner_app, scanner_app_frames),
)


def read_scan(folder: Path) -> Capture | None:
    """The capture, or None where the folder has none of these forms.  Raises BadFile."""
    for find, frames_of in READERS:
        if (found := find(folder)) is not None:
            return capture_from(frames_of(found))
    return None


def is_scan(folder: Path) -> bool:
    return any(find(folder) is not None for find, _ in READERS)


def capture_from(posed: PosedFrames) -> Capture:
    if not posed.frames:
        raise BadFile(f"{posed.where}: no photo has a pose here; copy the whole folder")
    first = posed.frames[0]
    said = {key: first[key] for key in ("up", "ply_file_path") if key in first}
    table = FileTable(posed.folder)
    for why, names in posed.left.items():
        paths = [find_file(posed.folder, name).path for name in names]
        table.left_out("photos", paths, f"they {why}", said=True)
        table.accounted |= {photo_key(str(path)) for path in paths}
    capture = capture_of(posed.folder, posed.where, said, posed.frames, table, posed.alone)
    if posed.points is not None and capture.points is None:
        capture = with_points(capture, posed)
    return replace(capture, doubts=capture.doubts + posed.doubts)


def with_points(capture: Capture, posed: PosedFrames) -> Capture:
    """The capture with points of the file's world, turned as its cameras were."""
    points, colors = np.asarray(posed.points), posed.colors
    good = np.isfinite(points).all(axis=1)
    if not good.any():
        return capture
    up, mirrored = capture.notes["up_in_file"], capture.notes.get(LEFT_HANDED, False)
    turn = turn_of_world(up, mirrored, posed.where)[:3, :3]
    ours = (
        points[good] @ turn.T * capture.notes.get(UNIT_M, 1.0) - np.array(capture.origin)
    ).astype(np.float32)
    if colors is not None:
        colors = np.clip(colors[good], 0, 1).astype(np.float32)
    files = (*capture.files, FoundFiles("points", len(ours), len(ours), 0))
    return replace(capture, points=ours, point_colors=colors, files=files)
