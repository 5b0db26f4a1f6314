"""transforms.json and cameras.json -> Capture: nerfstudio, Blender, our own form, OpenCV tables."""

import math
import os
from collections import ChainMap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json, shown
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.capture_photos import doubts_of, image_size, posed_photo, refuse_all_missing
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.capture_rules import (
    COLMAP_UP,
    LARGEST_NUMBER,
    CaptureWorld,
    background_from,
    counts_from,
    rigid,
    split_every_8th,
    spread_stops,
    stops_from,
    with_counts,
)
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.dated_stops import day_of_frame
from shapeshift.scene.captures.depth_photo import NAMES as DEPTH_NAMES
from shapeshift.scene.captures.depth_photo import depth_of, refuse_other_units
from shapeshift.scene.captures.normal_photo import NAMES as NORMAL_NAMES
from shapeshift.scene.captures.normal_photo import normals_of, refuse_other_axes
from shapeshift.scene.captures.read_points import read_points
from shapeshift.scene.pose import OPENCV_FROM_EYE

ENDINGS = ("", ".png", ".jpg", ".jpeg", ".PNG", ".JPG")
POSES = ("transform_matrix", "c2w_opencv", "c2w")
SPLITS = {"train": "train", "test": "test", "val": "test"}
LENS = ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y", "cx", "cy",
        "k1", "k2", "k3", "k4", "p1", "p2", "w", "h")  # fmt: skip
# nerfstudio's lists of the photos of a split; what is in none of them is not used.
LISTS = {"train_filenames": "train", "val_filenames": "test", "test_filenames": "test"}
MOST_BYTES = 1 << 30  # of JSON
NO_PINHOLES = ("EQUIRECTANGULAR", "OMNIDIRECTIONAL", "VR180", "ORTHOPHOTO", "FISHEYE624")


@dataclass(frozen=True)
class Shot:
    """One photo as the file has it: its frame with what the file says for all frames."""

    entry: Mapping
    modality: str
    path: Path  # without an ending where there is no such file
    world_from_camera: np.ndarray  # (4, 4) OpenCV axes, the file's world
    where: str  # for messages
    folder: Path  # where the names of its photos begin

    @property
    def names_depth(self) -> bool:
        return any(self.entry.get(key) for key in DEPTH_NAMES)

    @property
    def names_normals(self) -> bool:
        return any(self.entry.get(key) for key in NORMAL_NAMES)


def read_transforms(*files: Path) -> Capture:
    """A capture from one JSON file, or from the train/val/test files of a Blender data set."""
    folder, where = files[0].parent, str(files[0])
    data, entries = gather(files)
    stops = stops_of(data, entries, where)
    named = [s for i, e in enumerate(entries) for s in shots_of(e, i, data, stops, folder, where)]
    shots = [shot for shot in named if os.path.isfile(shot.path)]
    missing = [str(shot.path) for shot in named if not os.path.isfile(shot.path)]
    refuse_all_missing(missing, len(named), where)
    for stop in stops:
        if not any(s.modality == stop.name for s in shots):
            raise BadFile(
                f"{where}: modality {shown(stop.name)} has no images; add frames or drop it"
            )
    world = CaptureWorld.of(
        np.array([s.world_from_camera for s in shots]),
        (0, 0, 1),
        data.get("up", COLMAP_UP if opencv_axes(entries[0]) else None),
        where,
    )
    photos, rescaled, no_depth, no_normals = [], [], [], []
    for shot in shots:
        lens = lens_of(shot)
        photos.append(photo := photo_of(shot, lens, world, folder))
        rescaled += [str(shot.path)] if photo.file_size != lens.size else []
        no_depth += [str(shot.path)] if photo.depth is None and shot.names_depth else []
        no_normals += [str(shot.path)] if photo.normals is None and shot.names_normals else []
    doubts = doubts_of(len(named), missing, photos, rescaled, no_depth, no_normals)
    photos = with_counts(photos, counts_from(data.get("modalities"), where))
    if not any("split" in e for e in entries):
        photos = split_every_8th(photos)
    points, colors = None, None
    fields = Fields(data, where)
    name = fields.text("points", "")
    if not name and (name := fields.text("ply_file_path", "")):
        if not os.path.isfile(folder / name):
            doubts += (f"The points {path_end(folder / name)} are not there.",)
            name = ""
    if name or (folder / "points3d.npz").is_file():
        points, colors = read_points(folder / (name or "points3d.npz"))
    described = any(isinstance(m, dict) for m in data.get("modalities") or ())
    background, notes = background_from(data, where), fields.optional_object("notes")
    capture = world.capture(
        folder,
        stops,
        photos,
        points,
        colors,
        background,
        not described,
        dict(notes.data) if notes else None,
        doubts,
    )
    refuse_other_units(capture, where)
    refuse_other_axes(capture, where)
    return capture


