"""transforms.json for its cameras alone: nerfstudio, Blender, ours; photos need not be there."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    CameraList,
    CameraReading,
    assumed_fov,
    first_of_each,
    flipped,
    opencv_from_eye,
    ours_from_world,
    pinhole_view,
    pose_matrix,
    read_name,
)
from shapeshift.scene.capture_files import find_file
from shapeshift.scene.capture_photos import image_size
from shapeshift.scene.captures.capture_rules import COLMAP_UP, CaptureWorld
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.read_transforms import POSES, gather, opencv_axes
from shapeshift.scene.pose import View

BLENDER_SIZE = (800, 800)  # of the synthetic NeRF scenes, whose files name no size
LEAST, MOST = 1e-30, 1e30  # that a float holds well
RADIANS = "an angle between 0 and pi radians"
LENS = ("k1", "k2", "k3", "k4", "p1", "p2")
MARK = "frames"


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
    bent = any(is_number(entry.get(k)) and entry[k] != 0 for k in LENS)
    bent |= isinstance(lens := entry.get("lens"), ColmapCamera) and lens.bends
    notes.bent |= bent or "FISHEYE" in str(entry.get("camera_model", ""))
    view = pinhole_view(camera, (fx or fy, fy or fx), centre, size, where)
    return view.resized(reading.size) if reading.size else view


def focal_of(fields: Fields, pixels: str, angle: str, side: float) -> float:
    """Focal length in pixels, or 0 where neither it nor the angle of view is given."""
    if pixels in fields.data:
        return fields.number(pixels, wanted="a number of pixels above 0", low=LEAST, high=MOST)
    if angle in fields.data:
        radians = fields.number(angle, wanted=RADIANS, low=LEAST, high=math.pi)
        if not radians < math.pi:
            raise fields.error(angle, RADIANS)
        return side / 2 / math.tan(radians / 2)
    return 0.0


def size_of(fields: Fields, folder: Path, notes: Notes) -> tuple[float, float]:
    """(width, height) as given, else of the photo if it is there, else of Blender's sets."""
    entry = fields.data
    if "w" in entry and "h" in entry:
        return (
            fields.number("w", wanted="a number of pixels, 1 or more,", low=1, high=MOST),
            fields.number("h", wanted="a number of pixels, 1 or more,", low=1, high=MOST),
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
