"""Views to draw from: whichever form a file or folder of cameras has, found from its content."""

from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import MOST_BYTES, CameraList, CameraReading
from shapeshift.scene.cameras.read_camera_path import MARKS as PATH_MARKS
from shapeshift.scene.cameras.read_camera_path import read_camera_path
from shapeshift.scene.cameras.read_colmap_cameras import read_colmap_cameras
from shapeshift.scene.cameras.read_floor import MARK as FLOOR_MARK
from shapeshift.scene.cameras.read_floor import read_floor
from shapeshift.scene.cameras.read_inria_cameras import MARKS as INRIA_MARKS
from shapeshift.scene.cameras.read_inria_cameras import read_inria_cameras
from shapeshift.scene.cameras.read_own_cameras import read_own_cameras
from shapeshift.scene.cameras.read_pose_list import MARK as POSE_MARK
from shapeshift.scene.cameras.read_pose_list import read_pose_list
from shapeshift.scene.cameras.read_transforms_cameras import MARK as TRANSFORMS_MARK
from shapeshift.scene.cameras.read_transforms_cameras import read_transforms_cameras
from shapeshift.scene.captures.colmap.colmap_files import said_of_models
from shapeshift.scene.captures.colmap_tables import TABLES as COLMAP_TABLES
from shapeshift.scene.captures.colmap_tables import find_model
from shapeshift.scene.captures.foreign.foreign_cameras import read_foreign_cameras
from shapeshift.scene.captures.foreign.read_foreign import is_table_of_lenses
from shapeshift.scene.pose import View

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
        read = read_inria_cameras if INRIA_MARKS <= first.keys() else read_own_cameras
        return read(data, reading, path.name)
    keys = data.keys() if isinstance(data, dict) else ()
    if FLOOR_MARK in keys:
        return read_floor(data, reading, path.name)
    if any(mark in keys for mark in PATH_MARKS):
        return read_camera_path(data, reading, path.name)
    if TRANSFORMS_MARK in keys:
        return read_transforms_cameras([path], reading)
    if POSE_MARK in keys:
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
        return INRIA_MARKS <= row.keys() or "matrix" in row
    marks = {FLOOR_MARK, *PATH_MARKS, TRANSFORMS_MARK, POSE_MARK}
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