def gather(files: tuple[Path, ...]) -> tuple[dict, list[Mapping]]:
    """What the files say for all frames, and every frame with that filled in."""
    everything: dict = {}
    entries: list[Mapping] = []
    for file in files:
        data = read_capture_json(file)
        frames = data.pop("frames", None)
        if not isinstance(frames, list) or not all(isinstance(f, dict) for f in frames):
            raise BadFile(f"{file}: no list 'frames'; this file holds no posed photos")
        if not frames:
            raise BadFile(f"{file}: 'frames' is empty; a capture needs at least one photo")
        split = {"split": file.stem.rpartition("_")[2]} if len(files) > 1 else {}
        # One after the other, not one of them: each frame would hold all that is said for all.
        entries += [ChainMap(frame, split, data) for frame in listed(frames, data, str(file))]
        everything |= data
    return everything, entries


def listed(frames: list[dict], data: dict, where: str) -> list[dict]:
    """The frames with the splits of nerfstudio's lists of them; all as they are without such."""
    splits: dict[str, str] = {}
    for key, split in LISTS.items():
        if data.get(key):
            splits |= dict.fromkeys(Fields(data, where).texts(key), split)
    if not splits:
        return frames
    used = [frame for frame in frames if frame.get("file_path") in splits]
    if not used:
        raise BadFile(f"{where}: its lists of training and test photos name none of its frames")
    return [frame | {"split": splits[frame["file_path"]]} for frame in used]


def read_capture_json(file: Path) -> dict:
    """The object of a file; a version of our own form that is not known is refused."""
    data = read_json(file, most_bytes=MOST_BYTES)
    if not isinstance(data, dict):
        raise BadFile(f"{file} holds {shown(data)}; an object with 'frames' is wanted")
    if data.get("format", "shapeshift-capture") == "shapeshift-capture":
        version = data.get("version", 1)
        if version != 1:
            raise BadFile(
                f"{file}: version {shown(version)} of the capture form; this program reads 1"
            )
    return data


def stops_of(data: dict, entries: Sequence[Mapping], where: str) -> tuple[Stop, ...]:
    listed = data.get("modalities")
    if not listed:
        names = [
            Fields(entry, f"{where}: frame {i}").text("modality", usual_modality(entry, where, i))
            for i, entry in enumerate(entries)
        ]
        if "" in names:
            raise BadFile(f"{where}: frame {names.index('')}: 'modality' is empty; give it a name")
        return spread_stops(dict.fromkeys(names))
    if isinstance(listed, list) and all(isinstance(name, str) and name for name in listed):
        if len(set(listed)) < len(listed):
            raise BadFile(f"{where}: two modalities have the same name; rename one")
        return spread_stops(listed)
    return tuple(sorted(stops_from(listed, where), key=lambda stop: stop.x))


def usual_modality(entry: Mapping, where: str, number: int) -> str:
    """Of a frame that names none."""
    return day_of_frame(entry, f"{where}: frame {number}") or "RGB"


def shots_of(
    entry: Mapping, number: int, data: dict, stops: tuple[Stop, ...], folder: Path, where: str
) -> list[Shot]:
    """The photos of one frame: one, or one a modality where the frame names none of several."""
    where = f"{where}: frame {number}"
    fields = Fields(entry, where)
    file = fields.text("file_path", "") or fields.text("file", "")
    if not file:
        raise BadFile(f"{where} names no image; give it a 'file_path'")
    where = fields.where = f"{where} ({path_end(file)})"
    key = next((k for k in POSES if k in entry), None)
    if key is None:
        raise BadFile(f"{where} has no pose; run COLMAP first, or give it a 'transform_matrix'")
    matrix = rigid(entry[key], where)
    if not opencv_axes(entry):
        matrix = matrix @ OPENCV_FROM_EYE
    names = [s.name for s in stops]
    day = "" if "modality" in entry else day_of_frame(entry, where)
    if "modality" in entry or day or len(names) == 1:
        modality = fields.text("modality", day or names[0])
        if modality not in names:
            raise BadFile(
                f"{where} is of modality {shown(modality)}; the file lists {shown(names)}"
            )
        return [Shot(entry, modality, find_image(folder / file), matrix, where, folder)]
    return [Shot(entry, n, find_image(folder / n / file), matrix, where, folder / n) for n in names]


