"""Views to draw from: whichever form a file or folder of cameras has, found from its content."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    MOST_BYTES,
    SIZE,
    CameraList,
    CameraReading,
    assumed_fov,
    eye_view,
    numbers,
    opencv_from_eye,
    ours_from_world,
    pinhole_view,
    pose_matrix,
    read_name,
    read_rows,
)
from shapeshift.scene.cameras.colmap_cameras import read_colmap_cameras
from shapeshift.scene.cameras.own_cameras import read_own_cameras
from shapeshift.scene.cameras.read_camera_path import MARKS as PATH_MARKS
from shapeshift.scene.cameras.read_camera_path import read_camera_path
from shapeshift.scene.cameras.read_floor import MARK as FLOOR_MARK
from shapeshift.scene.cameras.read_floor import read_floor
from shapeshift.scene.cameras.read_transforms_cameras import MARK as TRANSFORMS_MARK
from shapeshift.scene.cameras.read_transforms_cameras import cameras_of, read_transforms_cameras
from shapeshift.scene.captures.colmap.colmap_files import said_of_models
from shapeshift.scene.captures.colmap_tables import TABLES as COLMAP_TABLES
from shapeshift.scene.captures.colmap_tables import find_model
from shapeshift.scene.captures.foreign.read_foreign import (
    is_table_of_lenses,
    read_foreign,
    refuse_known,
)
from shapeshift.scene.captures.lenses.panorama import is_panorama
from shapeshift.scene.pose import View, perspective

KNOWN = (
    "a list of cameras (JSON of our own, 3DGS's cameras.json, transforms.json, nerfstudio's "
    "camera_path.json, splatapult's _vr.json), a COLMAP model, or a file of another program "
    "(docs/capture.md)"
)
IN_FOLDERS = ("transforms.json", "transforms_multimodal.json", "cameras.json")
SPLITS = ("train", "val", "test")
BESIDE = 3  # folders that are searched: 3DGS puts its splats two below its cameras.json
PEEK_BYTES = 4096  # of a file that is no text one is zero


def read_cameras(path: str | Path, size: tuple[int, int] | None = None) -> list[View]:
    """The views in a file or folder, in its order; `size` replaces its pixels.  Raises BadFile."""
    return list(read_camera_list(path, CameraReading(size)).views)


def read_camera_list(path: str | Path, reading: CameraReading | None = None) -> CameraList:
    """The same with names, notes and the form's name; docs/cameras.md says what each form is."""
    path, reading = Path(path), reading or CameraReading()
    if not path.exists():
        raise BadFile(f"{path} does not exist; wanted is {KNOWN}.")
    if path.is_dir():
        return read_folder(path, reading)
    if (found := read_foreign_cameras(path, reading)) is not None:
        return found
    if path.stem in COLMAP_TABLES and path.suffix in (".bin", ".txt"):
        return read_colmap_cameras(path.parent, path.suffix, reading)
    if path.is_file():  # a pipe would wait; read_json refuses it
        with path.open("rb") as file:
            if b"\0" in file.read(PEEK_BYTES):  # a scene, a picture: no broken text
                raise BadFile(f"{path} holds no cameras; wanted is {KNOWN}.")
    data = read_json(path, most_bytes=MOST_BYTES)
    if isinstance(data, list):
        first = data[0] if data and isinstance(data[0], dict) else {}
        read = read_inria_cameras if MARKS <= first.keys() else read_own_cameras
        return read(data, reading, path.name)
    keys = data.keys() if isinstance(data, dict) else ()
    if FLOOR_MARK in keys:
        return read_floor(data, reading, path.name)
    if any(mark in keys for mark in PATH_MARKS):
        return read_camera_path(data, reading, path.name)
    if TRANSFORMS_MARK in keys:
        return read_transforms_cameras([path], reading)
    if MARK in keys:
        return read_pose_list(data, reading, path.name)
    raise BadFile(f"{path} holds no cameras; wanted is {KNOWN}.")


def read_folder(folder: Path, reading: CameraReading) -> CameraList:
    for name in IN_FOLDERS:
        if (folder / name).is_file() and not is_table_of_lenses(folder / name):
            return read_camera_list(folder / name, reading)
    splits = [folder / f"transforms_{s}.json" for s in SPLITS]
    if splits[0].is_file():
        return read_transforms_cameras([s for s in splits if s.is_file()], reading)
    found = find_model(folder)
    if found is None and (foreign := read_foreign_cameras(folder, reading)) is not None:
        return foreign
    if found is None:
        raise BadFile(f"{folder} holds no cameras; wanted is {KNOWN}.")
    cameras = read_colmap_cameras(*found, reading)
    return replace(cameras, notes=said_of_models(*found) + cameras.notes)


def is_cameras(path: Path) -> bool:
    """Whether a JSON file is one of cameras, by its keys; whether it is whole is for the reader."""
    try:
        data = read_json(path, most_bytes=MOST_BYTES)
    except (BadFile, OSError):
        return False
    if isinstance(data, list):
        row = data[0] if data and isinstance(data[0], dict) else {}
        return MARKS <= row.keys() or "matrix" in row
    marks = {FLOOR_MARK, *PATH_MARKS, TRANSFORMS_MARK, MARK}
    return isinstance(data, dict) and bool(marks & data.keys())


def find_cameras(scene: Path) -> Path | None:
    """The file or folder of cameras that lies with a scene: in it, beside it, up to two above."""
    if scene.is_dir() and has_cameras(scene):
        return scene
    beside, *above = list(scene.resolve().parents)[:BESIDE]
    if has_cameras(beside):
        return beside
    files = [folder / IN_FOLDERS[-1] for folder in above]  # only 3DGS puts cameras up there
    return next((file for file in files if file.is_file()), None)


