"""Data sets whose frames have poses: SDFStudio's, sitcoms3D, nuScenes."""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json, shown
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.scans.posed_frames import PosedFrames, opengl_pose
from shapeshift.scene.pose import Pose

MOST_BYTES = 1 << 28


# SDFStudio: meta_data.json with rgb_path, camtoworld and intrinsics a frame.


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


# sitcoms3D: cameras.json with image_name, intrinsics and camtoworld a frame, and images_4/.

TABLE, UP = "cameras.json", (0, 1, 0)
PEOPLE = "Its masks of people (segmentations/) are not used: who moves will be a smear."


def find_sitcoms3d(folder: Path) -> Path | None:
    """The table of poses."""
    path = folder / TABLE
    try:
        data = read_json(path, most_bytes=MOST_BYTES) if path.is_file() else None
    except BadFile:  # whoever reads it as another form says what is wrong
        return None
    frames = data.get("frames") if isinstance(data, dict) else None
    first = frames[0] if isinstance(frames, list) and frames else None
    needed = {"image_name", "camtoworld", "intrinsics"}
    return path if isinstance(first, dict) and needed <= first.keys() else None


def sitcoms3d_frames(path: Path) -> PosedFrames:
    """camtoworld with OpenGL axes; the lens is of the whole photos, whose middle it has.

    Raises BadFile.
    """
    said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    frames = []
    for row in said.rows("frames", 1 << 20, "frame", 0):
        k = matrix_of(row, "intrinsics", ((3, 3), (4, 4), (3, 4)))
        pose = matrix_of(row, "camtoworld", ((4, 4), (3, 4)))
        frame = {
            "file_path": f"images/{row.text('image_name')}",
            "transform_matrix": [*pose[:3].tolist(), [0, 0, 0, 1]], "up": UP,
            "w": round(2 * k[0, 2]), "h": round(2 * k[1, 2]),
            "fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2], "cy": k[1, 2],
        }  # fmt: skip
        frames.append(frame)
    masks = any(path.parent.glob("segmentations*"))
    return PosedFrames(path.parent, str(path), frames, (PEOPLE,) if masks else ())


# nuScenes: one scene out of tables v1.0-*/*.json, the key frames of all six cameras.
#
# FOLDER/scene-0061 names a scene, though nothing lies there: FOLDER is the root of the data set.

VERSIONS = ("v1.0-mini", "v1.0-trainval", "v1.0-test")
NEEDED = ("scene", "sample", "sample_data", "calibrated_sensor", "ego_pose", "sensor")
TABLE_BYTES = 1 << 29  # of a table; the mini set's have 20 MB
NUSCENES_UP = (0, 0, 1)
UNIT = 1e-3  # by which a quaternion's length may differ from 1
MOVING = (
    "It has no masks of what moves (masks/CAM_FRONT/NAME.png): cars and people in its photos will "
    "be smears."
)


def find_nuscenes(folder: Path) -> Path | None:
    """`folder`: the root of the data set, or a scene's name below it, where nothing is."""
    for root in (folder, *(() if folder.exists() else (folder.parent,))):
        if tables_of(root):
            return folder
    return None


def tables_of(root: Path) -> list[Path]:
    """The folders of tables in it."""
    places = [root / version for version in VERSIONS]
    return [p for p in places if all((p / f"{name}.json").is_file() for name in NEEDED)]


def nuscenes_frames(folder: Path) -> PosedFrames:
    """Cameras sit on a vehicle that is posed for each photo; OpenCV axes, straight lenses.

    Raises BadFile.
    """
    root = folder if folder.is_dir() else folder.parent
    asked = "" if folder.is_dir() else folder.name
    tables, scene = chosen_scene(root, asked)
    samples = {
        row.text("token") for row in rows_of(tables, "sample") if row.text("scene_token") == scene
    }
    mine = [
        row
        for row in rows_of(tables, "sample_data")
        if row.data.get("is_key_frame") is True and row.text("sample_token") in samples
    ]
    sensors = {row.text("token"): row for row in rows_of(tables, "sensor")}
    rigs = {row.text("token"): row for row in rows_of(tables, "calibrated_sensor")}
    wanted = {row.text("ego_pose_token") for row in mine}
    poses = {
        token: row for row in rows_of(tables, "ego_pose") if (token := row.text("token")) in wanted
    }
    frames = []
    for row in mine:
        rig = found_in(rigs, row, "calibrated_sensor_token")
        if found_in(sensors, rig, "sensor_token").text("modality") != "camera":
            continue
        frames.append(frame_of(row, rig, found_in(poses, row, "ego_pose_token"), root))
    masked = any("mask_path" in frame for frame in frames)
    return PosedFrames(root, str(tables), frames, () if masked else (MOVING,), alone=False)


def chosen_scene(root: Path, asked: str) -> tuple[Path, str]:
    """The folder of tables and the scene's token: the one asked for, else the only one.

    Raises BadFile.
    """
    scenes: dict[str, tuple[Path, str]] = {}
    for tables in tables_of(root):
        for row in rows_of(tables, "scene"):
            scenes.setdefault(row.text("name"), (tables, row.text("token")))
    if asked in scenes:
        return scenes[asked]
    if not asked and len(scenes) == 1:
        return next(iter(scenes.values()))
    names = sorted(scenes)
    few = ", ".join(map(shown, names[:4])) + (" ..." if len(names) > 4 else "")
    found = f"no scene {shown(asked)} among its {len(names)}" if asked else f"{len(names)} scenes"
    raise BadFile(
        f"{root} is nuScenes with {found} ({few}); name one, as {root / 'scene-0061'} names a scene"
    )


def frame_of(row: Fields, rig: Fields, vehicle: Fields, root: Path) -> dict:
    """A frame in the words of transforms.json."""
    k = matrix_of(rig, "camera_intrinsic", ((3, 3),))
    name = row.text("filename")
    frame = {
        "file_path": name,
        "transform_matrix": opengl_pose(pose_of(vehicle) @ pose_of(rig)),
        "w": row.number("width"), "h": row.number("height"), "up": NUSCENES_UP,
        "fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2], "cy": k[1, 2],
    }  # fmt: skip
    photo = Path(name)
    mask = f"masks/{photo.parent.name}/{photo.stem}.png"
    if os.path.isfile(root / mask):
        frame |= {"mask_path": mask, "mask_means": "valid"}
    return frame


def pose_of(row: Fields) -> np.ndarray:
    """(4, 4) of a row with translation and rotation, w x y z.  Raises BadFile."""
    wxyz, place = np.array(row.numbers("rotation", 4)), np.array(row.numbers("translation", 3))
    length = np.linalg.norm(wxyz)
    if not abs(length - 1) <= UNIT:
        raise BadFile(f"{row.where}: 'rotation' is no quaternion of length 1; copy it again")
    return Pose(place, wxyz / length).matrix()


def rows_of(tables: Path, name: str) -> list[Fields]:
    """The objects of a table.  Raises BadFile."""
    path = tables / f"{name}.json"
    data = read_json(path, most_bytes=TABLE_BYTES)
    if not (isinstance(data, list) and all(isinstance(row, dict) for row in data)):
        raise BadFile(f"{path}: a list of objects is wanted; copy it again")
    where = path_end(path)
    return [Fields(row, f"{where}: row {i}") for i, row in enumerate(data)]


def found_in(rows: Mapping[str, Fields], row: Fields, key: str) -> Fields:
    """The row of another table that a token names.  Raises BadFile."""
    if (found := rows.get(row.text(key))) is None:
        raise BadFile(f"{row.where}: its '{key}' is in no row of that table; copy the whole folder")
    return found
