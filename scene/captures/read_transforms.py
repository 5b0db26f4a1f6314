"""transforms.json and cameras.json -> Capture: nerfstudio, Blender, our own form, OpenCV tables."""

import json
import math
import os
from collections import ChainMap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import read_json_file
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.capture_rules import (
    COLMAP_UP,
    CaptureWorld,
    background_from,
    counts_from,
    image_size,
    rigid,
    split_every_8th,
    spread_stops,
    stops_from,
    with_counts,
)
from shapeshift.scene.captures.depth_photo import depth_of, refuse_other_units
from shapeshift.scene.captures.read_points import read_points
from shapeshift.scene.json.json_values import is_number, shortened, shown, text_in
from shapeshift.scene.pose import OPENCV_FROM_EYE, View

ENDINGS = ("", ".png", ".jpg", ".jpeg", ".PNG", ".JPG")
POSES = ("transform_matrix", "c2w_opencv", "c2w")
SPLITS = {"train": "train", "test": "test", "val": "test"}
LENS = ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y", "cx", "cy",
        "k1", "k2", "k3", "k4", "p1", "p2", "w", "h")  # fmt: skip
STRAIGHT = 0.5  # pixels that lens distortion may shift a corner before it matters


@dataclass(frozen=True)
class Shot:
    """One photo as the file has it: its frame with what the file says for all frames."""

    entry: dict
    modality: str
    path: Path
    world_from_camera: np.ndarray  # (4, 4) OpenCV axes, the file's world
    where: str  # for messages
    folder: Path  # where the names of its photos begin


def read_transforms(*files: Path) -> Capture:
    """A capture from one JSON file, or from the train/val/test files of a Blender data set."""
    folder, where = files[0].parent, str(files[0])
    data, entries = gather(files)
    stops = stops_of(data, entries, where)
    shots = [s for i, e in enumerate(entries) for s in shots_of(e, i, data, stops, folder, where)]
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
    photos = [photo_of(shot, world, folder) for shot in shots]
    photos = with_counts(photos, counts_from(data.get("modalities"), where))
    if not any("split" in e for e in entries):
        photos = split_every_8th(photos)
    points, colors = None, None
    name = text_in(data, "points", where) or text_in(data, "ply_file_path", where)
    if name or (folder / "points3d.npz").is_file():
        points, colors = read_points(folder / (name or "points3d.npz"))
    named = any(isinstance(m, dict) for m in data.get("modalities") or ())
    background, notes = background_from(data, where), data.get("notes")
    if not isinstance(notes, dict | None):
        raise BadFile(f"{where}: 'notes' is {shown(notes)}; an object is wanted")
    capture = world.capture(folder, stops, photos, points, colors, background, not named, notes)
    refuse_other_units(capture, where)
    return capture


def gather(files: tuple[Path, ...]) -> tuple[dict, list[Mapping]]:
    """What the files say for all frames, and every frame with that filled in."""
    everything, entries = {}, []
    for file in files:
        data = read_json(file)
        frames = data.pop("frames", None)
        if not isinstance(frames, list) or not all(isinstance(f, dict) for f in frames):
            raise BadFile(f"{file}: no list 'frames'; this file holds no posed photos")
        if not frames:
            raise BadFile(f"{file}: 'frames' is empty; a capture needs at least one photo")
        split = {"split": file.stem.rpartition("_")[2]} if len(files) > 1 else {}
        # One after the other, not one of them: each frame would hold all that is said for all.
        entries += [ChainMap(frame, split, data) for frame in frames]
        everything |= data
    return everything, entries


def read_json(file: Path) -> dict:
    text = read_json_file(file)
    try:
        data = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadFile(f"{file}: not JSON ({error}); write it again") from None
    if not isinstance(data, dict):
        raise BadFile(f"{file}: holds a {type(data).__name__}; an object with 'frames' is wanted")
    if data.get("format", "shapeshift-capture") == "shapeshift-capture":
        version = data.get("version", 1)
        if version != 1:
            raise BadFile(
                f"{file}: version {shown(version)} of the capture form; this program reads 1"
            )
    return data


