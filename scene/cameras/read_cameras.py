"""Views to draw from: whichever form a file or folder of cameras has, found from its content."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number, read_json
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    MOST_BYTES,
    SIZE,
    CameraList,
    CameraReading,
    assumed_fov,
    eye_view,
    first_of_each,
    flipped,
    numbers,
    opencv_from_eye,
    ours_from_world,
    pinhole_view,
    pose_matrix,
    read_name,
    read_rows,
)
from shapeshift.scene.cameras.camera_path import MARKS as PATH_MARKS
from shapeshift.scene.cameras.camera_path import read_camera_path
from shapeshift.scene.cameras.colmap_cameras import read_colmap_cameras
from shapeshift.scene.cameras.own_cameras import read_own_cameras
from shapeshift.scene.cameras.read_floor import MARK as FLOOR_MARK
from shapeshift.scene.cameras.read_floor import read_floor
from shapeshift.scene.capture_files import find_file
from shapeshift.scene.capture_photos import image_size
from shapeshift.scene.captures.capture_rules import COLMAP_UP, CaptureWorld
from shapeshift.scene.captures.colmap.colmap_files import said_of_models
from shapeshift.scene.captures.colmap_tables import TABLES as COLMAP_TABLES
from shapeshift.scene.captures.colmap_tables import ColmapCamera, find_model
from shapeshift.scene.captures.foreign.read_foreign import (
    is_table_of_lenses,
    read_foreign,
    refuse_known,
)
from shapeshift.scene.captures.lenses.panorama import is_panorama
from shapeshift.scene.captures.read_transforms import POSES, gather, opencv_axes
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


# transforms.json for its cameras alone, nerfstudio's, Blender's, ours; photos need not be there.

BLENDER_SIZE = (800, 800)  # of the synthetic NeRF scenes, whose files name no size
LEAST_SAID, MOST_SAID = 1e-30, 1e30  # that a float holds well
RADIANS = "an angle between 0 and pi radians"
BENDS = ("k1", "k2", "k3", "k4", "p1", "p2")
FRAMES = "frames"


@dataclass
class Notes:
    """What is said once about the whole file, though each frame finds it."""

    bent: bool = False
    unsized: bool = False
    without_lens: tuple[str, ...] = ()


def read_transforms_cameras(files: list[Path], reading: CameraReading) -> CameraList:
    """The views of one JSON file, or of the train/val/test files of a Blender set.

    Equal views of several modalities come once.  Without --up their world is turned as that of
    the capture would be (docs/capture.md).  Raises BadFile.
    """
    data, entries = gather(tuple(files))
    return cameras_of(data, entries, files[0], reading)


def cameras_of(
    data: dict, entries: Sequence[Mapping], file: Path, reading: CameraReading
) -> CameraList:
    """The views of frames, and of what their file says for all; photos lie beside it."""
    where, notes = file.name, Notes()
    frames = [f"{where}, frame {i}" for i in range(len(entries))]
    # A left-handed world is turned round as that of the capture; --up is of a PLY in it.
    cameras = [pose_of(e, at, not reading.up) for e, at in zip(entries, frames, strict=True)]
    if reading.up:
        turn = ours_from_world(reading)
    else:
        usual = COLMAP_UP if opencv_axes(entries[0]) else None
        world = CaptureWorld.of(np.array(cameras), (0, 0, 1), data, where, usual)
        turn = flipped(reading) @ world.ours_from_file
        for camera in cameras:
            camera[:3, 3] *= world.unit_m
    views, names = [], []
    for entry, camera, at in zip(entries, cameras, frames, strict=True):
        views.append(view_of(entry, turn @ camera, file.parent, reading, notes, at))
        names.append(read_name(entry.get("file_path") or entry.get("file")))
    kept = first_of_each(views)
    return CameraList(
        tuple(views[i] for i in kept),
        tuple(names[i] for i in kept),
        "transforms",
        note_sentences(notes, where),
    )


def pose_of(entry: Mapping, where: str, may_mirror: bool) -> np.ndarray:
    """(4, 4) camera to world with OpenCV axes, the file's world."""
    key = next((k for k in POSES if k in entry), None)
    if key is None:
        raise BadFile(f"{where} has no pose; give it a 'transform_matrix'.")
    matrix = pose_matrix(entry[key], f"{where}: '{key}'", may_mirror)
    return matrix if opencv_axes(entry) else opencv_from_eye(matrix)


def view_of(
    entry: Mapping,
    camera: np.ndarray,
    folder: Path,
    reading: CameraReading,
    notes: Notes,
    where: str,
) -> View:
    fields = Fields(entry, where)
    width, height = size = size_of(fields, folder, notes)
    fx = focal_of(fields, "fl_x", "camera_angle_x", width)
    fy = focal_of(fields, "fl_y", "camera_angle_y", height)
    if not fx and not fy:
        fov_y, notes.without_lens = assumed_fov(reading, where.split(",")[0])
        fy = height / 2 / math.tan(fov_y / 2)
    centre = (entry.get("cx", width / 2), entry.get("cy", height / 2))
    bent = any(is_number(entry.get(k)) and entry[k] != 0 for k in BENDS)
    bent |= isinstance(lens := entry.get("lens"), ColmapCamera) and lens.bends
    notes.bent |= bent or "FISHEYE" in str(entry.get("camera_model", ""))
    view = pinhole_view(camera, (fx or fy, fy or fx), centre, size, where)
    return view.resized(reading.size) if reading.size else view


def focal_of(fields: Fields, pixels: str, angle: str, side: float) -> float:
    """Focal length in pixels, or 0 where neither it nor the angle of view is given."""
    if pixels in fields.data:
        return fields.number(
            pixels, wanted="a number of pixels above 0", low=LEAST_SAID, high=MOST_SAID
        )
    if angle in fields.data:
        radians = fields.number(angle, wanted=RADIANS, low=LEAST_SAID, high=math.pi)
        if not radians < math.pi:
            raise fields.error(angle, RADIANS)
        return side / 2 / math.tan(radians / 2)
    return 0.0


def size_of(fields: Fields, folder: Path, notes: Notes) -> tuple[float, float]:
    """(width, height) as given, else of the photo if it is there, else of Blender's sets."""
    entry = fields.data
    if "w" in entry and "h" in entry:
        return (
            fields.number("w", wanted="a number of pixels, 1 or more,", low=1, high=MOST_SAID),
            fields.number("h", wanted="a number of pixels, 1 or more,", low=1, high=MOST_SAID),
        )
    file = entry.get("file_path") or entry.get("file")
    if isinstance(file, str) and os.path.isfile(photo := find_file(folder, file).path):
        return image_size(photo, None)
    notes.unsized = True
    return BLENDER_SIZE


def note_sentences(notes: Notes, where: str) -> tuple[str, ...]:
    out = list(notes.without_lens)
    if notes.bent:
        out.append(f"{where}: the lenses' distortion is left out; the views are those of pinholes.")
    if notes.unsized:
        out.append(f"{where} names no size; taken is {BLENDER_SIZE[0]}x{BLENDER_SIZE[1]}.")
    return tuple(out)


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
    if FRAMES in keys:
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
    marks = {FLOOR_MARK, *PATH_MARKS, FRAMES, MARK}
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