def opencv_axes(entry: Mapping) -> bool:
    """Whether poses have x right, y down, z forward; without a word on it they are OpenGL's."""
    if "transform_matrix" in entry:
        return "opencv" in str(entry.get("convention", "")).lower()
    return "opengl" not in str(entry.get("convention", "")).lower()


def find_image(path: Path) -> Path:
    """The file of that name, whose ending may lack; the name as it is where there is none."""
    for ending in ENDINGS:
        if os.path.isfile(f"{path}{ending}"):  # unlike Path.is_file it takes any text for a name
            return Path(f"{path}{ending}")
    return path


def photo_of(shot: Shot, lens: ColmapCamera, world: CaptureWorld, folder: Path) -> Photo:
    entry, where = shot.entry, shot.where
    fields = Fields(entry, where)
    split = fields.text("split", "train")
    if split not in SPLITS:
        raise BadFile(f"{where} has split {shown(split)}; use train or test")
    matrix = world.turned(shot.world_from_camera)
    photo = posed_photo(shot.path, shot.modality, matrix, lens, where)
    mask, name = None, fields.text("mask_path", "") or fields.text("mask", "")
    if name:
        mask = folder / name
        if not os.path.isfile(mask):
            raise BadFile(f"{where}: the mask {path_end(mask)} is missing; put it there")
        image_size(mask, photo.file_size)
    depth, unit = depth_of(entry, shot.folder, photo.file_size, where)
    photo = replace(photo, mask=mask, split=SPLITS[split], depth=depth, depth_unit=unit)
    normals, axes = normals_of(entry, shot.folder, photo.file_size, where)
    return replace(photo, normals=normals, normal_axes=axes)


def lens_of(shot: Shot) -> ColmapCamera:
    """The lens as the file states it, of the size that it states, else of the photo's."""
    entry, where = shot.entry, shot.where
    fields = Fields(entry, where)
    for key in LENS:
        fields.number(key, 0.0, low=-LARGEST_NUMBER, high=LARGEST_NUMBER)
    if "w" in entry and "h" in entry:
        width, height = size = int(entry["w"]), int(entry["h"])
        if not (width >= 1 and height >= 1 and size == (entry["w"], entry["h"])):
            raise BadFile(f"{where}: 'w' and 'h' are {entry['w']:g} and {entry['h']:g}, not pixels")
    else:
        width, height = size = image_size(shot.path, None)
    if "fl_x" in entry:
        fx = float(entry["fl_x"])
        fy = float(entry.get("fl_y", fx))
    elif "camera_angle_x" in entry:
        fx = fy = focal_of(entry, "camera_angle_x", width, where)
        if "camera_angle_y" in entry:
            fy = focal_of(entry, "camera_angle_y", height, where)
    else:
        raise BadFile(f"{where} has no focal length; give 'fl_x' in pixels or 'camera_angle_x'")
    centre = float(entry.get("cx", width / 2)), float(entry.get("cy", height / 2))
    k1, k2, k3, k4, p1, p2 = (float(entry.get(k, 0)) for k in ("k1", "k2", "k3", "k4", "p1", "p2"))
    model = str(entry.get("camera_model", "")).upper()
    if any(name in model for name in NO_PINHOLES):
        raise BadFile(f"{where} is of camera model {model:.40}, which no pinhole can stand for")
    if "FISHEYE" in model or entry.get("is_fisheye") is True:
        return ColmapCamera("OPENCV_FISHEYE", size, (fx, fy, *centre, k1, k2, k3, k4))
    if k4:
        raise BadFile(
            f'{where} has k4 = {k4:g}, which only fisheye lenses have: "camera_model": '
            '"OPENCV_FISHEYE" says that it is one'
        )
    return ColmapCamera("FULL_OPENCV", size, (fx, fy, *centre, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0))


def focal_of(entry: Mapping, key: str, side: int, where: str) -> float:
    """Pixels of focal length of an angle of view in radians across `side` pixels."""
    if not 0 < entry[key] < math.pi:
        raise BadFile(f"{where}: '{key}' is {entry[key]:g}; radians between 0 and pi are wanted")
    return side / 2 / math.tan(entry[key] / 2)
