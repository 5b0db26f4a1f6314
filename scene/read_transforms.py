"""transforms.json and cameras.json -> Capture: nerfstudio, Blender, our own form, OpenCV tables."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime_models.model import BadFile, Stop
from scene.capture import Capture, Photo
from scene.capture_rules import (
    COLMAP_UP,
    CaptureWorld,
    image_size,
    rigid,
    split_every_8th,
    spread_stops,
    stop_from,
)
from scene.pose import OPENCV_FROM_EYE, View
from scene.read_points import read_points

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


def read_transforms(*files: Path) -> Capture:
    """A capture from one JSON file, or from the train/val/test files of a Blender data set."""
    folder, where = files[0].parent, str(files[0])
    data, entries = gather(files)
    stops = stops_of(data, entries, where)
    shots = [s for i, e in enumerate(entries) for s in shots_of(e, i, data, stops, folder, where)]
    for stop in stops:
        if not any(s.modality == stop.name for s in shots):
            raise BadFile(f"{where}: modality {stop.name!r} has no images; add frames or drop it")
    world = CaptureWorld.of(
        np.array([s.world_from_camera for s in shots]),
        (0, 0, 1),
        data.get("up", COLMAP_UP if opencv_axes(entries[0]) else None),
        where,
    )
    photos = [photo_of(shot, world, folder) for shot in shots]
    if not any("split" in e for e in entries):
        photos = split_every_8th(photos)
    points, colors = None, None
    name = data.get("points") or data.get("ply_file_path")
    if name or (folder / "points3d.npz").is_file():
        points, colors = read_points(folder / (name or "points3d.npz"))
    named = any(isinstance(m, dict) for m in data.get("modalities", ()))
    background = data.get("background")
    if background is not None and np.shape(background) != (3,):
        raise BadFile(f"{where}: 'background' is {background!r}; give three numbers from 0 to 1")
    return world.capture(
        folder, stops, photos, points, colors, background, not named, data.get("notes")
    )


def gather(files: tuple[Path, ...]) -> tuple[dict, list[dict]]:
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
        entries += [data | split | frame for frame in frames]
        everything |= data
    return everything, entries


def read_json(file: Path) -> dict:
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadFile(f"{file}: not JSON ({error}); write it again") from None
    if not isinstance(data, dict):
        raise BadFile(f"{file}: holds a {type(data).__name__}; an object with 'frames' is wanted")
    if data.get("format", "shapeshift-capture") == "shapeshift-capture":
        version = data.get("version", 1)
        if version != 1:
            raise BadFile(f"{file}: version {version!r} of the capture form; this program reads 1")
    return data


def stops_of(data: dict, entries: list[dict], where: str) -> tuple[Stop, ...]:
    listed = data.get("modalities")
    if not listed:
        return spread_stops(dict.fromkeys(e.get("modality", "RGB") for e in entries))
    if all(isinstance(m, str) for m in listed):
        return spread_stops(listed)
    if not all(isinstance(m, dict) for m in listed):
        raise BadFile(f"{where}: 'modalities' must be a list of names or of objects")
    stops = tuple(stop_from(m, where) for m in listed)
    if len({s.name for s in stops}) < len(stops):
        raise BadFile(f"{where}: two modalities have the same name; rename one")
    return tuple(sorted(stops, key=lambda s: s.x))


def shots_of(
    entry: dict, number: int, data: dict, stops: tuple[Stop, ...], folder: Path, where: str
) -> list[Shot]:
    """The photos of one frame: one, or one a modality where the frame names none of several."""
    file = entry.get("file_path") or entry.get("file")
    if not isinstance(file, str):
        raise BadFile(f"{where}: frame {number} names no image; give it a 'file_path'")
    where = f"{where}: frame {number} ({file})"
    key = next((k for k in POSES if k in entry), None)
    if key is None:
        raise BadFile(f"{where} has no pose; run COLMAP first, or give it a 'transform_matrix'")
    matrix = rigid(entry[key], where)
    if not opencv_axes(entry):
        matrix = matrix @ OPENCV_FROM_EYE
    names = [s.name for s in stops]
    if "modality" in entry or len(names) == 1:
        modality = entry.get("modality", names[0])
        if modality not in names:
            raise BadFile(f"{where} is of modality {modality!r}; the file lists {names}")
        return [Shot(entry, modality, find_image(folder / file, where), matrix, where)]
    return [Shot(entry, n, find_image(folder / n / file, where), matrix, where) for n in names]


def opencv_axes(entry: dict) -> bool:
    """Whether poses have x right, y down, z forward; without a word on it they are OpenGL's."""
    if "transform_matrix" in entry:
        return "opencv" in str(entry.get("convention", "")).lower()
    return "opengl" not in str(entry.get("convention", "")).lower()