def stops_of(data: dict, entries: list[dict], where: str) -> tuple[Stop, ...]:
    listed = data.get("modalities")
    if not listed:
        names = [
            text_in(entry, "modality", f"{where}: frame {i}", "RGB")
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


def shots_of(
    entry: dict, number: int, data: dict, stops: tuple[Stop, ...], folder: Path, where: str
) -> list[Shot]:
    """The photos of one frame: one, or one a modality where the frame names none of several."""
    where = f"{where}: frame {number}"
    file = text_in(entry, "file_path", where) or text_in(entry, "file", where)
    if not file:
        raise BadFile(f"{where} names no image; give it a 'file_path'")
    where = f"{where} ({shortened(file)})"
    key = next((k for k in POSES if k in entry), None)
    if key is None:
        raise BadFile(f"{where} has no pose; run COLMAP first, or give it a 'transform_matrix'")
    matrix = rigid(entry[key], where)
    if not opencv_axes(entry):
        matrix = matrix @ OPENCV_FROM_EYE
    names = [s.name for s in stops]
    if "modality" in entry or len(names) == 1:
        modality = text_in(entry, "modality", where, names[0])
        if modality not in names:
            raise BadFile(
                f"{where} is of modality {shown(modality)}; the file lists {shown(names)}"
            )
        return [Shot(entry, modality, find_image(folder / file, where), matrix, where, folder)]
    return [
        Shot(entry, n, find_image(folder / n / file, where), matrix, where, folder / n)
        for n in names
    ]


def opencv_axes(entry: dict) -> bool:
    """Whether poses have x right, y down, z forward; without a word on it they are OpenGL's."""
    if "transform_matrix" in entry:
        return "opencv" in str(entry.get("convention", "")).lower()
    return "opengl" not in str(entry.get("convention", "")).lower()


def find_image(path: Path, where: str) -> Path:
    for ending in ENDINGS:
        if os.path.isfile(f"{path}{ending}"):  # unlike Path.is_file it takes any text for a name
            return Path(f"{path}{ending}")
    raise BadFile(
        f"{where}: the image file {shortened(path)} is missing; put it there or drop the frame"
    )


def photo_of(shot: Shot, world: CaptureWorld, folder: Path) -> Photo:
    entry, where = shot.entry, shot.where
    for key in LENS:
        value = entry.get(key, 0)
        if not (is_number(value) and abs(value) <= 1e30):
            raise BadFile(f"{where}: '{key}' is {shown(value)}; a number is wanted")
    claimed = (entry["w"], entry["h"]) if "w" in entry and "h" in entry else None
    size = image_size(shot.path, claimed)
    focal, centre = intrinsics(entry, size, where)
    split = text_in(entry, "split", where, "train")
    if split not in SPLITS:
        raise BadFile(f"{where} has split {shown(split)}; use train or test")
    mask, name = None, text_in(entry, "mask_path", where) or text_in(entry, "mask", where)
    if name:
        mask = folder / name
        if not os.path.isfile(mask):
            raise BadFile(f"{where}: the mask {shortened(mask)} is missing; put it there")
        image_size(mask, size)
    try:
        view = View.from_pinhole(world.turned(shot.world_from_camera), focal, centre, size)
    except ValueError as error:
        raise BadFile(f"{where}: {error}") from None
    depth, unit = depth_of(entry, shot.folder, size, where)
    return Photo(view, shot.path, shot.modality, mask, SPLITS[split], depth, unit)


def intrinsics(entry: dict, size: tuple[int, int], where: str) -> tuple[tuple, tuple]:
    """(fx, fy), (cx, cy) in pixels; lenses that bend lines are refused."""
    width, height = size
    if "fl_x" in entry:
        fx = float(entry["fl_x"])
        fy = float(entry.get("fl_y", fx))
    elif "camera_angle_x" in entry:
        fx = fy = focal_of(entry, "camera_angle_x", width, where)
        if "camera_angle_y" in entry:
            fy = focal_of(entry, "camera_angle_y", height, where)
    else:
        raise BadFile(f"{where} has no focal length; give 'fl_x' in pixels or 'camera_angle_x'")
    if not (0 < fx < np.inf and 0 < fy < np.inf):
        raise BadFile(f"{where} has focal lengths {fx}, {fy}; both must be above 0")
    cx, cy = float(entry.get("cx", width / 2)), float(entry.get("cy", height / 2))
    x, y = max(cx, width - cx) / fx, max(cy, height - cy) / fy
    k1, k2, k3, k4, p1, p2 = (float(entry.get(k, 0)) for k in ("k1", "k2", "k3", "k4", "p1", "p2"))
    r2 = x * x + y * y
    bend = r2 * (abs(k1) + r2 * (abs(k2) + r2 * (abs(k3) + r2 * abs(k4))))
    shift = fx * (math.sqrt(r2) * bend + 3 * (abs(p1) + abs(p2)) * r2)
    if not shift <= STRAIGHT or "FISHEYE" in str(entry.get("camera_model", "")):
        raise BadFile(
            f"{where} was taken through a lens that shifts its corners by {shift:.1f} pixels; "
            "undistort the images first (colmap image_undistorter, or ns-process-data)"
        )
    return (fx, fy), (cx, cy)


def focal_of(entry: dict, key: str, side: int, where: str) -> float:
    """Pixels of focal length of an angle of view in radians across `side` pixels."""
    if not 0 < entry[key] < math.pi:
        raise BadFile(f"{where}: '{key}' is {entry[key]:g}; radians between 0 and pi are wanted")
    return side / 2 / math.tan(entry[key] / 2)