def has_cameras(folder: Path) -> bool:
    files = (*IN_FOLDERS, f"transforms_{SPLITS[0]}.json")
    return any((folder / name).is_file() for name in files) or find_model(folder) is not None


def find_floor(scene: Path) -> Path | None:
    """NAME_vr.json beside NAME.ply, as splatapult looks for it, or None."""
    path = scene.with_name(f"{scene.stem}_vr.json")
    return path if scene.name and path.is_file() else None


# Bare lists of poses: {"c2w": [4x4, ...]} with OpenCV axes and no word about the lens.

MARK = "c2w"


def read_pose_list(data: dict, reading: CameraReading, where: str) -> CameraList:
    """The views, all through one lens: --fov-y, else ours with a note.  Raises BadFile."""
    poses = data[MARK]
    if not isinstance(poses, list) or not poses:
        raise BadFile(f"{where}: '{MARK}' must be a list of 4x4 poses, one a camera.")
    fov_y, notes = assumed_fov(reading, where)
    size, turn = reading.size or SIZE, ours_from_world(reading)
    tangents = perspective(fov_y, size)
    views = []
    for i, pose in enumerate(poses):
        matrix = opencv_from_eye(turn @ pose_matrix(pose, f"{where}, camera {i}"))
        views.append(eye_view(matrix, tangents, size, f"{where}, camera {i}"))
    return CameraList(tuple(views), ("",) * len(views), "list of poses", notes)


# cameras.json as 3DGS writes it beside its splats: positions, rotations, focal lengths.

MARKS = {"position", "rotation"}  # keys of a row that tell this form
LEAST, MOST = 1e-30, 1e30  # pixels that a float holds well
LENS = {"width", "height", "fx", "fy"}


def read_inria_cameras(rows: object, reading: CameraReading, where: str) -> CameraList:
    """`rows` as JSON gives them, turned as 3DGS's splats are.  Raises BadFile.

    A row is {"id", "img_name", "width", "height", "position" (3,), "rotation" 3x3 camera to world
    with OpenCV axes, "fx", "fy"}; "cx" and "cy" are ours, the middle where they are absent.  Where
    no row has any of the lens, all get the field of view of `reading`, or ours with a note.
    """
    rows = read_rows(rows, "the file", where)
    turn = ours_from_world(reading)
    notes: tuple[str, ...] = ()
    if not any(LENS & row.data.keys() for row in rows):
        fov_y, notes = assumed_fov(reading, where)
        width, height = reading.size or SIZE
        focal = height / 2 / math.tan(fov_y / 2)
        lens = {"width": width, "height": height, "fx": focal, "fy": focal}
        rows = [Fields({**row.data, **lens}, row.where) for row in rows]
    views = [read_row(row, turn, reading) for row in rows]
    names = tuple(read_name(row.data.get("img_name")) for row in rows)
    return CameraList(tuple(views), names, "3DGS cameras.json", notes)


def read_row(row: Fields, turn: np.ndarray, reading: CameraReading) -> View:
    if not row.data.keys() >= MARKS:
        raise BadFile(f"{row.where}: expected 'position' and 'rotation' as in the first camera.")
    matrix = np.eye(4)
    matrix[:3, :3] = numbers(row.data["rotation"], (3, 3), f"{row.where}: 'rotation'")
    matrix[:3, 3] = numbers(row.data["position"], (3,), f"{row.where}: 'position'")
    matrix = pose_matrix(matrix, f"{row.where}: 'rotation'")
    width, height, fx, fy = (
        row.number(key, wanted="a number of pixels above 0", low=LEAST, high=MOST)
        for key in ("width", "height", "fx", "fy")
    )
    centre = (
        row.number("cx", width / 2, "a number of pixels", -MOST, MOST),
        row.number("cy", height / 2, "a number of pixels", -MOST, MOST),
    )
    view = pinhole_view(turn @ matrix, (fx, fy), centre, (width, height), row.where)
    return view.resized(reading.size) if reading.size else view


# Cameras of Metashape, RealityScan, OpenMVG and others: the poses that captures are read from.


def read_foreign_cameras(path: Path, reading: CameraReading) -> CameraList | None:
    """The views of a file, or of a folder with one; None where it has none of these forms.

    Photos need not be there, unless the file does not say how many pixels they have.  Raises
    BadFile.
    """
    refuse_known(path)
    posed = read_foreign(path)
    if posed is None:
        return None
    sized = [frame for frame in posed.frames if "lens" in frame]
    usable = [frame for frame in sized if not is_panorama(frame["lens"])]
    first = path_end(posed.frames[0]["file_path"])
    if not sized:
        raise BadFile(
            f"{posed.where}: it does not say how many pixels its photos have; put {first} and the "
            "others beside it."
        )
    if not usable:
        raise BadFile(
            f"{posed.where}: all cameras are panoramas, which no view can be; train reads them."
        )
    notes = posed.doubts
    if left := len(posed.frames) - len(usable):
        notes += (
            f"{left} of {len(posed.frames)} cameras are panoramas, or of photos that are not there "
            "and whose size the file does not say; they are left out.",
        )
    said = {key: posed.frames[0][key] for key in ("up",) if key in posed.frames[0]}
    found = cameras_of(said, usable, Path(posed.where), reading)
    return replace(found, format=posed.program, notes=notes + found.notes)