def find_image(path: Path, where: str) -> Path:
    for ending in ENDINGS:
        found = path.with_name(path.name + ending)
        if found.is_file():
            return found
    raise BadFile(f"{where}: the image file {path} is missing; put it there or drop the frame")


def photo_of(shot: Shot, world: CaptureWorld, folder: Path) -> Photo:
    entry, where = shot.entry, shot.where
    for key in LENS:
        value = entry.get(key, 0)
        if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e30:
            raise BadFile(f"{where}: '{key}' is {str(value)[:40]!r}; a number is wanted")
    claimed = (int(entry["w"]), int(entry["h"])) if "w" in entry and "h" in entry else None
    size = image_size(shot.path, claimed)
    focal, centre = intrinsics(entry, size, where)
    split = entry.get("split", "train")
    if split not in SPLITS:
        raise BadFile(f"{where} has split {split!r}; use train or test")
    mask = entry.get("mask_path") or entry.get("mask")
    if mask is not None:
        mask = folder / mask
        image_size(mask, size)
    view = View.from_pinhole(world.turned(shot.world_from_camera), focal, centre, size)
    return Photo(view, shot.path, shot.modality, mask, SPLITS[split])


def intrinsics(entry: dict, size: tuple[int, int], where: str) -> tuple[tuple, tuple]:
    """(fx, fy), (cx, cy) in pixels; lenses that bend lines are refused."""
    width, height = size
    if "fl_x" in entry:
        fx = float(entry["fl_x"])
        fy = float(entry.get("fl_y", fx))
    elif "camera_angle_x" in entry:
        fx = width / 2 / np.tan(float(entry["camera_angle_x"]) / 2)
        fy = fx
        if "camera_angle_y" in entry:
            fy = height / 2 / np.tan(float(entry["camera_angle_y"]) / 2)
    else:
        raise BadFile(f"{where} has no focal length; give 'fl_x' in pixels or 'camera_angle_x'")
    if not (0 < fx < np.inf and 0 < fy < np.inf):
        raise BadFile(f"{where} has focal lengths {fx}, {fy}; both must be above 0")
    cx, cy = float(entry.get("cx", width / 2)), float(entry.get("cy", height / 2))
    x, y = max(cx, width - cx) / fx, max(cy, height - cy) / fy
    k1, k2, k3, k4, p1, p2 = (float(entry.get(k, 0)) for k in ("k1", "k2", "k3", "k4", "p1", "p2"))
    r2 = x * x + y * y
    bend = abs(k1) * r2 + abs(k2) * r2**2 + abs(k3) * r2**3 + abs(k4) * r2**4
    shift = fx * (np.sqrt(r2) * bend + 3 * (abs(p1) + abs(p2)) * r2)
    if not shift <= STRAIGHT or "FISHEYE" in str(entry.get("camera_model", "")):
        raise BadFile(
            f"{where} was taken through a lens that shifts its corners by {shift:.1f} pixels; "
            "undistort the images first (colmap image_undistorter, or ns-process-data)"
        )
    return (fx, fy), (cx, cy)
